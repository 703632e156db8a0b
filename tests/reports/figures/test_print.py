"""Figures as a journal prints them: formats, sizes, fonts, texts apart from one another, hatching without colour."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import cache, partial
from itertools import combinations
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

from velodrome.reference.inputs import Inputs
from velodrome.reference.surface import Paraboloid
from velodrome.reports.figures import (
    basin_map_figure,
    bifurcation_figure,
    drawn_orbits,
    edge_rides_figure,
    eigenvalue_figure,
    family_figure,
    float32_figure,
    growth_figure,
    orbit_track_figure,
    precision_figure,
    stable_figure,
    use_style,
    within_figure,
    write_formats,
)
from velodrome.scenarios.motions import follow_families
from velodrome.scenarios.scenario import find_bicycle, find_unit, parse_surface

RADIUS = 0.35  # of the front wheel [m]
MILLIMETRES = {1: 89, 2: 183}


def point(step: float, error: float) -> dict[str, float]:
    return {"step": step, "position_error": error, "cpu_time": 1e-3 / step}


PRECISION = {
    "scenario": "q2-plus",
    "duration": 2.0,
    "horizon": None,
    "engines": {
        name: {
            "points": [point(4e-3 / 2**k, scale / 4**k) for k in range(3)],
            "observed_order": 2.0,
            "richardson_error": limit,
        }
        for name, scale, limit in (
            ("reference", 1e-8, None),
            ("exudyn", 4e-4, 1e-10),
            ("exudyn-plane-normal", 4.2e-4, 1.1e-10),
            ("mujoco-native", 1e-1, 2e-2),
        )
    },
}
FLOAT32 = {
    "scenario": "plane-circle",
    "engines": {
        name: {
            "counterpart": "mujoco-native",
            "variants": {
                "state rounded": {
                    "points": [
                        {"time": t, "rms_distance": 1e-7 * t, "unrelated_digits": 2e-7 * t, "repeated_digits": 1e-8}
                        for t in (0.1, 1.0, 10.0)
                    ]
                }
            },
        }
        for name in ("mjx", "mujoco-warp")
    },
    "reference_distance": [{"time": t, "distance": 1e-3 * t} for t in (0.1, 1.0, 10.0)],
}
BICYCLE = {"name": "benchmark", "parameters": None}


def atlas_of_planes() -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Families 1 and 2 at rear rates up to 20, growing slowly, but for a stable part and one that cannot be ridden."""
    alphas = np.array([0.0, 0.1, 0.4, 0.7, 1.0])
    rate = np.linspace(0.0, 20.0, 41)
    growth = np.where((rate > 8) & (rate < 12), -0.5, 0.12)
    rows = [(family, alpha) for alpha in alphas for family in (1, 2)]
    columns = {
        "alpha": np.concatenate([np.full(len(rate), alpha) for _, alpha in rows]),
        "family": np.concatenate([np.full(len(rate), family) for family, _ in rows]),
        "rear_rate": np.tile(rate, len(rows)),
        "growth_rate": np.tile(growth, len(rows)),
        "physical": np.tile(rate > 3, len(rows)),
        "stable": np.tile(growth < 0, len(rows)),
        "lean": np.tile(rate / 40, len(rows)),
    }

    def side(at: float) -> dict[str, list[Any]]:
        criticality = [None, *["subcritical"] * 2, *["supercritical"] * 2]
        return {"rear_rate": [at] * 5, "lean": [at / 40] * 5, "cause": ["hopf"] * 5, "criticality": criticality}

    turn = {"side": "start", "alpha": 0.5, "rear_rate": 8.0, "lean": 0.2}
    section = {"family": 2, "alpha": list(alphas), "start": side(8.0), "end": side(12.0), "bautin": [turn]}
    end = {"alpha": 1.0, "rear_rate": 10.0, "lean": 0.25}
    touching = [{"alpha": 0.384, "rear_rate": 2.0, "families": [1, 3]}]
    document = {"alphas": list(alphas), "stable": [section | {"vanishing": end}], "touching": touching}
    return columns, document | {"bicycle": find_document("benchmark")}


