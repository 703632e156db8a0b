"""What the figures of the atlas draw."""

import numpy as np

from tests.reports.figures.test_print import atlas_of_planes, bounded_atlas
from velodrome.reports.figures.atlas import sheet, stable_figure
from velodrome.reports.figures.style import use_style
from velodrome.reports.figures.within import arrange_bounds, list_bounded_regions


def test_where_a_curve_folds_the_least_growth_is_shown() -> None:
    """Family 2 runs from rate 0 to 10 with growth 4, folds and comes back with growth 1; family 1 is elsewhere."""
    rate = np.array([0.0, 10.0, 4.0, 2.0])
    growth = np.array([4.0, 4.0, 1.0, 1.0])
    columns = {
        "family": np.array([1, *[2] * 8]),
        "alpha": np.array([0.5, *[0.1] * 4, *[0.5] * 4]),
        "rear_rate": np.concatenate([[3.0], rate, rate + 5]),
        "growth_rate": np.concatenate([[-1.0], growth, growth]),
        "physical": np.concatenate([[True], [True, True, True, False], [False] * 4]),
    }
    order = np.argsort(columns["alpha"], kind="stable")
    rates = np.array([1.0, 3.0, 7.0, 12.0])
    shown, pushed = sheet({name: values[order] for name, values in columns.items()}, 2, np.array([0.1, 0.5]), rates)
    # At rate 7 the second branch is half-way between growth 4 and 1.
    assert np.array_equal(shown[:, 0], [4.0, 1.0, 2.5, np.nan], equal_nan=True)
    assert np.array_equal(shown[:, 1], [np.nan, np.nan, 1.0, 2.5], equal_nan=True)
    assert pushed[:, 0].tolist() == [True, True, True, False]
    assert not pushed[:, 1].any()


def test_lines_of_different_criticality_meet_in_the_degenerate_point() -> None:
    with use_style():
        axes = stable_figure(*atlas_of_planes()).axes[0]
    lines = {line.get_gid(): (np.array(line.get_xdata()), line.get_linestyle()) for line in axes.lines}
    (dashed, dashes), (solid, style) = lines["start: subcritical"], lines["start: supercritical"]
    assert dashed.tolist() == [0.1, 0.4, 0.5]
    assert solid.tolist() == [0.5, 0.7, 1.0, 1.0]
    assert (dashes, style) == ("--", "-")
    assert lines["Bautin point"][0].tolist() == [0.5]
    # The other side has no such point: its lines end at the shapes between which the criticality changes.
    assert lines["end: subcritical"][0].tolist() == [0.1, 0.4]


def test_bounds_are_drawn_where_they_are_known() -> None:
    document = bounded_atlas()
    (region,) = list_bounded_regions(document)
    none = {"alpha": 1.0, "rear_rate": [], "stable_within": []}  # a bowl in which no orbits are known
    alpha, rate, bound = arrange_bounds([*region["within"], none])
    assert alpha.tolist() == [[0.1, 0.1], [0.4, 0.4], [0.7, 0.7]]
    assert rate.tolist() == [[9.0, 11.0]] * 3
    assert np.array_equal(bound, [[0.01, 0.02], [0.015, 0.02], [np.nan, 0.02]], equal_nan=True)
    unknown = [row | {"stable_within": [None, None]} for row in region["within"]]
    for rows in (None, unknown, [none]):
        assert list_bounded_regions({"stable": [{**region, "within": rows}]}) == []
