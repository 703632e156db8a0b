"""When a stored row still holds: the adapter's code, what the ride loaded, and what ended it."""

from __future__ import annotations

import shutil
import sys
from importlib import invalidate_caches
from pathlib import Path
from typing import Any

import pytest
from mill import CIRCLE, FAULT, PACKAGE, install_mill, make_wheel, use_registry

from velodrome.scenarios.history import HistoryFolder, PlannedRide
from velodrome.scenarios.history.adapters import digest_adapter
from velodrome.scenarios.history.loaded import are_installed, list_loaded_packages
from velodrome.scenarios.history.process import describe_place
from velodrome.scenarios.history.releases import Release

RODE: dict[str, Any] = {"status": "rode", "reason": None, "loaded": {}}


def install_helper(folder: Path, version: str, factor: float) -> None:
    """Install the package `millhelper`, which gives a factor, over another version of it."""
    for old in folder.glob("millhelper-*"):
        shutil.rmtree(old)
    info = folder / f"millhelper-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: millhelper\nVersion: {version}\n")
    (info / "top_level.txt").write_text("millhelper\n")
    (folder / "millhelper.py").write_text(f"FACTOR = {factor!r}  # of {version}\n")
    invalidate_caches()


@pytest.mark.parametrize(
    ("row", "holds"),
    [
        (RODE, True),
        (RODE | {"loaded": {"numpy": "0.1"}}, False),
        (RODE | {"loaded": {"a-package-that-nobody-has": "1.0"}}, False),
        ({"status": "failed", "reason": "ZeroDivisionError", "repeated": False}, True),
        ({"status": "failed", "reason": "no result within 1 s", "repeated": True}, False),
        ({"status": "refused", "reason": "it rides no circles", "repeated": False}, True),
        ({"status": "not-installable", "reason": "no wheel"}, False),
    ],
)
def test_rows_hold_that_would_be_the_same(row: dict[str, Any], holds: bool, tmp_path: Path) -> None:
    folder, ride = HistoryFolder(tmp_path, False), PlannedRide(Release("mill", "1.0"), "mill", "circle", "ab", "", "")
    folder.write(ride, row)
    assert (folder.read(ride) == row) == holds
    assert (folder.read(ride) is None) != holds


def test_what_a_process_has_loaded_is_told_by_its_versions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    install_helper(tmp_path, "1.0", 1.0)
    assert "millhelper" not in list_loaded_packages([])
    __import__("millhelper")
    monkeypatch.delitem(sys.modules, "millhelper")
    __import__("millhelper")
    loaded = list_loaded_packages([])
    assert loaded["millhelper"] == "1.0"
    assert loaded.keys() >= {"numpy", "pytest"}
    assert are_installed(loaded)
    assert "millhelper" not in list_loaded_packages([tmp_path])
    install_helper(tmp_path, "2.0", 1.0)
    assert not are_installed(loaded)


