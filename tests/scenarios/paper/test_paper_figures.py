"""The paper's figures show what the data say: letters, stable sections, pulled wheels, ranges, files."""

from __future__ import annotations

import json
from functools import cache, partial
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from tests.literature import published
from velodrome.reference.kinematics import REAR_ANGLE
from velodrome.reference.surface import Paraboloid
from velodrome.reports.figures.families import family_figure
from velodrome.reports.figures.solution_curve import SolutionCurve, make_curves, scaled_speed
from velodrome.reports.figures.style import new_figure, use_style, write_figure, write_formats
from velodrome.scenarios.files import FigureOutput
from velodrome.scenarios.motions.families import families_document
from velodrome.scenarios.paper.figures.captions import families_caption, settled_rate
from velodrome.scenarios.paper.figures.configurations import Configuration, configurations_figure
from velodrome.scenarios.paper.figures.folder import (
    ALPHAS,
    DEPARTURE,
    DISTURBED_SCENARIO,
    SETTLING,
    circle_of_equal_energy,
    linearised_point,
    ride_from,
    start_named,
    write_figures,
)
from velodrome.scenarios.paper.figures.picture import Picture, View
from velodrome.scenarios.paper.figures.tables import PRINTED, linearisation_document, linearisation_tables
from velodrome.scenarios.paper.figures.trajectories import departure_figure, disturbed_figure, leaves_at

RADIUS = 0.35  # of the front wheel [m]
XIONG = published("xiong2020")

document = cache(families_document)


@cache
def drawn(alpha: float) -> Figure:
    with use_style():
        return family_figure(document(alpha), RADIUS)


def panels(figure: Figure) -> list[Axes]:
    return [axes for axes in figure.axes if axes.get_xlabel().startswith("arctan")]


def words(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts if text.get_text()]


def lines(axes: Axes, gid: str) -> list[np.ndarray]:
    return [np.column_stack(line.get_data()) for line in axes.lines if line.get_gid() == gid]


def test_the_abscissa_is_the_papers_and_blind_to_the_sign() -> None:
    front_rate = float(XIONG["D"]["front_rate"])
    assert scaled_speed(front_rate, RADIUS) == np.arctan(RADIUS * 14.6 / 4)
    assert np.array_equal(scaled_speed(np.array([-3.0, 3.0]), RADIUS), np.full(2, np.arctan(RADIUS * 3.0 / 4)))


def test_a_curve_is_cut_where_it_can_no_longer_be_ridden() -> None:
    line = np.arange(7.0)
    pulled = np.array([False, False, True, True, False, False, False])
    curve = SolutionCurve((1,), line, line, line, pulled, ((0.0, 1.25), (5.5, 6.0)), (), (), ())
    assert curve.pieces() == [
        (0.0, 1.25, "ridden"),
        (1.25, 3.5, "pulled"),
        (3.5, 5.5, "touching"),
        (5.5, 6.0, "ridden"),
    ]
    assert curve.line("lean", 0.5, 2.25).tolist() == [[0.5, 0.5], [1.0, 1.0], [2.0, 2.0], [2.25, 2.25]]


@pytest.mark.parametrize("alpha", ALPHAS.values())
def test_each_panel_has_the_papers_letters_and_families(alpha: float) -> None:
    expected = {"A", "B", "C", "E", "F", "G (H)"} | ({"D", "I"} if alpha <= 1 / 200 else set())
    expected |= {"1", "3", "4", "1+3", "2+4"} if alpha == 1 else {"1", "2", "3", "4"}
    for axes in panels(drawn(alpha)):
        found = words(axes)
        assert expected == set(found[1:])  # the first is the panel's tag
        assert len(found) == len(set(found))


@pytest.mark.parametrize("alpha", ALPHAS.values())
def test_labels_stay_off_one_another_and_letters_off_the_curves(alpha: float) -> None:
    figure = drawn(alpha)
    with use_style():
        figure.draw_without_rendering()
        for axes in panels(figure):
            texts = [text for text in axes.texts if isinstance(text, Annotation) and text.get_text()]
            # Of the letters alone: a window extent would include a badge's frame.
            boxes = [text.get_window_extent() for text in texts]
            for i, box in enumerate(boxes):
                assert not any(box.overlaps(other) for other in boxes[:i]), texts[i].get_text()
            points = np.concatenate([axes.transData.transform(line.get_xydata()) for line in axes.lines])
            for text, box in zip(texts, boxes, strict=True):
                if text.get_text()[0].isalpha():
                    inside = (points > [box.x0, box.y0]) & (points < [box.x1, box.y1])
                    assert not inside.all(axis=1).any(), text.get_text()


