"""Figures of a sweep's data set, from `velodrome sweep --plot`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from PIL import Image
from sweeping import UPRIGHT, here, planned, swept, written

from velodrome.scenarios.commands import run_sweep as command
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.files import FigureOutput
from velodrome.scenarios.sweep import SweepPlot, check_plots, parse_plots, write_sweep_figures
from velodrome.scenarios.sweep import figure as figure_module
from velodrome.scenarios.sweep.map_figure import MapPlot, select_map_runs
from velodrome.scenarios.sweep.store import MANIFEST

# The third start falls within the time; the step of the fourth is refused where it is MuJoCo's.
RIDES = """
scenario = "iftomm-1"
engines = ["reference", "mujoco-native"]
[grid]
simulation.duration = [1.5]
simulation.output_rate = [20.0]
perturbation.lean_rate = [0.0, 0.1, 9.0]
engines.mujoco-native.step = [0.005, 0.003]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("sweep")
    assert swept(planned(place, RIDES), place / "out").stopped is None
    return place / "out"


def read_tables(folder: Path, plot: SweepPlot | MapPlot) -> dict[str, pa.Table]:
    return {name: figure_module._read_table(folder, name, plot) for name in ("reference", "mujoco-native")}


def test_values_are_those_of_the_data_set(folder: Path) -> None:
    plot = SweepPlot("position_error_max", "perturbation.lean_rate")
    tables = read_tables(folder, plot)
    x_axis, y_axis, runs, joined = figure_module._select_runs(tables, plot)
    assert (x_axis.title, x_axis.given) == ("perturbation.lean_rate [rad/s]", True)
    assert (y_axis.title, y_axis.given) == ("largest position error [m]", False)
    assert joined == "a line: equal engines.mujoco-native.step"
    assert np.isnan(runs["reference"].y).all()  # it has no error
    own = runs["mujoco-native"]
    rows = tables["mujoco-native"].to_pylist()
    assert [row["index"] for row in rows] == sorted(row["index"] for row in rows)
    assert own.x.tolist() == [row["perturbation.lean_rate"] for row in rows]
    assert np.array_equal(own.y, np.array([row["position_error_max"] for row in rows], float), equal_nan=True)
    assert own.whole.tolist() == [row["status"] == "done" for row in rows]
    assert {row["status"] for row in rows} == {"done", "fell", "refused"}
    assert sorted(set(own.lines)) == [f"engines.mujoco-native.step = {step} s" for step in ("0.003", "0.005")]


def test_a_setting_of_each_engines_own_is_one_field(folder: Path) -> None:
    plot = SweepPlot("cpu_time", "engines.*.step")
    x_axis, y_axis, runs, joined = figure_module._select_runs(read_tables(folder, plot), plot)
    assert (x_axis.title, y_axis.title) == ("step [s]", "cpu time [s]")
    assert np.isnan(runs["reference"].x).all()
    assert sorted(set(runs["mujoco-native"].x)) == [0.003, 0.005]
    assert joined == "a line: equal perturbation.lean_rate"


def test_a_finished_sweep_is_drawn_without_running(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plots = ["position_error_max:perturbation.lean_rate", "energy_drift:engines.*.step"]
    command.draw_sweep_command(folder, [], plots, FigureOutput(("png", "pdf"), 1), as_json=True)
    document = json.loads(capsys.readouterr().out)
    stems = ("position_error_max-over-perturbation.lean_rate", "energy_drift-over-engines.any.step")
    expected = [folder / "figures" / f"{stem}.{ending}" for stem in stems for ending in ("png", "pdf")]
    assert document["figures"] == [str(path) for path in expected]
    with Image.open(expected[0]) as image:
        assert image.width == int(300 * 89 / 25.4)
    assert expected[3].read_bytes().startswith(b"%PDF-")


def test_plots_are_judged_before_a_sweep_as_after_it(folder: Path, tmp_path: Path) -> None:
    plan = planned(tmp_path, RIDES)
    check_plots(parse_plots(["max_slip:status"]), plan)
    for name in ("ended", "status"):
        plots = parse_plots([f"{name}:perturbation.lean_rate"])
        with pytest.raises(ScenarioError, match="has no numbers; only the X of Y:X may be text"):
            check_plots(plots, plan)
    with pytest.raises(ScenarioError, match="the sweep's rows have no zzz") as before:
        check_plots(parse_plots(["max_slip:zzz"]), plan)
    with pytest.raises(ScenarioError) as after:
        write_sweep_figures(folder, parse_plots(["max_slip:zzz"]), FigureOutput())
    assert str(before.value) == str(after.value)


def test_a_sweep_that_runs_is_drawn_at_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "_choose_work", lambda *_: here)
    path = written(tmp_path, UPRIGHT + "perturbation.lean_rate = [0.0, 0.1]\n")
    with pytest.raises(ScenarioError, match=r"no perturbation\.lean .did you mean 'perturbation\.lean_rate'"):
        command.run_sweep_command(path, None, None, None, False, True, plots=["max_slip:perturbation.lean"])
    assert not (tmp_path / "sweeps").exists()  # found before anything ran
    assert (
        command.run_sweep_command(path, None, None, None, False, True, plots=["max_slip:perturbation.lean_rate"]) == 0
    )
    (drawn,) = json.loads(capsys.readouterr().out)["figures"]
    assert drawn == "sweeps/small/figures/max_slip-over-perturbation.lean_rate.png"
    assert Path(drawn).stat().st_size > 10_000


