"""A stored run, looked at: its page from its files, and nothing that anybody else could reach."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from typing import Any

import pytest

from tests.sealing import age_folder, change_document
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.run.runner import plan_run, run_plan
from velodrome.scenarios.scenario.schema import load_scenario
from velodrome.scenarios.view import viewer as replay
from velodrome.scenarios.view import viewing as view
from velodrome.scenarios.view.server import LOOPBACK, Content, RunPageServer

VIEWER = {"": Content("text/html", b"<title>viewer</title>"), "re_viewer.js": Content("text/javascript", b"1")}
LISTENING = "0A"  # state of a socket in /proc/net/tcp

needs_proc = pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="no /proc: the sockets cannot be listed")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the reference and one engine."""
    plan = plan_run(*load_scenario("q2", {"simulation.duration": 0.1}), wanted=["mujoco-native"])
    return run_plan(plan, tmp_path_factory.mktemp("runs"), lambda *_: None, lambda _: None).folder


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "run"))


def listening(group: int) -> set[str]:
    """Addresses, in hexadecimal digits, that the processes of a group listen on."""
    sockets = set()
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if os.getpgid(int(process.name)) == group:
                sockets |= {os.readlink(entry) for entry in (process / "fd").iterdir()}
        except OSError:
            continue  # ended meanwhile
    found = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in Path(table).read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == LISTENING and f"socket:[{fields[9]}]" in sockets:
                found.add(fields[1].partition(":")[0])
    return found


LOOPBACK_HEX = "0100007F"  # 127.0.0.1, in the machine's order of bytes


@contextmanager
def serving(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RunPageServer]:
    monkeypatch.setattr(view, "viewer_files", lambda: VIEWER)
    with view.page_server(folder, 0) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def ask(server: RunPageServer, path: str, method: str = "GET", host: str | None = None) -> tuple[HTTPResponse, bytes]:
    connection = HTTPConnection(LOOPBACK, server.server_port, timeout=10)
    connection.request(method, path, headers={} if host is None else {"Host": host})
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


def test_the_page_of_a_stored_run_has_its_engines_and_title(folder: Path) -> None:
    text = view.stored_page(folder)
    assert json.loads((folder / "manifest.json").read_text())["title"] in text
    start = text.index('id="data">') + len('id="data">')
    assert json.loads(text[start : text.index("</script>", start)])["engines"] == ["reference", "mujoco-native"]


