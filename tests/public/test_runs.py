"""Runs from Python, as a user would make and read them."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import velodrome
from tests.installed import parametrise_engines
from tests.sealing import change_document
from velodrome.engines.engine import SHAPES
from velodrome.scenarios.run import runner

mpl.use("Agg")
NATIVE, EXACT = "mujoco-native", "mujoco-multipliers"
SHORT = {"scenario": "q2-plus", "engines": [NATIVE, EXACT], "duration": 0.2}


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> velodrome.Run:
    """A run that has left a folder."""
    return velodrome.run(**SHORT, out=tmp_path_factory.mktemp("runs"))


def assert_same_rides(a: velodrome.Run, b: velodrome.Run) -> None:
    """To the bit; the time that an engine took is its own."""
    assert list(a.trajectories) == list(b.trajectories)
    for name, one in a.trajectories.items():
        for field in SHAPES:
            left, right = getattr(one, field), getattr(b.trajectories[name], field)
            assert (left is None) == (right is None)
            assert left is None or left.tobytes() == right.tobytes(), (name, field)
        assert one.settings == b.trajectories[name].settings
    for field in ("q", "qd", "times"):
        assert getattr(a.start, field).tobytes() == getattr(b.start, field).tobytes()
    assert (a.start.bicycle, a.start.surface) == (b.start.bicycle, b.start.surface)
    for field in ("name", "title", "growth_rate", "family", "verdicts", "failures", "left_out", "complete"):
        assert getattr(a, field) == getattr(b, field)
    for name in a.metrics:
        for quantity in set(a.metrics[name]) - {"cpu_time", "real_time_factor"}:
            assert a.metrics[name][quantity] == b.metrics[name][quantity]


def test_two_engines_a_table_and_a_plot() -> None:
    """The ten lines that the guide begins with."""
    run = velodrome.run("q2-plus", engines=["mujoco-native", "mujoco-multipliers"], duration=0.5)
    table = run.metrics.to_pandas()
    print(table[["position_error_max", "energy_drift"]])
    reference = run.trajectories["reference"].to_pandas()
    ride = run.trajectories["mujoco-native"].to_pandas()
    axes = (ride["lean"] - reference["lean"]).plot(ylabel="lean error [rad]")
    assert axes.get_xlabel() == "time"
    assert list(table.index) == ["reference", "mujoco-multipliers", "mujoco-native"]
    errors = run.metrics.column("position_error_max")
    assert errors["mujoco-multipliers"] < errors["mujoco-native"]
    assert np.array_equal(table["position_error_max"], [np.nan, *list(errors.values())[1:]], equal_nan=True)
    (line,) = axes.get_lines()
    assert len(line.get_xdata()) == 51
    assert 0 < np.abs(line.get_ydata()).max() < 1


def test_a_folder_gives_the_run_back(stored: velodrome.Run) -> None:
    assert stored.folder is not None
    again = velodrome.load(stored.folder)
    assert_same_rides(stored, again)
    assert again.metrics == stored.metrics  # CPU times too: it is the same run
    assert again.folder == stored.folder
    assert repr(again) == repr(stored)
    assert velodrome.load(str(stored.folder)).metrics == stored.metrics


def test_a_run_without_a_folder_gives_the_same_and_leaves_nothing(
    stored: velodrome.Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run = velodrome.run(**SHORT)
    assert run.folder is None
    assert not list(tmp_path.iterdir())
    assert_same_rides(run, stored)


def test_the_command_gives_the_same_run(stored: velodrome.Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from velodrome.scenarios import cli

    arguments = ["run", "q2-plus", "--engine", NATIVE, "--engine", EXACT, "--duration", "0.2", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["velodrome", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 0
    (folder,) = tmp_path.iterdir()
    assert_same_rides(velodrome.load(folder), stored)


def test_a_trajectory_as_arrow_is_its_parquet_file(stored: velodrome.Run) -> None:
    assert stored.folder is not None
    for name, ride in stored.trajectories.items():
        written = pq.read_table(stored.folder / f"{name}.parquet")
        table = ride.to_arrow()
        assert isinstance(table, pa.Table)
        assert table.equals(written)
        assert table.schema.field("lean").metadata == {b"unit": b"rad"}
        assert json.loads(table.schema.metadata[b"velodrome"])["engine"] == name


def test_a_trajectory_as_a_frame_has_the_time_as_index(stored: velodrome.Run) -> None:
    ride = stored.trajectories[NATIVE]
    frame = ride.to_pandas()
    assert frame.index.name == "time"
    assert np.array_equal(frame.index, ride.time)
    assert np.array_equal(frame["steer"], ride.q[:, 6])
    assert np.array_equal(frame["rear_angle_rate"], ride.qd[:, 7])
    assert list(frame.columns) == [name for name in ride.to_arrow().column_names if name != "time"]


def test_the_table_of_metrics_has_every_quantity(stored: velodrome.Run) -> None:
    table = stored.metrics
    assert len(table) == 3
    assert set(table[NATIVE]) == set(table["reference"])
    frame = table.to_pandas()
    assert tuple(frame.columns) == table.columns
    assert {"position_error_max", "position_error_end", "cpu_time", "steps"} <= set(table.columns)
    assert "position_error" not in table.columns
    assert str(frame["steps"].dtype) == "int64"
    assert list(frame["fell_at"].isna()) == [True] * 3
    assert dict(frame["energy_drift"]) == table.column("energy_drift")
    assert table.column("energy_drift")[NATIVE] == table[NATIVE]["energy_drift"]
    with pytest.raises(KeyError, match="'warp' is no column; there are position_error_max"):
        table.column("warp")
    with pytest.raises(TypeError):
        table[NATIVE]["steps"] = 1  # type: ignore[index]  # pyright: ignore


def test_the_table_shows_every_engine_and_escapes_what_it_is_told(stored: velodrome.Run) -> None:
    text, page = repr(stored), stored._repr_html_()
    for name in stored.metrics:
        assert name in text
        assert f"<th>{name}</th>" in page
    assert "q2-plus: Q2, disturbed to the right, 0.2 s" in text
    row = dict(stored.metrics[NATIVE]) | {"ended": "<script>"}
    table = velodrome.MetricsTable({"<b>": row}, 0.2)
    assert "ended early: <b> (<script>)" in repr(table)
    assert "<b>" not in table.to_html()
    assert "ended early: &lt;b&gt; (&lt;script&gt;)" in table.to_html()


def test_settings_and_changes_reach_the_engines() -> None:
    changes = {"perturbation.lean_rate": np.float64(0.2), f"engines.{NATIVE}.step": 0.005}
    run = velodrome.run("q2", engines=NATIVE, duration=0.1, changes=changes)
    assert run.trajectories[NATIVE].settings["step"] == 0.005
    assert run.start.qd[4] == pytest.approx(0.2)
    own = velodrome.load_engine(NATIVE).settings.model_validate({"step": 0.001})
    for settings in ({"step": 0.001}, {"step": np.float64(0.001)}, own):
        run = velodrome.run("q2", engines=[NATIVE], duration=0.1, changes=changes, settings={NATIVE: settings})
        assert run.trajectories[NATIVE].settings["step"] == 0.001
        assert run.trajectories[NATIVE].steps == 100


def test_no_engine_is_the_reference_alone() -> None:
    assert list(velodrome.run("q2", engines=[], duration=0.1).trajectories) == ["reference"]


def test_a_file_is_run_by_its_path(tmp_path: Path, stored: velodrome.Run) -> None:
    assert stored.folder is not None
    path = tmp_path / "own.toml"
    path.write_text((stored.folder / "scenario.toml").read_text())
    run = velodrome.run(path, engines=[NATIVE])
    assert (run.name, len(run.start.times)) == ("own", 21)


def test_progress_is_told_and_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    seen: list[tuple[str, float, float]] = []
    velodrome.run("q2", engines=[NATIVE], duration=0.1, progress=lambda *told: seen.append(told))
    assert {name for name, _, _ in seen} == {"reference", NATIVE}
    assert all(0 <= time <= end == 0.1 for _, time, end in seen)
    assert capfd.readouterr() == ("", "")


class Cancelled(Exception):
    """Raised by a user's callback."""