def bounded_atlas() -> dict[str, Any]:
    """The same with the bounds of two circles in each of three bowls, of which one is not known."""
    _, document = atlas_of_planes()
    rows = [
        {"alpha": alpha, "rear_rate": [9.0, 11.0], "stable_within": [bound, 0.02]}
        for alpha, bound in ((0.1, 0.01), (0.4, 0.015), (0.7, None))
    ]
    (region,) = document["stable"]
    return document | {"stable": [region | {"within": rows}]}


@cache
def find_document(name: str) -> dict[str, Any]:
    return families("0.0")["bicycle"]


@cache
def families(ground: str, steer_torque: float = 0.0) -> dict[str, Any]:
    bicycle = find_bicycle("benchmark")
    surface: Any = Paraboloid(float(ground)) if ground[0].isdigit() else parse_surface(ground, "--surface")
    return follow_families(bicycle.bicycle, surface, Inputs(steer_torque)).as_json(bicycle.name)


def stored_document(name: str) -> dict[str, Any]:
    path = Path(__file__).parents[2] / "scenarios" / "commands" / "stored" / f"{name}.json"
    return json.loads(path.read_text(encoding="utf-8"))


def stored_bifurcations() -> dict[str, Any]:
    return stored_document("bifurcations")


def eigenvalues(columns: int) -> Figure:
    speeds = np.linspace(0.0, 10.0, 50)
    weave = 3 - speeds + 1j * speeds
    values = np.column_stack([weave, weave.conj(), speeds / 10 - 0.7, -5 - speeds])
    return eigenvalue_figure("benchmark", speeds, values, ("weave", "weave", "capsize", "castering"), [(3, 7)], columns)


def draw_families(ground: str, torque: float = 0.0) -> Callable[[int], Figure]:
    return lambda columns: family_figure(families(ground, torque), RADIUS, columns=columns, units={"radius": "m"})


DRAWN: dict[str, Callable[[int], Figure]] = {
    "precision": partial(precision_figure, PRECISION),
    "float32": partial(float32_figure, FLOAT32),
    "eigenvalues": eigenvalues,
    "bifurcations": lambda columns: bifurcation_figure(stored_bifurcations(), columns),
    "orbit tracks": lambda columns: orbit_track_figure(stored_bifurcations(), columns),
    "basin map": lambda columns: basin_map_figure(stored_document("basin"), columns),
    "basin edges": lambda columns: edge_rides_figure(stored_document("basin"), columns),
    "growth": lambda columns: growth_figure(*atlas_of_planes(), columns),
    "stable": lambda columns: stable_figure(*atlas_of_planes(), columns),
    "within": lambda columns: within_figure(bounded_atlas(), columns),
    "plane": draw_families("0.0"),
    "bowl": draw_families("0.005"),
    "sphere": draw_families("sphere:radius=20"),
    "torque": draw_families("0.005", 0.002),
}


@pytest.mark.parametrize("columns", [1, 2])
@pytest.mark.parametrize("name", DRAWN)
def test_no_text_lies_on_another_or_outside_the_figure(name: str, columns: int) -> None:
    with use_style():
        figure = DRAWN[name](columns)
        figure.draw_without_rendering()
        # Ticks beyond the limits of their axis have texts that are never drawn.
        hidden = {
            text
            for axes in figure.axes
            for axis in (axes.xaxis, axes.yaxis)
            for tick in [*axis.majorTicks, *axis.minorTicks]
            for text in (tick.label1, tick.label2)
            if not min(axis.get_view_interval()) <= tick.get_loc() <= max(axis.get_view_interval())
        }
        texts = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text() and text not in hidden]
        boxes = [Text.get_window_extent(text) for text in texts]
        for (text, box), (other, second) in combinations(zip(texts, boxes, strict=True), 2):
            # Neighbouring boxes may touch: letters do not fill them.
            assert not box.padded(-0.5).overlaps(second.padded(-0.5)), (text.get_text(), other.get_text())
        for text, box in zip(texts, boxes, strict=True):
            inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
            assert inside, text.get_text()


