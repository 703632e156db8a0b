"""What a sweep says: JSON, a table, its progress; how it ends."""

from __future__ import annotations

import io
import json
from collections.abc import Generator
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from sweeping import UPRIGHT, here, planned, written

from velodrome.scenarios.commands import progress
from velodrome.scenarios.commands import run_sweep as command
from velodrome.scenarios.commands.present_sweep import SweepCounter
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.sweep.page import group_medians
from velodrome.scenarios.sweep.pool import Done

THREE = UPRIGHT + "perturbation.lean_rate = [0.0, 0.1, 0.2]\n"


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "_choose_work", lambda *_: here)
    return tmp_path


def test_the_summary_is_the_only_thing_on_stdout(in_process: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(in_process, THREE)
    assert command.run_sweep_command(path, None, None, None, resume=False, as_json=True) == 0
    said = capsys.readouterr()
    document = json.loads(said.out)
    assert document["folder"] == "sweeps/small"
    assert (document["tasks"], document["missing"], document["complete"]) == (3, 0, True)
    assert document["engines"]["reference"]["rows"] == {"done": 3}
    assert "data set: sweeps/small/results" in said.err
    assert "page:     sweeps/small/sweep.html" in said.err
    page = (in_process / "sweeps" / "small" / "sweep.html").read_text(encoding="utf-8")
    assert "No parameter has several numbers" in page  # the reference alone has no errors


def test_rows_that_broke_are_named_with_their_reason(in_process: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(in_process, 'scenario = "q2"\nengines = ["exudyn-builtin"]\ngrid.simulation.duration = [0.1]')
    assert command.run_sweep_command(path, None, None, in_process / "out", resume=False, as_json=False) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "exudyn-builtin failed: UnsuitableProblem: it rolls on the level plane only" in said


def test_workers_belong_to_this_machine(in_process: Path) -> None:
    with pytest.raises(ScenarioError, match="--workers goes without --scheduler"):
        command.run_sweep_command(written(in_process, THREE), "tcp://127.0.0.1:1", 2, None, resume=False, as_json=False)


@pytest.mark.parametrize(
    ("retry", "resume", "said"),
    [
        (["timeout"], False, "--retry: it belongs to --resume"),
        (["timeout", "late"], True, r"--retry late: no row has such a status \(there are done, fell, ended, no-motion"),
    ],
)
def test_what_is_to_be_tried_again_must_be_a_status(
    in_process: Path, retry: list[str], resume: bool, said: str
) -> None:
    with pytest.raises(ScenarioError, match=said):
        command.run_sweep_command(
            written(in_process, THREE), None, None, None, resume=resume, as_json=False, retry=retry
        )
    assert not (in_process / "sweeps").exists()


def test_a_stopped_retry_says_how_to_go_on(
    in_process: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> Generator[Done]:
        raise KeyboardInterrupt
        yield

    path = written(in_process, THREE)
    assert command.run_sweep_command(path, None, None, None, resume=False, as_json=False) == 0
    monkeypatch.setattr(command, "_choose_work", lambda *_: interrupted)
    assert command.run_sweep_command(path, None, None, None, resume=True, as_json=False, retry=["done", "fell"]) == 130
    said = " ".join(capsys.readouterr().out.split())
    assert "--resume --retry done --retry fell" in said
    assert "3 of 3 runs are missing, finished runs are kept" in said


def test_a_figure_without_values_is_said_after_the_summary(
    in_process: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(in_process, THREE)
    with pytest.raises(ScenarioError, match="no row of the sweep has a value of position_error_max"):
        command.run_sweep_command(
            path, None, None, None, resume=False, as_json=False, plots=["position_error_max:perturbation.lean_rate"]
        )
    assert "data set: " in capsys.readouterr().out


def test_progress_counts_and_says_what_failed_and_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tasks = planned(tmp_path, THREE).tasks
    screen = Console(file=io.StringIO(), force_terminal=True, color_system=None, width=100)
    monkeypatch.setattr(progress, "make_console", lambda stderr: screen)
    monkeypatch.delenv(progress.SILENCE)
    with progress.ProgressBars() as bars:
        counter = SweepCounter(bars, "small", tasks)
        counter.recall({"done": 2})
        counter.watch(Done(1, {"status": "failed", "reason": "[bold]it diverged"}, {}))
    assert isinstance(screen.file, io.StringIO)
    text = screen.file.getvalue()
    assert "small" in text
    assert "3 of 3 rows" in text
    assert "done 2  failed 1  " in text
    assert "rows/s" in text
    assert f"{tasks[1].key} reference failed: [bold]it diverged" in text


def test_a_sweeps_page_draws_the_errors_over_its_parameters(in_process: Path) -> None:
    path = written(in_process, THREE.replace("[grid]", 'engines = ["mujoco-native"]\n[grid]', 1))
    assert command.run_sweep_command(path, None, None, in_process / "out", resume=False, as_json=False) == 0
    page = (in_process / "out" / "sweep.html").read_text(encoding="utf-8")
    assert "Median position error over perturbation.lean_rate, one line per engine" in page
    assert "No parameter has several numbers" not in page


def test_many_values_are_taken_together() -> None:
    values, errors = np.array([2.0, 0.0, 1.0, 0.0]), np.array([5.0, 1.0, 4.0, 3.0])
    np.testing.assert_array_equal(group_medians(values, errors), [[0, 1, 2], [2, 4, 5]])
    drawn = np.random.default_rng(0).permutation(1000) / 1000
    found, medians = group_medians(drawn, drawn**2)
    assert len(found) == 40
    assert np.all(np.diff(found) > 0)
    np.testing.assert_allclose(medians, found**2, atol=1e-3)  # between neighbours a thousandth apart
