"""No success without a verdict: engines that exit, interrupt, panic or end the process fail, in every command."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from altered import Altered
from quitting import LINE, NAME, announce

from velodrome.engines.engine import Engine, Settings, Trajectory
from velodrome.scenarios import gate
from velodrome.scenarios.commands import options
from velodrome.scenarios.gate.verdict import CHANGES, Verdict
from velodrome.scenarios.run import runner
from velodrome.scenarios.run.runner import configure_engine

DEEDS = {
    "sys.exit(0)": "it called sys.exit(0)",
    "sys.exit(3)": "it called sys.exit(3)",
    "sys.exit('words')": "it called sys.exit('words')",
    "raise KeyboardInterrupt": "it raised KeyboardInterrupt",
    "raise GeneratorExit": "it raised GeneratorExit",
    "raise type('PanicException', (BaseException,), {})('at src/lib.rs')": "it raised PanicException: at src/lib.rs",
}
AT = f"(quitting_engine.py:{LINE})"
CHECK = ("check", "plane-circle", "--engine", NAME)
RUN = ("run", "plane-circle", "--engine", NAME, "--duration", "0.1", "--out", "runs")
PRECISION = ("precision", "plane-circle", "--engine", NAME, "--duration", "0.5", "--levels", "2", "--no-eigenvalues")
SWEEP = f'scenario = "iftomm-1"\nengines = ["reference", "{NAME}"]\n[grid]\nsimulation.duration = [0.1]\n'


@pytest.fixture
def planted(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch):
    """Install an engine that runs a statement at a place."""

    def plant(place: str, statement: str) -> None:
        announce(tmp_path_factory.mktemp("site"), monkeypatch, place, statement)

    return plant


@pytest.mark.parametrize("place", ["import", "version", "check", "step_noise", "simulate", "progress"])
def test_an_engine_that_exits_fails_the_check_wherever_it_does(place: str, planted, velodrome, tmp_path: Path) -> None:
    planted(place, "sys.exit(0)")
    result = velodrome(*CHECK, "--junit", "gate.xml", "--markdown", "gate.md", "--json")
    document = result.json()
    (verdict,) = document["verdicts"]
    assert (result.status, document["passes"], verdict["status"]) == (1, False, "missing")
    assert verdict["reason"].startswith("did not run: ")
    assert verdict["reason"].endswith(f"it called sys.exit(0) {AT}")
    assert 'tests="1" failures="1"' in (tmp_path / "gate.xml").read_text()
    assert (tmp_path / "gate.md").read_text().startswith("# Drift gate: fails")


@pytest.mark.parametrize("statement", DEEDS)
def test_whatever_would_end_the_process_is_a_failure_of_the_engine(statement: str, planted, velodrome) -> None:
    planted("simulate", statement)
    result = velodrome(*CHECK)
    assert result.status == 1
    assert f"plane-circle: {NAME}: run: missing: did not run: {DEEDS[statement]} {AT}" in result.stdout
    assert "the gate fails" in result.stdout
    assert result.stderr == ""


@pytest.mark.parametrize("statement", DEEDS)
def test_a_run_keeps_the_others_and_is_status_1(statement: str, planted, velodrome) -> None:
    planted("progress", statement)
    result = velodrome(*RUN, "--json")
    (entry,) = result.json()["runs"]
    assert (result.status, entry["complete"], list(entry["engines"])) == (1, True, ["reference"])
    assert entry["failures"] == {NAME: f"{DEEDS[statement]} {AT}"}
    assert f"{NAME} did not run: {DEEDS[statement]} {AT}" in result.stderr


@pytest.mark.parametrize("place", ["import", "version", "check"])
def test_an_engine_that_exits_before_its_ride_is_told_in_one_line(
    place: str, planted, velodrome, tmp_path: Path
) -> None:
    planted(place, "sys.exit(0)")
    for command in (RUN, PRECISION):
        result = velodrome(*command)
        assert (result.status, result.stdout, result.stderr.count("\n")) == (2, "", 1), command
        assert f"it called sys.exit(0) {AT}" in result.stderr
    assert not list(tmp_path.iterdir())


def test_precision_is_status_1_when_an_engine_rides_at_no_step(planted, velodrome) -> None:
    planted("simulate", "sys.exit(0)")
    result = velodrome(*PRECISION, "--json")
    entry = result.json()["engines"][NAME]
    assert (result.status, entry["ran"], entry["points"]) == (1, False, [])
    assert {failure["reason"] for failure in entry["failures"]} == {f"it called sys.exit(0) {AT}"}


def test_a_sweep_has_a_row_for_an_engine_that_exits(planted, velodrome, tmp_path: Path) -> None:
    planted("simulate", "sys.exit(0)")
    (tmp_path / "s.toml").write_text(SWEEP)
    result = velodrome("sweep", "s.toml", "--workers", "1", "--json")
    document = result.json()
    assert (result.status, document["missing"]) == (1, 0)
    assert document["engines"][NAME]["reasons"] == [f"failed: it called sys.exit(0) {AT}"]
    assert document["engines"]["reference"]["rows"] == {"done": 1}


def test_a_sweep_refuses_an_engine_that_exits_when_it_is_loaded(planted, velodrome, tmp_path: Path) -> None:
    planted("import", "sys.exit(0)")
    (tmp_path / "s.toml").write_text(SWEEP)
    result = velodrome("sweep", "s.toml")
    assert (result.status, f"it called sys.exit(0) {AT}" in result.stderr) == (2, True)
    assert not (tmp_path / "sweeps").exists()


def test_a_diff_says_which_engine_it_could_not_ask(planted, velodrome, tmp_path: Path) -> None:
    planted("step_noise", "sys.exit(0)")
    for out in ("a", "b"):
        assert velodrome(*RUN[:-1], out).status == 0
    folders = [str(next((tmp_path / out).iterdir())) for out in ("a", "b")]
    result = velodrome("diff", *folders, "--json")
    assert result.status == 0
    assert result.json()["notes"] == [
        f"{NAME} cannot be asked here: it called sys.exit(0) {AT}; its steps are allowed round-off only"
    ]


def test_list_shows_an_engine_that_exits_with_its_reason(planted, velodrome) -> None:
    planted("import", "sys.exit(0)")
    engines = {entry["name"]: entry for entry in velodrome("list", "--json").json()["engines"]}
    assert engines[NAME]["error"].endswith(f"it called sys.exit(0) {AT}")


@pytest.mark.parametrize("command", [RUN, CHECK, PRECISION], ids=lambda command: command[0])
def test_a_typing_error_is_told_with_its_line_and_shown_whole_when_asked(
    command: tuple[str, ...], planted, velodrome
) -> None:
    planted("simulate", "INNER.simulatte()")
    words = f"AttributeError: 'LagrangeEngine' object has no attribute 'simulatte' {AT}"
    result = velodrome(*command)
    assert result.status == 1
    assert words in result.stdout
    assert "Traceback" not in result.stderr
    whole = velodrome(*command, "--traceback").stderr
    assert "Traceback (most recent call last)" in whole
    assert f'quitting_engine.py", line {LINE}, in do' in whole


def test_the_traceback_of_an_engine_that_cannot_be_loaded_is_shown_when_asked(planted, velodrome) -> None:
    planted("import", "INNER.simulatte()")
    assert "Traceback" not in velodrome(*RUN).stderr
    result = velodrome(*RUN, "--traceback")
    assert result.status == 2
    assert f'quitting_engine.py", line {LINE}, in do' in result.stderr


def in_a_process(code: str, *arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code, *arguments], cwd=folder, capture_output=True, text=True)


def test_a_process_that_ends_without_its_verdict_is_no_success(planted, tmp_path: Path) -> None:
    planted("simulate", "os._exit(0)")
    (tmp_path / "gate.xml").write_text("<testsuites failures='0'/>")  # of an earlier check
    code = (
        "import sys; from velodrome.scenarios.cli import supervised_main; sys.argv[0] = 'velodrome'; supervised_main()"
    )
    done = in_a_process(code, *CHECK, "--junit", "gate.xml", "--markdown", "gate.md", folder=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "velodrome: its process ended itself with status 0 before it was done\n"
    assert 'errors="1"' in (tmp_path / "gate.xml").read_text()
    assert (tmp_path / "gate.md").read_text().startswith("# Drift gate: not finished")


ITSELF = "velodrome: its process ended itself with status {} before it was done\n"
BY = "velodrome: its process was ended by {} before it was done\n"


@pytest.mark.parametrize(
    ("main", "status", "said"),
    [
        ("sys.exit(0)", 0, ""),
        ("sys.exit(2)", 2, ""),
        ("os._exit(0)", 1, ITSELF.format(0)),
        ("os._exit(7)", 7, ITSELF.format(7)),
        ("os.abort()", 134, BY.format("SIGABRT")),
        ("os.kill(os.getpid(), signal.SIGKILL)", 137, BY.format("SIGKILL")),
        # The verdict stands, whatever a handler does afterwards.
        ("atexit.register(os._exit, 0) and sys.exit(1)", 1, ""),
        # A copy of the process that an engine has left behind has no say.
        ("sys.exit(0) if os.fork() == 0 else os.wait() and sys.exit(1)", 1, ""),
        ("sys.exit(0) if os.fork() == 0 else os.wait() and os._exit(0)", 1, ITSELF.format(0)),
        # Signals are passed on.
        ("os.kill(os.getppid(), signal.SIGTERM) or time.sleep(60)", 143, ""),
    ],
)
def test_a_supervised_command_ends_with_the_status_that_it_told(
    main: str, status: int, said: str, tmp_path: Path
) -> None:
    code = "import atexit, os, signal, sys, time; from velodrome.scenarios.commands.supervision import run_supervised\n"
    done = in_a_process(f"{code}run_supervised(lambda: {main})", folder=tmp_path)
    assert (done.returncode, done.stderr) == (status, said)


def test_what_compiled_code_prints_does_not_reach_stdout(planted, tmp_path: Path) -> None:
    planted("progress", "os.write(1, b'printed by C')")
    code = (
        "import sys; from velodrome.scenarios.cli import supervised_main; sys.argv[0] = 'velodrome'; supervised_main()"
    )
    done = in_a_process(code, *RUN, "--json", folder=tmp_path)
    assert (done.returncode, list(json.loads(done.stdout)["runs"][0]["engines"])) == (0, ["reference", NAME])
    assert "printed by C" in done.stderr


def test_a_supervised_interrupt_reaches_the_command_once(tmp_path: Path) -> None:
    code = (
        "import os, signal, sys, time; from velodrome.scenarios.commands.supervision import run_supervised\n"
        "def main():\n"
        "    signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a background job ignores it
        "    try:\n"
        "        os.kill(os.getppid(), signal.SIGINT) or time.sleep(60)\n"
        "    except KeyboardInterrupt:\n"
        "        time.sleep(0.2)\n"
        "        sys.exit(130)\n"
        "run_supervised(main)"
    )
    done = in_a_process(code, folder=tmp_path)
    assert (done.returncode, done.stderr) == (130, "")


@pytest.mark.parametrize("show", ["print('x')", "Console().print('x')"])
def test_a_reader_who_has_gone_does_not_change_the_status(show: str, tmp_path: Path) -> None:
    code = (
        "import sys; from rich.console import Console; from typer import Exit\n"
        "from velodrome.scenarios.commands.options import ending_with\n"
        f"try:\n    with ending_with(1):\n        {show}\n"
        "except Exit as end:\n    sys.exit(end.exit_code)"
    )
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 1


@pytest.mark.parametrize("show", ["ProgressBars().note('a remark')", "print_traceback('an engine', ValueError())"])
def test_a_reader_of_stderr_who_has_gone_takes_no_result_along(show: str, tmp_path: Path) -> None:
    code = (
        "from velodrome.scenarios.commands.options import print_json, print_traceback\n"
        "from velodrome.scenarios.commands.progress import ProgressBars\n"
        f"{show}\n"
        "print_json({'a': 1})"
    )
    done = without_reader_of_stderr(code, tmp_path)
    assert (json.loads(done.stdout)["a"], done.returncode) == (1, 0)


def test_bad_input_has_its_status_if_nobody_reads_stderr(tmp_path: Path) -> None:
    code = "import sys; from velodrome.scenarios.cli import main; sys.argv[1:] = ['show', 'nothing']; main()"
    done = without_reader_of_stderr(code, tmp_path)
    assert (done.stdout, done.returncode) == ("", 2)


def without_reader_of_stderr(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        command = [sys.executable, "-c", code]
        return subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=writer, text=True, check=False)
    finally:
        os.close(writer)


def test_an_exit_from_nowhere_is_no_success(velodrome, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(options, "print_json", lambda _: None)
    monkeypatch.setattr(gate, "check_gate", lambda *_: sys.exit(0))
    result = velodrome("check", "--json")
    assert (result.status, result.stdout) == (1, "")
    assert result.stderr == "velodrome: something called sys.exit(0) before the command was done\n"


def test_bad_input_leaves_no_file_of_verdicts(velodrome, tmp_path: Path) -> None:
    result = velodrome("check", "q2", "--engine", "warp", "--junit", "gate.xml", "--markdown", "gate.md")
    assert (result.status, result.stdout) == (2, "")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "left", [[], [Verdict("reference", CHANGES, None, None, None, "holds", "since the baseline")]], ids=["none", "told"]
)
def test_an_engine_of_which_nothing_was_judged_fails(left: list[Verdict], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("velodrome.scenarios.gate.checks.judge_sample", lambda *_: left)
    verdicts, _ = gate.check_gate(lambda *_: None, ["plane-circle"], ["reference"])
    _, last = verdicts[-1]
    assert (last.engine, last.status) == ("reference", "missing")
    assert last.reason == "did not run: none of its quantities was judged"


def test_a_ctrl_c_that_an_engine_swallows_still_ends_the_run(
    velodrome, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def swallow(trajectory: Trajectory) -> Trajectory:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            return trajectory
        raise AssertionError

    def swallowing(name: str, values: Any, any_release: bool = False) -> tuple[Engine, Settings]:
        engine, settings = configure_engine(name, values, any_release=any_release)
        return Altered(engine, after=swallow), settings

    monkeypatch.setattr(runner, "configure_engine", swallowing)
    result = velodrome("run", "q2", "plane-circle", "--engine", "reference", "--duration", "0.1", "--out", "runs")
    assert result.status == 130
    assert len(list((tmp_path / "runs").iterdir())) == 1