@pytest.mark.parametrize("alpha", ALPHAS.values())
def test_stable_sections_are_thick_between_their_ends(alpha: float) -> None:
    sections = [s for family in document(alpha)["families"] for s in family["stable_sections"]]
    # The paper: none from alpha = 1/20 on. Of the two at 1/200 it saw one.
    assert len(sections) == (2 if alpha <= 1 / 200 else 0)
    for axes, angle in zip(panels(drawn(alpha)), ("lean", "steer"), strict=True):
        shown = lines(axes, "stable")
        assert len(shown) == len(sections)
        for line, section in zip(shown, sections, strict=True):
            # A chord of the arc's longest step, 0.05, lies within 0.05^2 / 8 of a curve of curvature 1.
            assert np.sort(line[[0, -1], 1]) == pytest.approx(np.sort(section[angle]), abs=5e-4)


def test_what_would_have_to_be_pulled_is_dashed_and_nothing_else() -> None:
    for alpha in (0.0, 1.0):
        for axes, angle in zip(panels(drawn(alpha)), ("lean", "steer"), strict=True):
            dashed, solid = (np.concatenate(lines(axes, gid)) for gid in ("pulled", "pushed"))
            for family in document(alpha)["families"]:
                points = family["points"]
                place = np.column_stack([scaled_speed(np.array(points["front_rate"]), RADIUS), points[angle]])
                push = np.minimum(points["normal_force_rear"], points["normal_force_front"])
                for point, force in zip(place[::7], push[::7], strict=True):
                    near = [np.hypot(*(line - point).T).min() for line in (solid, dashed)]
                    # Two families that share a curve sample it at different places, up to half a step away.
                    assert near[0 if force > 0 else 1] <= 0.025, (family["family"], point, force)


