"""The map of a sweep: cells of two fields, the median or share in each, and the line of stability."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from velodrome.reports.figures import (
    CellGrid,
    MapRuns,
    SweepAxis,
    SweepMap,
    average_cells,
    make_cells,
    sweep_map_figure,
    use_style,
)

X, Y = SweepAxis("surface.alpha [1/m]", given=True), SweepAxis("motion.rear_rate [rad/s]", given=True)


def spread(n: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(0.0, 0.01, n), rng.uniform(14.0, 22.0, n)


def draw(runs: MapRuns, share: bool = True) -> Figure:
    with use_style():
        return sweep_map_figure("A sweep", SweepMap(X, Y, "share of runs that fell", share), "reference", runs)


def said(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_each_cell_has_about_a_hundred_runs() -> None:
    x, y = spread(40_000)
    cells = make_cells(x, y)
    assert cells.shape == (20, 20)
    count = np.bincount(cells.locate(x, y), minlength=400)
    # Poisson: five standard deviations of 100 runs are 50.
    assert 50 < count.min() <= count.max() < 150
    assert count.sum() == 40_000


def test_a_field_with_few_values_has_a_cell_for_each() -> None:
    x = np.repeat([1.0, 2.0, 4.0], 3000)
    _, y = spread(9000)
    cells = make_cells(x, y)
    assert cells.x_edges.tolist() == [0.5, 1.5, 3.0, 5.0]
    assert cells.shape == (30, 3)
    assert make_cells(np.ones(4), y[:4]).x_edges.tolist() == [0.5, 1.5]


def test_values_of_cells_equal_those_of_their_runs() -> None:
    x, y = spread(500, seed=2)
    value = np.where(np.arange(500) % 7 == 0, np.nan, x * y)
    stable = np.where(np.arange(500) % 3 == 0, np.nan, (y > 18).astype(float))
    cells = CellGrid(np.linspace(0, 0.01, 6), np.linspace(14, 22, 5))
    runs = MapRuns(x, y, value, stable)
    median, count, share = average_cells(cells, runs, share=False)
    mean, _, _ = average_cells(cells, runs, share=True)
    place = cells.locate(x, y).reshape(-1)
    for k in range(20):
        own = value[(place == k) & np.isfinite(value)]
        judged = stable[(place == k) & np.isfinite(stable)]
        assert count.flat[k] == len(own)
        assert median.flat[k] == pytest.approx(np.median(own), rel=1e-15)
        assert mean.flat[k] == pytest.approx(np.mean(own), rel=1e-13)
        assert share.flat[k] == pytest.approx(np.mean(judged), rel=1e-15)


def test_a_cell_without_a_value_is_empty() -> None:
    x, y = np.array([0.5, 1.5]), np.array([0.5, 1.5])
    cells = CellGrid(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 2.0]))
    value, count, _ = average_cells(cells, MapRuns(x, y, np.array([3.0, np.nan]), np.ones(2)), share=False)
    assert count.tolist() == [[1, 0], [0, 0]]
    assert value[0, 0] == 3.0
    assert np.isnan(value).sum() == 3


def test_a_share_is_shown_with_its_error() -> None:
    x, y = spread(4000)
    figure = draw(MapRuns(x, y, (y > 18).astype(float) * (np.arange(4000) % 2), np.full(4000, np.nan)))
    (line,) = said(figure)
    assert line.startswith("reference: share in each of 36 cells, 1")
    # The largest error of a share of about half of 111 runs.
    assert float(line.rpartition(" ")[2]) == pytest.approx(0.5 / np.sqrt(111), rel=0.2)


def test_the_line_of_stability_is_drawn_where_it_lies() -> None:
    x, y = spread(40_000)
    figure = draw(MapRuns(x, y, np.zeros(40_000), (y > 18).astype(float)))
    (contour,) = [part for part in figure.axes[0].collections if hasattr(part, "levels")]
    heights = np.concatenate([path.vertices for path in contour.get_paths()])[:, 1]
    assert heights == pytest.approx(18.0, abs=8 / 20)  # within a cell
    assert any(text.startswith("line: on one side") for text in said(figure))
    calm = draw(MapRuns(x, y, np.zeros(40_000), np.ones(40_000)))
    assert not any(text.startswith("line:") for text in said(calm))