def test_a_map_of_a_finished_sweep_has_a_figure_for_each_engine(folder: Path) -> None:
    (plot,) = parse_plots(["fell:perturbation.lean_rate,simulation.duration"])
    written = write_sweep_figures(folder, [plot], FigureOutput())
    stem = "fell-over-perturbation.lean_rate-and-simulation.duration"
    assert [path.name for path in written] == [f"{stem}-reference.png", f"{stem}-mujoco-native.png"]
    tables = read_tables(folder, plot)
    assert isinstance(plot, MapPlot)
    runs = select_map_runs(tables["mujoco-native"], plot)
    assert runs is not None
    # Three rides at each step: those at the second are refused, so that they are in no share.
    by_start = {rate: sorted(runs.value[runs.x == rate].tolist(), key=str) for rate in (0.0, 0.1, 9.0)}
    fell = {row["perturbation.lean_rate"] for row in tables["mujoco-native"].to_pylist() if row["status"] == "fell"}
    for rate, values in by_start.items():
        assert values[0] == float(rate in fell)
        assert np.isnan(values[1])
    (median,) = parse_plots(["energy_drift:perturbation.lean_rate,simulation.duration"])
    assert len(write_sweep_figures(folder, [median], FigureOutput())) == 2


@pytest.mark.parametrize("text", ["max_slip:status,index", "warnings:index,perturbation.lean_rate"])
def test_a_map_needs_numbers(folder: Path, tmp_path: Path, text: str) -> None:
    with pytest.raises(ScenarioError, match="has no numbers"):
        check_plots(parse_plots([text]), planned(tmp_path, RIDES))
    with pytest.raises(ScenarioError, match="has no numbers"):
        write_sweep_figures(folder, parse_plots([text]), FigureOutput())


@pytest.mark.parametrize("text", ["position_error_max", "a:b:c", ":b", "a:", "a:b,", "a:b,c,d"])
def test_a_plot_is_two_names(text: str) -> None:
    with pytest.raises(ScenarioError, match="must be Y:X"):
        parse_plots([text])


@pytest.mark.parametrize(
    ("plot", "said"),
    [
        (SweepPlot("position_eror_max", "index"), "no position_eror_max .did you mean 'position_error_max'"),
        (SweepPlot("max_slip", "engines.*.stepp"), r"no engines\.\*\.stepp"),
        (SweepPlot("warnings", "perturbation.lean_rate"), "no row of the sweep has a value of warnings"),
        (SweepPlot("status", "perturbation.lean_rate"), "status has no numbers"),
    ],
)
def test_columns_that_cannot_be_drawn_are_refused(folder: Path, plot: SweepPlot, said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        write_sweep_figures(folder, [plot], FigureOutput())


def test_an_unfinished_sweep_and_another_folder_are_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"is not the folder of a sweep: it has no sweep\.json"):
        write_sweep_figures(tmp_path, [SweepPlot("max_slip", "index")], FigureOutput())
    manifest = json.loads((folder / MANIFEST).read_text())
    (tmp_path / MANIFEST).write_text(json.dumps(manifest | {"complete": False}))
    with pytest.raises(ScenarioError, match="the sweep is not finished"):
        write_sweep_figures(tmp_path, [SweepPlot("max_slip", "index")], FigureOutput())
    (tmp_path / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(ScenarioError, match="its data set cannot be read"):
        write_sweep_figures(tmp_path, [SweepPlot("max_slip", "index")], FigureOutput())


def test_what_belongs_to_a_file_is_refused_for_a_folder(folder: Path) -> None:
    with pytest.raises(ScenarioError, match="--workers: it belongs to a sweep file"):
        command.draw_sweep_command(folder, ["--workers"], ["max_slip:index"], FigureOutput(), as_json=False)
    with pytest.raises(ScenarioError, match=r"is a folder; name a sweep file, or the figures to draw by --plot Y:X"):
        command.draw_sweep_command(folder, [], [], FigureOutput(), as_json=False)