def test_the_server_gives_the_runs_files_and_the_viewer(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with serving(copy, monkeypatch) as server:
        page = (copy / view.REPORT).read_bytes()
        assert ask(server, "/report.html?replay")[1] == page
        assert ask(server, "/comparison.rrd")[1] == (copy / view.RECORDING).read_bytes()
        answer, body = ask(server, "/report.html", "HEAD")
        assert (answer.getheader("Content-Length"), body) == (str(len(page)), b"")
        answer, body = ask(server, "/viewer/?url=x")
        assert body == VIEWER[""].body
        policy = answer.getheader("Content-Security-Policy") or ""
        assert policy.startswith("default-src 'self' data: blob:;")
        assert "http" not in policy
        answer, _ = ask(server, "/")
        assert (answer.status, answer.getheader("Location")) == (302, server.address)


@pytest.mark.parametrize(
    "path", ["/../../etc/passwd", "/..%2f..%2fetc/passwd", "//etc/passwd", "/.secret", "/sub/inner", "/viewer/nothing"]
)
def test_nothing_else_is_given(path: str, copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (copy / ".secret").write_text("secret")
    (copy / "sub").mkdir()
    (copy / "sub" / "inner").write_text("inner")
    with serving(copy, monkeypatch) as server:
        assert ask(server, path)[0].status == 404
        assert ask(server, "/report.html", "POST")[0].status == 501


def test_a_name_that_another_site_gives_this_machine_is_refused(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with serving(copy, monkeypatch) as server:
        port = server.server_port
        assert ask(server, "/report.html", host=f"evil.example:{port}")[0].status == 403
        assert ask(server, "/report.html", host=f"localhost:{port}")[0].status == 200


def test_the_server_listens_on_the_loopback_interface_only(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with serving(copy, monkeypatch) as server:
        assert server.socket.getsockname()[0] == LOOPBACK


def test_a_taken_port_is_said(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with serving(copy, monkeypatch) as server, pytest.raises(ScenarioError, match="cannot listen"):
        view.page_server(copy, server.server_port)


def test_serving_ends_with_an_interrupt(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_: RunPageServer) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(view, "viewer_files", lambda: VIEWER)
    monkeypatch.setattr(RunPageServer, "serve_forever", interrupted)
    addresses: list[str] = []
    view.serve(copy, 0, addresses.append)
    assert addresses[0].startswith(f"http://{LOOPBACK}:")


@needs_proc
def test_the_viewers_files_come_over_the_loopback_interface_and_ask_for_nothing_else(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[tuple[int, set[str]]] = []

    def watched(program: subprocess.Popen[bytes], port: int) -> None:
        wait(program, port)
        seen.append((program.pid, listening(program.pid)))

    wait = replay._wait_until_listening
    monkeypatch.setattr(replay, "_wait_until_listening", watched)
    files = replay.viewer_files()
    group, addresses = seen[0]
    assert addresses == {LOOPBACK_HEX}
    assert set(files) == {"", "re_viewer.js", "re_viewer_bg.wasm", "favicon.ico"}
    assert files["re_viewer_bg.wasm"].body.startswith(b"\0asm")
    assert b"re_viewer.js" in files[""].body
    assert b"googleapis" not in files[""].body
    deadline = time.monotonic() + 10
    while listening(group) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not listening(group)  # nothing is left running


@needs_proc
@pytest.mark.slow
def test_the_native_viewer_listens_on_the_loopback_interface_only(folder: Path, tmp_path: Path) -> None:
    if not any(Path("/usr/share/vulkan/icd.d").glob("*.json")):
        pytest.skip("no Vulkan driver; Debian's mesa-vulkan-drivers has one that needs no graphics card")
    command = [*view.native_command(folder / view.RECORDING), "--headless"]
    environment = os.environ | {"XDG_RUNTIME_DIR": str(tmp_path)}
    program = subprocess.Popen(
        command, start_new_session=True, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        deadline = time.monotonic() + 30
        while not (found := listening(program.pid)) and time.monotonic() < deadline:
            time.sleep(0.1)
        assert found == {LOOPBACK_HEX}
    finally:
        os.killpg(program.pid, signal.SIGTERM)
        program.wait()


def test_a_viewer_that_fails_is_said_in_a_line(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(view, "rerun", lambda: "/nowhere/rerun")
    with pytest.raises(ScenarioError, match="cannot be started"):
        view.open_native(folder)
    monkeypatch.setattr(view, "native_command", lambda _: [sys.executable, "-c", "raise SystemExit(3)"])
    with pytest.raises(ScenarioError, match="status 3"):
        view.open_native(folder)
    monkeypatch.setattr(replay, "rerun", lambda: "/bin/false")
    with pytest.raises(ScenarioError, match="status 1 instead of serving"):
        view.page_server(folder, 0)


@pytest.mark.parametrize("name", ["manifest.json", "metrics.json", "scenario.toml", "mujoco-native.parquet"])
def test_a_folder_that_is_no_run_is_refused_with_what_is_missing(name: str, copy: Path) -> None:
    (copy / name).unlink()
    with pytest.raises(ScenarioError, match=name) as caught:
        view.stored_page(copy)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("manifest.json", "{"),
        ("manifest.json", "[]"),
        ("manifest.json", "{}"),
        ("manifest.json", '{"start": {"growth_rate": 1.0, "family": 1}, "engines": []}'),
        ("metrics.json", '{"reference": {}}'),
        ("scenario.toml", "title = 3"),
        ("reference.parquet", "no table"),
    ],
)
def test_broken_files_are_refused_in_one_line(name: str, content: str, copy: Path) -> None:
    (copy / name).write_text(content)
    with pytest.raises(ScenarioError) as caught:
        view.stored_page(copy)
    assert "\n" not in str(caught.value)


def test_a_manifest_without_versions_is_refused(copy: Path) -> None:
    change_document(copy / "manifest.json", lambda manifest: manifest.pop("libraries"))
    with pytest.raises(ScenarioError, match="libraries"):
        view.stored_page(copy)


def test_the_page_of_a_folder_of_before_there_were_versions(copy: Path) -> None:
    page = view.stored_page(copy)
    assert page == (copy / "report.html").read_text(encoding="utf-8")
    age_folder(copy)
    # It says less of the machine, and everything else as before.
    rows = set(page.splitlines()) - set(view.stored_page(copy).splitlines())
    assert rows
    assert all(re.search(r'<th scope="row">(processor|blas_\w+|openblas_coretype)</th>', row) for row in rows)


def test_what_is_asked_of_a_folder_without_a_recording(tmp_path: Path) -> None:
    calls: list[Any] = [view.open_native, lambda folder: view.page_server(folder, 0)]
    for call in calls:
        with pytest.raises(ScenarioError, match=r"comparison\.rrd"):
            call(tmp_path)
        with pytest.raises(ScenarioError, match="no such folder"):
            call(tmp_path / "nowhere")
