"""The dates of releases: from the index that pip is configured for, kept in the cache, and absent where nobody says."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from mill import PACKAGE

from velodrome.scenarios.history import Children
from velodrome.scenarios.history.dates import find_release_dates, select_first_days

pytestmark = pytest.mark.once  # an index and a cache

VERSIONS = ["1.0", "1.1", "2.0"]
FILES = [
    {"filename": f"{PACKAGE}-1.0-py3-none-any.whl", "upload-time": "2026-01-02T23:59:59.5Z"},
    {"filename": f"{PACKAGE}-1.0.tar.gz", "upload-time": "2026-01-01T10:00:00Z"},
    {"filename": f"{PACKAGE}-1.1-py3-none-any.whl"},
    {"filename": f"{PACKAGE}-2.0-py3-none-any.whl", "upload-time": "2026-05-06T00:00:00+02:00"},
    {"filename": "no wheel.whl", "upload-time": "2026-05-06T00:00:00Z"},
]


class Index:
    """A registry on this machine, in the JSON form if it knows it, that counts the questions."""

    def __init__(self) -> None:
        self.asked = 0
        self.knows_json = True
        index = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                index.asked += self.path == f"/simple/{PACKAGE}/"
                asked_for_json = "application/vnd.pypi.simple.v1+json" in self.headers["Accept"]
                in_json = index.knows_json and asked_for_json
                body = json.dumps({"meta": {"api-version": "1.1"}, "files": FILES}) if in_json else "<html></html>"
                self.send_response(200)
                self.send_header("Content-Type", "application/vnd.pypi.simple.v1+json" if in_json else "text/html")
                self.end_headers()
                self.wfile.write(body.encode())

            def log_message(self, format: str, *_: Any) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.address = f"http://127.0.0.1:{self.server.server_port}/simple"


@pytest.fixture
def index(monkeypatch: pytest.MonkeyPatch) -> Iterator[Index]:
    found = Index()
    thread = threading.Thread(target=found.server.serve_forever, daemon=True)
    thread.start()
    monkeypatch.delenv("PIP_NO_INDEX", raising=False)
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    monkeypatch.setenv("PIP_INDEX_URL", found.address)
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", "")
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    yield found
    found.server.shutdown()
    found.server.server_close()
    thread.join()


def find(cache: Path, versions: list[str], *, ask: bool = True) -> dict[str, str]:
    return find_release_dates(PACKAGE, versions, cache, Children(), ask=ask)


def test_dates_are_those_of_the_first_files_and_are_asked_for_once(index: Index, tmp_path: Path) -> None:
    expected = {"1.0": "2026-01-01", "2.0": "2026-05-05"}
    assert find(tmp_path / "cache", VERSIONS) == expected
    assert index.asked == 1
    # Neither those that are known nor one that has no date is asked for again; without the registry they are there.
    assert find(tmp_path / "cache", VERSIONS) == expected
    assert find(tmp_path / "cache", ["2.0", "3.0"], ask=False) == {"2.0": "2026-05-05"}
    assert index.asked == 1
    find(tmp_path / "cache", ["3.0"])
    assert index.asked == 2


def test_an_index_without_the_form_gives_no_dates_and_is_asked_again(index: Index, tmp_path: Path) -> None:
    index.knows_json = False
    assert find(tmp_path, VERSIONS) == {}
    index.knows_json = True
    assert find(tmp_path, ["1.0"]) == {"1.0": "2026-01-01"}


def test_without_an_index_there_are_no_dates(index: Index, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    assert find(tmp_path, VERSIONS) == {}
    assert index.asked == 0


def test_a_damaged_file_of_dates_is_asked_for_anew(index: Index, tmp_path: Path) -> None:
    (tmp_path / f".dates-{PACKAGE}.json").write_text("{", encoding="utf-8")
    assert find(tmp_path, ["1.0"]) == {"1.0": "2026-01-01"}


def test_texts_that_are_no_times_are_left_out() -> None:
    times: dict[str, Any] = {
        f"{PACKAGE}-1.0.tar.gz": "yesterday",
        f"{PACKAGE}-1.1.tar.gz": 5,
        f"{PACKAGE}-x.tar.gz": "2026-01-01T00:00:00Z",
        f"{PACKAGE}-1.2.tar.gz": "2026-01-01T00:00:00Z",
    }
    assert select_first_days(times) == {"1.2": "2026-01-01"}