@pytest.mark.parametrize("columns", [1, 2])
def test_each_format_is_as_wide_as_the_journals_columns(tmp_path: Path, columns: int) -> None:
    inches = MILLIMETRES[columns] / 25.4
    png, svg, pdf = write_formats(tmp_path / "figure", DRAWN["precision"], ["png", "svg", "pdf"], columns)
    with Image.open(png) as image:
        # 300 dots an inch; matplotlib cuts the last part of a pixel off. PNG stores dots a metre.
        assert image.width == int(300 * inches)
        assert image.info["dpi"] == pytest.approx((300, 300), abs=0.01)
    root = ElementTree.parse(svg).getroot()
    assert float(root.attrib["width"].removesuffix("pt")) == pytest.approx(72 * inches, abs=1e-4)
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", pdf.read_bytes())
    assert box is not None
    assert float(box[1]) == pytest.approx(72 * inches, abs=1e-4)


def test_text_is_text_in_svg_and_fonts_are_in_the_pdf(tmp_path: Path) -> None:
    svg, pdf = write_formats(tmp_path / "figure", DRAWN["growth"], ["svg", "pdf"])
    root = ElementTree.parse(svg).getroot()
    texts = ["".join(node.itertext()) for node in root.iter("{http://www.w3.org/2000/svg}text")]
    assert "cannot be ridden: contact lost, or a rim inside the ground" in texts
    # A title with a formula has its letters one by one and by their font, as text too.
    assert any(sorted("".join(text.split())) == sorted("rear-wheelrateωr[rad/s]") for text in texts)
    assert "DejaVu Sans" in svg.read_text(encoding="utf-8")
    data = pdf.read_bytes()
    assert data.startswith(b"%PDF-")
    assert data.rstrip().endswith(b"%%EOF")
    fonts = re.findall(rb"/Subtype /(Type0|TrueType|Type3|Type1)\b", data)
    assert fonts
    assert set(fonts) <= {b"Type0", b"TrueType"}  # Type 0 is how a Type 42 font with many letters is stored
    assert b"/FontFile2" in data


def test_an_absent_motion_is_hatched_and_a_slowly_growing_one_is_not() -> None:
    """In grey, without any colour: rates above 20 are absent, those of 13 to 19 grow slowly, of 9 to 11 are stable."""
    with use_style():
        figure = growth_figure(*atlas_of_planes())
        figure.set_dpi(300)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        pixels = np.asarray(canvas.buffer_rgba(), float)[..., :3] @ [0.299, 0.587, 0.114]

        def region(axes: Any, low: float, high: float) -> np.ndarray:
            (x0, y0), (x1, y1) = axes.transData.transform([(0.45, low), (0.68, high)]).round().astype(int)
            return pixels[len(pixels) - y1 : len(pixels) - y0, x0:x1]

        first, third = figure.axes[0], figure.axes[2]
        absent, slow, stable = region(first, 22, 33), region(first, 13, 19), region(first, 9, 11)
        unridden, empty = region(first, 0.5, 2.5), region(third, 10, 30)
    assert np.ptp(slow) < 2  # of 255: no hatching
    for hatched in (absent, stable, unridden, empty):
        assert np.ptp(hatched) > 60
    # Hatching covers a part of a region: an absent motion is light with dark lines, a stable one dark with light dots.
    assert np.median(absent) > 250
    assert np.median(stable) < 150 < 200 < np.median(slow) < 252
    assert 0.02 < (absent < 230).mean() < 0.4


@pytest.mark.parametrize(
    ("ground", "torque", "expected"),
    [
        ("0.0", 0.0, {"static", "pivot", "cusp", "straight", "flat", "fast front wheel"}),
        ("0.005", 0.0, {"static", "pivot", "cusp", "large circle", "flat", "fast front wheel"}),
        ("sphere:radius=20", 0.0, {"static", "pivot", "cusp", "edge", "flat", "fast front wheel"}),
        ("0.005", 0.002, {"static", "pivot", "cusp", "large circle", "flat", "fast front wheel"}),
    ],
)
def test_every_end_of_a_curve_is_marked_and_explained(ground: str, torque: float, expected: set[str]) -> None:
    found = families(ground, torque)["families"]
    ends = {end for family in found for end in family["ends"]}
    with use_style():
        figure = DRAWN["plane"](2) if ground == "0.0" else draw_families(ground, torque)(2)
    (legend,) = figure.legends
    meanings = [text.get_text() for text in legend.get_texts()]
    for axes in figure.axes[:2]:
        marked = {str(line.get_gid()) for line in axes.lines if line.get_marker() not in ("None", None)}
        assert marked == expected
        assert ends - {"large circle"} <= marked  # straight motions stand for the large circles of the plane
    for kind, words in {"edge": "edge of the ground", "fast front wheel": "front wheel ever faster"}.items():
        assert (f"limit: {words}" in meanings) == (kind in expected)
    assert len(meanings) == len(set(meanings))