def test_the_code_of_an_adapter_is_part_of_its_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_mill(tmp_path, monkeypatch)
    # The module of the test before may be loaded still.
    monkeypatch.delitem(sys.modules, PACKAGE, raising=False)
    module = tmp_path / "site" / f"{PACKAGE}.py"
    digest_adapter.cache_clear()
    assert digest_adapter(PACKAGE, PACKAGE) is None, "the code of the releases themselves is no adapter"
    assert digest_adapter("exudyn", "exudyn") is None, "the suite's digest covers it"
    before = digest_adapter(PACKAGE, "a-library")
    assert before is not None
    digest_adapter.cache_clear()
    assert digest_adapter(PACKAGE, "a-library") == before
    module.write_text(module.read_text() + "# changed\n")
    digest_adapter.cache_clear()
    assert digest_adapter(PACKAGE, "a-library") != before
    digest_adapter.cache_clear()


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A registry without any release yet, the engine installed, a short scenario, and an empty cache."""
    install_mill(tmp_path / "installed", monkeypatch)
    folder = tmp_path / "registry"
    use_registry(folder, monkeypatch)
    monkeypatch.setenv("VELODROME_CACHE", str(tmp_path / "cache"))
    (tmp_path / "circle.toml").write_text(CIRCLE, encoding="utf-8")
    return folder


@pytest.mark.slow
def test_going_on_repeats_what_a_limit_ended_and_keeps_what_the_engine_raised(
    velodrome, registry: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sentinel = tmp_path / "awaited"
    log = tmp_path / "log"
    count = f"open({str(log)!r}, 'a').write(__version__ + ' ')"
    make_wheel(registry, "1.0", before=count)
    make_wheel(registry, "1.1", before=f"{count}; os.path.exists({str(sentinel)!r}) or time.sleep(1000)")
    make_wheel(registry, "1.2", before=f"{count}; 1 / 0")
    make_wheel(registry, "1.3", before=f"{count}; open({str(sentinel)!r})")
    make_wheel(registry, "1.4", before=f"{count}; os.path.exists({str(sentinel)!r}) or os.kill(os.getpid(), 9)")
    words = ("history", f"{PACKAGE}>=1", "circle.toml", "--json")
    first = velodrome(*words, "--time-limit", "20").json()
    assert [row["status"] for row in first["releases"]] == ["rode", "failed", "failed", "failed", "failed"]
    sentinel.touch()
    log.unlink()
    again = velodrome(*words, "--resume", "--time-limit", "inf")
    assert again.status == 0, again.stderr
    assert [row["status"] for row in again.json()["releases"]] == ["rode", "rode", "failed", "rode", "rode"]
    assert {*log.read_text().split()} == {"1.1", "1.3", "1.4"}


@pytest.mark.slow
def test_a_row_says_where_a_ride_hung(velodrome, registry: Path) -> None:
    make_wheel(registry, "1.0")
    make_wheel(registry, "1.1", loading="time.sleep(1000)")
    make_wheel(registry, "1.2", before="time.sleep(1000)")
    # Compiled code that never returns to Python.
    make_wheel(registry, "1.3", before="import ctypes; ctypes.PyDLL(None).sleep(1000)")
    found = velodrome("history", f"{PACKAGE}>=1", "circle.toml", "--time-limit", "30", "--json")
    rows = {row["version"]: (row["status"], row["reason"]) for row in found.json()["releases"]}
    lines = (registry.parent / "installed" / "site" / f"{PACKAGE}.py").read_text().splitlines()
    importing, riding = lines.index("__version__ = '1.0'"), lines.index("        pass", lines.index(SIMULATE)) + 1
    assert rows == {
        "1.0": ("rode", None),
        "1.1": ("failed", f"no result within 30 s, while it imported {PACKAGE}.py (line {importing})"),
        "1.2": ("failed", f"no result within 30 s, while in simulate ({PACKAGE}.py, line {riding})"),
        "1.3": ("failed", f"no result within 30 s, while in simulate ({PACKAGE}.py, line {riding})"),
    }


SIMULATE = "    def simulate(self, problem, settings, progress):"
FRAMES = """Current thread 0x00007f1 (most recent call first):
  File "{innermost}", line 7 in {function}
  File "<frozen importlib._bootstrap>", line 241 in _call_with_frames_removed
  File "/env/mill/__init__.py", line 3 in <module>
  File "<frozen importlib._bootstrap>", line 1176 in _find_and_load
  File "/suite/engines/mill.py", line 12 in simulate
"""
RIDING = FRAMES.replace("<module>", "step")


@pytest.mark.parametrize(
    ("frames", "told"),
    [
        ("", None),
        ("Segmentation fault", None),
        (FRAMES.format(innermost="/env/mill/part.py", function="<module>"), "while it imported mill/part.py (line 7)"),
        # What an import calls is still the import.
        (FRAMES.format(innermost="/env/mill/part.py", function="wait"), "while it imported mill/__init__.py (line 3)"),
        (FRAMES.format(innermost="/usr/lib/socket.py", function="recv"), "while it imported mill/__init__.py (line 3)"),
        (
            FRAMES.replace("<module>", "step").format(innermost="/env/mill/part.py", function="wait"),
            "while in wait (mill/part.py, line 7)",
        ),
        (
            FRAMES.replace("<module>", "step").format(innermost="/usr/lib/socket.py", function="recv"),
            "while in recv (socket.py, line 7)",
        ),
    ],
)
def test_frames_say_in_words_where_a_process_is(frames: str, told: str | None) -> None:
    assert describe_place(frames, Path("/env")) == told


@pytest.mark.slow
def test_a_library_of_the_suites_environment_is_part_of_what_was_ridden(
    velodrome, registry: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = tmp_path / "installed" / "site"
    install_helper(site, "1.0", 1.0)
    before = (
        "import millhelper; problem = __import__('dataclasses').replace(problem, qd=problem.qd * millhelper.FACTOR)"
    )
    make_wheel(registry, "1.0", before=before, requires="millhelper")
    words = ("history", f"{PACKAGE}==1.0", "circle.toml", "--json")
    (first,) = velodrome(*words).json()["releases"]
    assert first["status"] == "rode", first
    install_helper(site, "2.0", FAULT)
    (second,) = velodrome(*words, "--resume").json()["releases"]
    assert second["bits"] != first["bits"]