@pytest.mark.parametrize("alpha", ALPHAS.values())
def test_axes_run_over_all_that_there_can_be(alpha: float) -> None:
    lean, steer = panels(drawn(alpha))
    assert lean.get_xlim() == steer.get_xlim() == (0, np.pi / 2)
    assert lean.get_ylim() == (-np.pi / 2, np.pi / 2)
    assert steer.get_ylim() == (0, np.pi)
    for axes in (lean, steer):
        (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
        points = np.concatenate([np.column_stack(line.get_data()) for line in axes.lines])
        assert np.all((points >= [x0 - 1e-12, y0 - 1e-12]) & (points <= [x1 + 1e-12, y1 + 1e-12]))


def test_families_that_join_share_one_curve() -> None:
    found = sorted(curve.families for curve in make_curves(document(1.0)["families"], RADIUS))
    assert found == [(1,), (1, 3), (2, 4), (3,), (4,)]
    caption = families_caption(document(1.0), RADIUS)
    assert "2 with 4 and 1 with 3" in caption
    assert "No section" in caption
    assert "joined" not in families_caption(document(0.0), RADIUS)


def test_large_circles_are_the_ones_that_tend_to_c() -> None:
    reversed_circles = [
        f for f in document(1.0)["families"] if min(f["points"]["steer"]) > np.pi / 2 and f["ends"][0] == f["ends"][1]
    ]
    assert [f["family"] for f in reversed_circles] == [4]
    assert set(reversed_circles[0]["ends"]) == {"large circle"}


def test_a_figure_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    before = dict(mpl.rcParams)
    path = tmp_path / "families.svg"
    draw = partial(family_figure, document(0.05), RADIUS)
    assert write_formats(tmp_path / "families", lambda columns: draw(columns=columns), ["svg"]) == [path]
    first = path.read_bytes()
    assert first.endswith(b"</svg>\n")
    write_formats(tmp_path / "families", lambda columns: draw(columns=columns), ["svg"])
    assert path.read_bytes() == first  # no date, no random names
    with use_style():
        figure = new_figure(1.0)
        figure.text(0.5, 0.5, "$\\nonsense$")
        with pytest.raises(ValueError, match="nonsense"):
            write_figure(path, figure)
    assert path.read_bytes() == first
    assert list(tmp_path.iterdir()) == [path]
    assert dict(mpl.rcParams) == before


SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def test_a_picture_hides_what_is_behind() -> None:
    view = View(0.0, np.pi / 2, np.zeros(3), 4.0, 4.0)  # from above, x downwards
    picture = Picture(view, 40)
    above = np.array([0.0, 0.0, 1.0])
    up = np.tile(above, (4, 1))
    red, blue = np.tile([1.0, 0, 0], (4, 1)), np.tile([0.0, 0, 1], (4, 1))
    picture.body(0.5 * SQUARE + above, up, TWO, red)
    picture.body(SQUARE, up, TWO, blue)
    picture.body(SQUARE + 2 * above, up, TWO[:, ::-1], red, cull=True)  # shows its back
    picture.line(np.array([[-2.0, 0, -1], [2, 0, -1]]), 2.0, np.zeros(3))
    pixels = picture.pixels()
    middle, ring, outside, line = pixels[20, 20], pixels[8 + 5, 13], pixels[2, 2], pixels[4, 20]
    assert middle[0] > 0.5 > middle[2]
    assert ring[2] > 0.5 > ring[0]
    assert outside[3] == 0
    assert line.tolist() == [0, 0, 0, 1]


def test_a_bicycle_stands_in_its_bowl() -> None:
    start = start_named("p4")
    assert start.motion is not None
    with use_style():
        figure = configurations_figure(start.problem.bicycle, Paraboloid(0.2), [Configuration("P4", 4, start.motion)])
    (axes,) = figure.axes
    assert axes.get_title() == "(a)  P4, family 4, clockwise"
    values: Any = XIONG["P4"]
    assert all(
        value.replace("-", "−") in words(axes)[-1] for value in (values["lean"], values["steer"], values["front_rate"])
    )
    pixels: Any = axes.images[0].get_array()
    assert 0.4 < (pixels[..., 3] > 0).mean() < 0.9  # an ellipse in its frame fills pi / 4
    # Family 4's pink is seen: much less green than red.
    assert (pixels[..., 0] - pixels[..., 1] > 0.2).mean() > 0.003


def test_q1_leaves_its_circle_later_the_smaller_the_errors() -> None:
    start = start_named("q1", DEPARTURE)
    assert start.motion is not None
    ride = ride_from("Q1", start)
    paper, precise = (leaves_at(motion, start.motion, 0.01) for motion in (ride.paper, ride.precise))
    assert paper is not None
    assert precise is not None
    # Errors of 1e-6 of the paper's integrator against some 1e-13 of round-off: ln(1e7) / 0.384 is 42 s.
    assert 30 < precise - paper < 50
    assert "leaves the ground" in (ride.paper.ended or "")
    with use_style():
        figure = departure_figure(ride, start.motion, start.growth_rate)
    path, rates, growth = figure.axes
    for axes in (path, rates, growth):
        assert {"precise", "modified Euler"} <= {line.get_gid() for line in axes.lines}
    (theory,) = lines(growth, "theory")
    slope = np.diff(np.log(theory[:, 1])) / np.diff(theory[:, 0])
    assert slope == pytest.approx(start.growth_rate, rel=1e-12)


def test_disturbed_q2_settles_on_the_circle_of_its_energy() -> None:
    circle = start_named("q2").motion
    assert circle is not None
    starts = {words: start_named(name, SETTLING) for words, name in DISTURBED_SCENARIO.items()}
    rides = [ride_from(words, start) for words, start in starts.items()]
    neighbours = {words: circle_of_equal_energy(start, circle) for words, start in starts.items()}
    for ride in rides:
        away = neighbours[ride.name].rear_rate - circle.rear_rate
        assert abs(away) > 0.05
        # What the slowest mode has left after 60 s, exp(-0.0111 * 60) = 0.51 of it, swings about the rate.
        late = ride.precise.qd[ride.precise.time > SETTLING - 10, REAR_ANGLE]
        swing = float(np.ptp(late)) / 2
        assert abs(settled_rate(ride) - circle.rear_rate - away) < swing < 0.1 * abs(away)
    with use_style():
        figure = disturbed_figure(rides, circle, neighbours)
    rates = figure.axes[1]
    levels = [line[0, 1] for line in lines(rates, "neighbour")]
    assert levels == [neighbours[ride.name].rear_rate for ride in rides]
    assert len(lines(figure.axes[2], "apart")) == 2


def test_tables_round_to_the_print_and_json_is_exact() -> None:
    points = [linearised_point("Q1", "q1"), linearised_point("Q2", "q2")]
    text = linearisation_tables(points)
    assert text.count("| yes |") == sum(len(PRINTED[point.name]) for point in points)
    assert "| no |" not in text
    stored = json.loads(json.dumps(linearisation_document(points)))
    for point in points:
        assert np.array_equal(stored[point.name]["jacobian"], point.system.jacobian)
        # The eigenvalues' sum is the trace.
        trace = sum(complex(*value) for value in stored[point.name]["eigenvalues"])
        assert trace == pytest.approx(np.trace(point.system.jacobian), abs=1e-12)
    printed = {name: {value for text in PRINTED[name] for value in _signs(text)} for name in PRINTED}
    assert all(set(XIONG[name]["eigenvalues"]) == printed[name] for name in PRINTED)


def _signs(text: str) -> list[str]:
    return [text.replace("±", sign) for sign in ("+", "-")]


@pytest.mark.slow
def test_everything_is_written(tmp_path: Path) -> None:
    seen: list[tuple[str, float, float]] = []
    written = write_figures(tmp_path / "figures", lambda *step: seen.append(step), FigureOutput())
    assert sorted(written) == sorted((tmp_path / "figures").iterdir())
    assert [path.stem for path in written[:8]] == [f"figure-{k}" for k in range(2, 10)]
    assert [done for _, done, _ in seen] == list(range(9))
    captions = (tmp_path / "figures" / "captions.md").read_text(encoding="utf-8")
    assert captions.count("## Figure") == 8
