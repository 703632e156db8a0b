"""What the shell completes, how little it loads for that, and the shells' scripts."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from velodrome.engines.registry import ENTRY_POINT_GROUP, engine_names, uninstalled_engines
from velodrome.scenarios import names
from velodrome.scenarios.scenario.schema import library_names

# Loading any of them takes longer than a completion may.
HEAVY = ("numpy", "scipy", "numba", "pyarrow", "exudyn", "mujoco", "rerun", "matplotlib", "velodrome.engines")
COMMAND = "from velodrome.scenarios.cli import supervised_main; supervised_main()"


def called(folder: Path, *arguments: str, before: str = "", **variables: str) -> subprocess.CompletedProcess[str]:
    """The command as the console calls it, in a process and a home of its own."""
    code = f"import sys; sys.argv = ['velodrome', *{list(arguments)!r}]; {before}{COMMAND}"
    environment = os.environ | {"HOME": str(folder), "PYTHONPATH": os.pathsep.join(sys.path)} | variables
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, cwd=folder)


def completed(line: str, folder: Path, before: str = "") -> list[str]:
    """What bash is told for a line of which the last word is being typed."""
    place = str(len(line.split(" ")) - 1)
    done = called(folder, before=before, COMP_WORDS=line, COMP_CWORD=place, _VELODROME_COMPLETE="complete_bash")
    assert (done.returncode, done.stderr) == (0, "")
    return [line for line in done.stdout.splitlines() if line]


def test_commands_scenarios_engines_and_files_are_completed(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("")
    (tmp_path / "mine.txt").write_text("")
    (tmp_path / "myfolder").mkdir()
    (tmp_path / ".hidden.toml").write_text("")
    assert completed("velodrome sh", tmp_path) == ["show"]
    q2 = [name for name in library_names() if name.startswith("q2")]
    assert completed("velodrome run q2", tmp_path) == q2
    assert completed("velodrome run q2 m", tmp_path) == ["mine.toml", "myfolder/"]
    announced = sorted([*engine_names(), *uninstalled_engines()])
    mujoco = [name for name in announced if name.startswith("mujoco-")]
    assert len(mujoco) >= 4
    for command in ("run q2", "check", "precision q2", "diff a b"):
        assert completed(f"velodrome {command} --engine mujoco-", tmp_path) == mujoco
    assert completed("velodrome show bi", tmp_path) == ["bicycle"]
    assert completed("velodrome show exudyn-b", tmp_path) == ["exudyn-builtin"]
    assert completed("velodrome sweep ", tmp_path) == ["mine.toml", "myfolder/"]
    assert completed("velodrome view my", tmp_path) == ["myfolder/"]
    assert completed(f"velodrome view {tmp_path}/my", tmp_path) == [f"{tmp_path}/myfolder/"]
    assert completed("velodrome run nothing/at/all", tmp_path) == []


def test_completion_loads_nothing_heavy(tmp_path: Path) -> None:
    # What is loaded is looked at when the process ends, in the child that the command runs in.
    before = (
        "import atexit, os; "
        f"atexit.register(lambda: print(*sorted(set({HEAVY!r}) & set(sys.modules)), file=open('loaded.txt', 'a'))); "
    )
    for line in ("velodrome run q2", "velodrome run q2 --engine m", "velodrome show b"):
        assert completed(line, tmp_path, before)
    assert set((tmp_path / "loaded.txt").read_text().split()) == set()


def test_the_names_are_those_that_the_suite_uses() -> None:
    assert names._ENGINES == ENTRY_POINT_GROUP
    assert set(engine_names()) <= set(names.announced_names())


def test_the_script_is_shown_and_installed_for_this_user(tmp_path: Path) -> None:
    fixed = {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    shown = called(tmp_path, "--show-completion", "bash", **fixed)
    assert (shown.returncode, shown.stderr) == (0, "")
    assert "_VELODROME_COMPLETE=complete_bash" in shown.stdout
    assert list(tmp_path.iterdir()) == []
    installed = called(tmp_path, "--install-completion", "bash", **fixed)
    assert (installed.returncode, installed.stderr) == (0, "")
    script = tmp_path / ".bash_completions" / "velodrome.sh"
    assert str(script) in installed.stdout
    assert "complete -o default -F _velodrome_completion velodrome" in script.read_text()


def test_an_exit_of_a_command_is_not_taken_for_a_completion(tmp_path: Path) -> None:
    before = "import velodrome.scenarios.commands.run as run; run.parse_changes = lambda *_: sys.exit(0); "
    done = called(tmp_path, "run", "q2", before=before)
    assert done.returncode == 1
    assert "something called sys.exit(0) before the command was done" in done.stderr


@pytest.mark.parametrize("width", ["60", "80", "200"])
def test_help_names_the_options_whole(width: str, tmp_path: Path) -> None:
    done = called(tmp_path, "--help", COLUMNS=width)
    assert done.returncode == 0
    for option in ("--install-completion", "--show-completion", "--help"):
        assert option in done.stdout
    assert all(len(line) <= int(width) for line in done.stdout.splitlines())
