"""The figure of a sweep: which runs rule its axes, how the others are shown and counted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from velodrome.reports.figures import SweepAxis, SweepRuns, sweep_figure, use_style

X, Y = SweepAxis("motion.rear_rate [rad/s]", given=True), SweepAxis("largest position error [m]")


def runs(y: list[float], whole: list[bool] | None = None, lines: list[str] | None = None) -> SweepRuns:
    n = len(y)
    return SweepRuns(
        np.arange(n, dtype=float), np.array(y), np.array(whole or [True] * n), np.array(lines or ["one"] * n)
    )


def draw(**by_engine: SweepRuns) -> Figure:
    with use_style():
        return sweep_figure("A sweep", X, Y, by_engine)


def said(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def points(figure: Figure, gid: str) -> np.ndarray:
    found: Any = [np.column_stack(line.get_data()) for line in figure.axes[0].lines if line.get_gid() == gid]
    return np.concatenate(found) if found else np.empty((0, 2))


def test_a_ride_that_fell_rules_nothing() -> None:
    calm = draw(exudyn=runs([1.0, 2.0, 3.0, 2.0]))
    fallen = draw(exudyn=runs([1.0, 2.0, 3.0, 2.0, 1e6, -1e6, 2.5], [True] * 4 + [False] * 3))
    assert fallen.axes[0].get_ylim() == calm.axes[0].get_ylim()
    assert fallen.axes[0].get_yscale() == "linear"
    low, high = fallen.axes[0].get_ylim()
    assert points(fallen, "early").tolist() == [[4, high], [5, low], [6, 2.5]]
    assert "open: fell or ended early (3, 2 beyond the frame)" in said(fallen)
    assert len(points(fallen, "whole")) == 4
    # The field is given, and the rides that fell are shown where they fell.
    assert fallen.axes[0].get_xlim()[1] > 6


def test_results_on_the_abscissa_are_ruled_by_whole_rides_too() -> None:
    own = SweepRuns(np.array([1.0, 2.0, 99.0]), np.ones(3), np.array([True, True, False]), np.full(3, "one"))
    with use_style():
        figure = sweep_figure("A sweep", SweepAxis("energy drift"), Y, {"exudyn": own})
    assert figure.axes[0].get_xlim()[1] < 3


def test_if_all_fell_their_values_rule() -> None:
    figure = draw(exudyn=runs([1.0, 5.0], [False, False]))
    low, high = figure.axes[0].get_ylim()
    assert low < 1 < 5 < high


def test_runs_without_a_value_are_crosses_and_engines_without_any_are_named() -> None:
    figure = draw(reference=runs([np.nan] * 3), exudyn=runs([1.0, np.nan, 3.0], [True, False, True]))
    assert points(figure, "absent")[:, 0].tolist() == [1]
    assert "cross: without a value (1)" in said(figure)
    assert "reference: no value" in said(figure)
    # A line does not bridge what is absent.
    (line,) = [line for line in figure.axes[0].lines if line.get_gid() == "line"]
    assert np.array_equal(np.asarray(line.get_ydata()), [1, np.nan, 3], equal_nan=True)


def test_a_figure_of_no_values_is_drawn_with_names_only() -> None:
    assert said(draw(exudyn=runs([np.nan]))) == ["exudyn: no value"]


def test_few_lines_differ_in_style_and_many_do_not() -> None:
    lines = ["alpha = 0.1"] * 2 + ["alpha = 0.2"] * 2
    own = SweepRuns(np.array([0.0, 1, 0, 1]), np.arange(4.0), np.ones(4, bool), np.array(lines))
    figure = draw(exudyn=own)
    drawn = [line for line in figure.axes[0].lines if line.get_gid() == "line"]
    assert [line.get_linestyle() for line in drawn] == ["-", "--"]
    assert {"alpha = 0.1", "alpha = 0.2"} <= set(said(figure))


@pytest.mark.parametrize(
    ("values", "scale"),
    [
        ([1e-3, 2e-3, 4e-3], "log"),  # spaced geometrically
        ([1.0, 2.0, 3.0], "linear"),
        ([1e-9, 2.0, 3.0], "log"),
        ([-1e-9, 2.0, 3.0], "linear"),
        ([0.0, 2.0, 1e6], "linear"),
    ],
)
def test_wide_or_geometric_values_have_a_logarithmic_axis(values: list[float], scale: str) -> None:
    assert draw(exudyn=runs(values)).axes[0].get_yscale() == scale


def test_texts_on_the_abscissa_are_its_ticks() -> None:
    with use_style():
        figure = sweep_figure(
            "A sweep", SweepAxis("surface.kind", True, ("cone", "sphere")), Y, {"exudyn": runs([1, 2])}
        )
    assert [tick.get_text() for tick in figure.axes[0].get_xticklabels()] == ["cone", "sphere"]


def test_names_with_dollars_are_no_formulas() -> None:
    """A bicycle's file may be called so, and a formula that cannot be parsed would end the drawing."""
    names = ("a$_$b.toml", r"$\frac{$")
    own = runs([1.0, 2.0, 2.0, 3.0], lines=["bicycle = $_$"] * 2 + ["bicycle = $^$"] * 2)
    own = SweepRuns(np.array([0.0, 1, 0, 1]), own.y, own.whole, own.lines)
    with use_style():
        figure = sweep_figure("A $_$ sweep", SweepAxis("bicycle", True, names), Y, {"own$^$": own}, "equal $_$")
        figure.canvas.draw()
    assert [tick.get_text().replace(r"\$", "$") for tick in figure.axes[0].get_xticklabels()] == [*names]


@pytest.mark.parametrize("values", [[1e300, 1e3, 1e-9], [1.7e308, -1.7e308, 0.0], [1.7e308, 5e-324, 1.0]])
def test_rides_that_grow_to_the_largest_numbers_are_drawn(values: list[float]) -> None:
    figure = draw(exudyn=runs(values, [False] * 3))
    figure.canvas.draw()
    assert np.isfinite(figure.axes[0].get_ylim()).all()
    assert len(points(figure, "early")) == 3