@pytest.mark.parametrize("name", parametrise_engines())
def test_an_exception_of_the_callback_comes_out_unchanged(name: str, tmp_path: Path) -> None:
    cause = ValueError("the user's own cause")
    error = Cancelled("stop please")
    seen: list[str] = []

    def cancel(engine: str, _time: float, _duration: float) -> None:
        seen.append(engine)
        if engine == name:
            raise error from cause

    scenario = "plane-circle" if name == "exudyn-builtin" else "q2"
    with pytest.raises(Cancelled) as caught:
        velodrome.run(scenario, engines=[name], duration=2.0, progress=cancel, out=tmp_path)
    assert caught.value is error
    assert error.__cause__ is cause
    assert seen[-1] == name
    (folder,) = tmp_path.iterdir()
    assert (folder / "reference.parquet").exists() == (name != "reference")
    assert not json.loads((folder / "manifest.json").read_text())["complete"]


def test_a_callback_of_the_wrong_signature_is_the_callers_error() -> None:
    wrong: Any = lambda: None  # noqa: E731
    with pytest.raises(TypeError, match="takes 0 positional arguments"):
        velodrome.run("q2", engines=[], duration=0.1, progress=wrong)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"scenario": "q9"}, "no scenario 'q9' in the library (there are edge"),
        ({"engines": ["warp"]}, "engine 'warp' is not installed (there are reference"),
        ({"duration": -1}, "simulation.duration"),
        ({"changes": {"motion.warp": 1}}, "unknown key 'warp'"),
        ({"settings": {NATIVE: {"stepp": 1}}}, f"engines.{NATIVE}: unknown key 'stepp'"),
        ({"settings": {NATIVE: 0.001}}, f"settings['{NATIVE}'] is 0.001 (float); it must be a mapping"),
        ({"settings": {"warp": {}}}, "engine 'warp' is not installed"),
    ],
)
def test_bad_input_is_one_line(given: dict[str, Any], words: str) -> None:
    with pytest.raises(velodrome.ScenarioError) as told:
        velodrome.run(**{"scenario": "q2", "engines": [NATIVE], "duration": 0.1, **given})
    assert words in str(told.value)
    assert "\n" not in str(told.value)