def test_the_ground_is_told_with_its_units() -> None:
    with use_style():
        figure = draw_families("sphere:radius=20")(2)
    assert figure.axes[0].texts[0].get_text() == "(a)  sphere, radius 20.0 m"
    assert (find_unit("surface.radius"), find_unit("surface.slope"), find_unit("surface.alpha")) == ("m", "1", "1/m")
    assert find_unit("engines.exudyn.step") == "s"
    assert find_unit("motion.rear_rate") == "rad/s"
    assert find_unit("bicycle.rear_frame_mass") == "kg"
    assert find_unit("title") is find_unit("no.such.field") is None


def test_tracks_are_drawn_until_they_have_gone_around() -> None:
    document = stored_bifurcations()
    with use_style():
        figure = orbit_track_figure(document)
    drawn = drawn_orbits(document)
    assert [point["family"] for point, _ in drawn] == [2, 4]  # the third Hopf point ends no stable section
    for axes, (_, orbit) in zip(figure.axes, drawn, strict=True):
        (rear,) = (line for line in axes.lines if line.get_gid() == "rear track")
        x, y = np.asarray(rear.get_xdata()), np.asarray(rear.get_ydata())
        periods = len(x) / len(orbit["track"]["rear"])
        precession = abs(np.angle(np.exp(1j * orbit["yaw_advance"])))
        assert (periods - 1) * precession < 2 * np.pi <= periods * precession
        # Every period begins where the one before it ends.
        seams = np.arange(1, int(periods)) * len(orbit["track"]["rear"])
        assert np.hypot(x[seams] - x[seams - 1], y[seams] - y[seams - 1]) == pytest.approx(0, abs=1e-5)


def test_orbits_are_drawn_stable_from_the_supercritical_end_to_the_torus_bifurcation() -> None:
    with use_style():
        figure = bifurcation_figure(stored_bifurcations())
    axes = figure.axes[1]
    lines = {kind: [line for line in axes.lines if line.get_gid() == kind] for kind in ("stable orbits", "torus")}
    (torus,) = lines["torus"]
    energies = [np.asarray(line.get_xdata()) for line in lines["stable orbits"]]
    end = float(np.asarray(torus.get_xdata())[0])
    # The stored branch comes from the subcritical end: it is stable beyond the torus bifurcation.
    assert min(part.min() for part in energies) == pytest.approx(end, abs=1e-6)


def test_a_basin_is_drawn_with_its_edge_and_both_rides_of_each_direction() -> None:
    document = stored_document("basin")
    with use_style():
        seen = basin_map_figure(document)
        rides = edge_rides_figure(document)
    (axes,) = seen.axes
    (mesh,) = [part for part in axes.collections if isinstance(part, QuadMesh)]
    survived = np.array([[letter in "ro" for letter in row] for row in document["map"]["rows"]])
    colours = np.asarray(mesh.get_array()).reshape(survived.shape)
    assert survived.any()
    assert len(np.unique(colours[survived])) + len(np.unique(colours[~survived])) == len(document["map"]["outcomes"])
    edges = [edge for edge in document["edges"] if set(edge["along"]) <= {"lean_rate", "steer_rate"}]
    (points,) = [line for line in axes.lines if line.get_marker() == "o"]
    assert len(np.asarray(points.get_xdata())) == len(edges)
    panels = [axes for axes in rides.axes if axes.get_visible()]
    assert len(panels) == len(document["edges"])
    for axes in panels:
        assert {part.get_gid() for part in axes.collections if part.get_gid()} == {"inside", "outside"}
