"""The recording of a run: at the rate asked for, or none, and made later from the stored rides."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

import velodrome
from velodrome.engines.storage import read_trajectory
from velodrome.scenarios.cli import main
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.view import viewing


def call(*arguments: str) -> int:
    """Exit status of the command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["velodrome", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
    assert isinstance(ended.value.code, int)
    return ended.value.code


RIDE = ["run", "q2", "--engine", "reference", "--duration", "0.5"]


@pytest.fixture
def ride(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[Path, str]]:
    """Runs the command with further options: the run folder, and what is said on stderr."""

    def run(*options: str) -> tuple[Path, str]:
        assert call(*RIDE, "--out", str(tmp_path / "runs"), "--json", *options) == 0
        said = capsys.readouterr()
        return Path(json.loads(said.out)["runs"][0]["folder"]), said.err

    return run


def count_poses(recording: Path) -> int:
    chunks = (
        chunk.to_record_batch() for chunk in RrdReader(str(recording)).stream() if "rear_frame" in chunk.entity_path
    )
    return sum(batch.num_rows for batch in chunks if "Transform3D:translation" in batch.schema.names)


def test_a_recordings_rate_thins_the_recording_alone_and_is_said(ride: Callable[..., tuple[Path, str]]) -> None:
    folder, said = ride("--record-rate", "10")
    sentence = "The recording holds every 10th sample, 10 of 100 a second"
    assert sentence in " ".join(said.split())
    assert json.loads((folder / "manifest.json").read_text())["recording"]["leaves_out"].startswith(sentence)
    assert count_poses(folder / "comparison.rrd") == 6
    assert len(read_trajectory(folder / "reference.parquet").time) == 51


def test_a_short_ride_is_recorded_whole(ride: Callable[..., tuple[Path, str]]) -> None:
    folder, said = ride()
    assert "recording" not in said.replace("recording:", "")
    assert json.loads((folder / "manifest.json").read_text())["recording"] == {"leaves_out": None}
    assert count_poses(folder / "comparison.rrd") == 51


def test_a_run_without_a_recording_gets_it_when_it_is_viewed(
    ride: Callable[..., tuple[Path, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, _ = ride("--no-recording")
    recording = folder / "comparison.rrd"
    assert not recording.exists()
    assert json.loads((folder / "manifest.json").read_text())["recording"] is None
    assert "made without a recording" in (folder / "report.html").read_text()
    opened: list[Path] = []
    monkeypatch.setattr(viewing, "open_recording", lambda path, without: opened.append(path))
    velodrome.load(folder).show()
    assert opened == [recording]
    assert count_poses(recording) == 51


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--record-rate", "0"], "--record-rate is 0; it must be a positive number of samples a second"),
        (["--record-rate", "nan"], "--record-rate is nan; it must be"),
        (["--record-rate", "inf"], "--record-rate is inf; it must be"),
        (["--record-rate", "5", "--no-recording"], "--record-rate and --no-recording exclude one another"),
    ],
)
def test_a_rate_that_is_none_is_refused(options: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(*RIDE, *options) == 2
    assert words in capsys.readouterr().err


def test_two_runs_are_viewed_in_one_recording(
    ride: Callable[..., tuple[Path, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = [str(ride("--no-recording")[0]) for _ in range(2)]
    opened: list[set[str]] = []

    def look(path: Path, without: str) -> None:
        assert without == f"run: velodrome view --web {' '.join(folders)}"
        entities = {chunk.entity_path for chunk in RrdReader(str(path)).stream()}
        opened.append({entity.split("/")[2] for entity in entities if entity.startswith("/world/")})

    monkeypatch.setattr("velodrome.scenarios.view.open_recording", look)
    assert call("view", *folders) == 0
    assert opened == [{"reference", "ground"}]  # the same to the bit: once


def test_runs_that_cannot_be_viewed_together_are_refused(
    ride: Callable[..., tuple[Path, str]], capsys: pytest.CaptureFixture[str]
) -> None:
    one, other = (str(ride("--no-recording", "--set", f"surface.alpha={alpha}")[0]) for alpha in (0.005, 0.0051))
    assert call("view", one, other) == 2
    assert "different scenarios: surface.alpha 0.005 against 0.0051" in capsys.readouterr().err


def test_an_unfinished_run_has_no_recording_to_make(ride: Callable[..., tuple[Path, str]]) -> None:
    folder, _ = ride("--no-recording")
    (folder / "metrics.json").unlink()
    with pytest.raises(ScenarioError, match=r"not the folder of a finished run: it has no metrics\.json"):
        viewing.find_recording(folder)