def test_an_engine_that_breaks_is_a_failure_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    ride = runner.ride_engine

    def broken(engine: Any, *arguments: Any) -> Any:
        if engine.name == NATIVE:
            raise velodrome.EngineError("it did not want to")
        return ride(engine, *arguments)

    monkeypatch.setattr(runner, "ride_engine", broken)
    run = velodrome.run("q2", engines=[NATIVE], duration=0.1)
    assert list(run.trajectories) == ["reference"]
    assert run.failures == {NATIVE: "it did not want to"}
    assert f"{NATIVE} did not run: it did not want to" in repr(run)


def test_an_interrupt_is_the_users_and_keeps_what_was_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ride = runner.ride_engine

    def pressed(engine: Any, *arguments: Any) -> Any:
        if engine.name == NATIVE:
            raise KeyboardInterrupt
        return ride(engine, *arguments)

    monkeypatch.setattr(runner, "ride_engine", pressed)
    with pytest.raises(KeyboardInterrupt):
        velodrome.run("q2", engines=[NATIVE], duration=0.1, out=tmp_path)
    (folder,) = tmp_path.iterdir()
    run = velodrome.load(folder)
    assert list(run.trajectories) == ["reference"]
    assert not run.complete


@pytest.mark.parametrize("damage", ["manifest.json", "metrics.json", "scenario.toml", f"{NATIVE}.parquet"])
def test_a_folder_that_lacks_a_file_is_refused(damage: str, tmp_path: Path) -> None:
    run = velodrome.run("q2", engines=[NATIVE], duration=0.1, out=tmp_path)
    assert run.folder is not None
    (run.folder / damage).unlink()
    with pytest.raises(velodrome.ScenarioError, match=damage):
        velodrome.load(run.folder)


@pytest.mark.parametrize("part", ["start", "engines", "left_out", "verdicts"])
def test_a_manifest_that_lacks_a_part_is_refused(part: str, tmp_path: Path) -> None:
    run = velodrome.run("q2", engines=[NATIVE], duration=0.1, out=tmp_path)
    assert run.folder is not None
    path = run.folder / "manifest.json"
    change_document(path, lambda manifest: manifest.pop(part))
    with pytest.raises(velodrome.ScenarioError, match=f"not the files of one run: KeyError: '{part}'"):
        velodrome.load(run.folder)


def test_without_pandas_one_line_says_what_to_install(stored: velodrome.Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    for convert in (stored.metrics.to_pandas, stored.trajectories[NATIVE].to_pandas):
        with pytest.raises(ImportError, match="pip install pandas"):
            convert()
    assert stored.trajectories[NATIVE].to_arrow().num_rows == 21


def test_show_opens_the_recording_and_removes_what_it_wrote(
    stored: velodrome.Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    from velodrome.scenarios.session import result

    opened: list[tuple[Path, bytes]] = []
    monkeypatch.setattr(result, "open_native", lambda folder: opened.append((folder, recording(folder))))

    def recording(folder: Path) -> bytes:
        return (folder / "comparison.rrd").read_bytes()

    assert stored.folder is not None
    stored.show()
    assert opened == [(stored.folder, recording(stored.folder))]
    velodrome.run("q2", engines=[NATIVE], duration=0.1).show()
    folder, content = opened[1]
    assert content.startswith(b"RRF2")
    assert not folder.exists()


def test_a_run_of_nothing_has_nothing_to_show(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> Any:
        raise velodrome.EngineError("no")

    monkeypatch.setattr(runner, "ride_engine", broken)
    run = velodrome.run("q2", engines=[], duration=0.1)
    assert not run.metrics
    with pytest.raises(velodrome.ScenarioError, match="no trajectory"):
        run.show()


def test_what_a_run_holds_is_shown_in_a_few_lines_and_compared_by_identity(stored: velodrome.Run) -> None:
    assert stored.folder is not None
    again = velodrome.load(stored.folder)
    ride = stored.trajectories[NATIVE]
    for one, other in ((ride, again.trajectories[NATIVE]), (stored.start, again.start)):
        assert one == one
        assert one != other
        assert len({one, other}) == 2
        assert repr(one) == repr(other)
        lines = repr(one).splitlines()
        assert len(lines) <= 10
        assert all(len(line) < 200 for line in lines)
    assert repr(ride).startswith(f"Trajectory of {NATIVE} {ride.version}: 21 samples, 0 to 0.2 s\n")
    assert repr(stored.start).startswith("Problem: 21 output times from 0 to 0.2 s\n")
    assert len(repr(stored).splitlines()) <= 10
