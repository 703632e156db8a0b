"""What a recording shows at first sight: the ride, the names, the curves, and no fallen bicycle that rules them."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import BICYCLE, BOWL, Content, Views, ride

from velodrome.engines.engine import REFERENCE, Trajectory
from velodrome.reference.kinematics import LEAN
from velodrome.reference.surface import Plane
from velodrome.reports.drawing import make_ground
from velodrome.reports.recording.camera import FIELD_OF_VIEW, VIEW, Camera, fit_camera
from velodrome.reports.recording.labels import HANG, measure_labels, place_names
from velodrome.reports.recording.legend import place_legend
from velodrome.reports.recording.overview import choose_overview, mirror_camera
from velodrome.reports.recording.rerun_file import write_recording

NAMES = ["one", "two-with-a-longer-name", "three", "mujoco-exact-contact", "five", "six", "seven", "eight", "nine"]
FELL = "fallen"
LEAN_VIEW = "lean, + to the right [rad]"


def fallen(samples: int = 81) -> Trajectory:
    """A ride that leaves the others: it leans far, flies off, and ends."""
    run = ride(FELL, samples=samples, ended="the bicycle fell")
    q = run.q.copy()
    q[:, LEAN] += np.linspace(0, 0.8, samples) ** 2
    away = np.linspace(0, 3.0, samples)[:, None] ** 3 * np.array([1.0, 0.5, 0.0])
    q[:, :3] += away
    assert run.contact_point is not None
    point = run.contact_point + away[:, None]
    return replace(run, q=q, contact_point=point, body_position=run.body_position + away[:, None])


def riders() -> dict[str, Trajectory]:
    """Ten that ride together, all but the last to the bit."""
    together = {name: replace(ride(REFERENCE), engine=name) for name in [REFERENCE, *NAMES]}
    return together | {NAMES[-1]: ride(NAMES[-1], shift=0.02)}


@pytest.fixture(scope="module")
def runs() -> dict[str, Trajectory]:
    return riders() | {FELL: fallen()}


@pytest.fixture(scope="module")
def path(runs: dict[str, Trajectory], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("layout") / "comparison.rrd"
    write_recording(path, "Together", BICYCLE, BOWL, runs, "**All.**", "# A ride")
    return path


@pytest.fixture(scope="module")
def views(path: Path) -> Views:
    return Views(path)


@pytest.fixture(scope="module")
def content(path: Path) -> Content:
    return Content(path)


@pytest.fixture(scope="module")
def view(views: Views) -> str:
    """Name of the view of the ride."""
    return next(name for name in views.paths if name.startswith("Ride"))


def see(camera: Camera, points: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Where points (n, 3) are in a view of a size, from its upper left corner [points].

    By a matrix of perspective, as the viewer has it.
    """
    back = camera.position - camera.target
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    local = (points - camera.position) @ np.column_stack([right, np.cross(back, right), back])
    focal = 1 / np.tan(FIELD_OF_VIEW / 2)
    clip = focal * local[:, :2] / -local[:, 2:] * [size[1] / size[0], 1.0]
    return (0.5 + 0.5 * clip * [1.0, -1.0]) * np.array(size)


def eye(views: Views, name: str) -> Camera:
    position, target = (views.get(name, f"EyeControls3D:{part}") for part in ("position", "look_target"))
    return Camera(np.array(position, float), np.array(target, float))


def overlap(middles: np.ndarray, sizes: np.ndarray) -> list[tuple[int, int]]:
    return [
        (k, j)
        for k, j in combinations(range(len(middles)), 2)
        if (np.abs(middles[k] - middles[j]) < 0.5 * (sizes[k] + sizes[j])).all()
    ]


@pytest.mark.parametrize("size", [VIEW, (1150.0, 920.0), (2000.0, 1500.0)])
def test_no_name_covers_another_one(
    size: tuple[float, float], views: Views, view: str, content: Content, runs: dict[str, Trajectory]
) -> None:
    """The labels' boxes by the viewer's camera, at every time at which their places are set."""
    camera, spots, sizes = eye(views, view), {}, {}
    when, _, _ = content.values(f"/world/{REFERENCE}/here/name", "Points3D:positions")
    for name in runs:
        time, _, at = content.values(f"/world/{name}/here", "Transform3D:translation")
        own, _, beside = content.values(f"/world/{name}/here/name", "Points3D:positions")
        np.testing.assert_array_equal(own, when)
        spots[name] = at[np.isin(time, when)] + beside
        sizes[name] = measure_labels([f"{name} (ended)" if name == FELL else name])[0]
    assert len(when) > 30
    boxes = np.array(list(sizes.values()))
    for k in range(len(when)):
        seen = see(camera, np.array([spots[name][k] for name in runs]), size)
        # A label hangs below its point, with the same gap in every view.
        middles = seen + np.column_stack([0 * boxes[:, 0], HANG + boxes[:, 1] / 2])
        assert overlap(middles, boxes) == []
        # The fallen one flies out of the picture, with its name.
        staying = np.array([name != FELL for name in runs])
        assert (middles[staying] > 0).all()
        assert (middles[staying] < size).all()


def test_a_line_leads_from_every_name_to_its_bicycle(content: Content, runs: dict[str, Trajectory]) -> None:
    for name in runs:
        time, _, ends = content.values(f"/world/{name}/here/leader", "LineStrips3D:strips")
        ends = ends.reshape(len(time), 2, 3)
        np.testing.assert_array_equal(ends[:, 0], 0.0)  # D, in its own frame
        _, _, spots = content.values(f"/world/{name}/here/name", "Points3D:positions")
        # It ends at the label's lower or upper side: nearer to its point than a tenth of the way.
        assert (np.linalg.norm(ends[:, 1] - spots, axis=1) < 0.6 * np.linalg.norm(spots, axis=1)).all()


@given(
    st.lists(st.tuples(st.floats(-380, 380), st.floats(-300, 300)), min_size=1, max_size=16),
    st.lists(st.text("abcdefghij-", min_size=1, max_size=30), min_size=16, max_size=16),
    st.floats(0, 120),
)
def test_labels_never_overlap(places: list[tuple[float, float]], names: list[str], reach: float) -> None:
    anchors = np.array([places])
    sizes = measure_labels(names)[: len(places)]
    placed = place_names(anchors, np.full(anchors.shape[:2], reach), sizes)
    assert overlap(placed[0], sizes) == []


def test_a_bicycle_behind_the_camera_has_no_place_and_takes_none() -> None:
    anchors = np.array([[[np.nan, np.nan], [0.0, 0.0]]])
    placed = place_names(anchors, np.zeros((1, 2)), measure_labels(["one", "two"]))
    assert np.isnan(placed[0, 0]).all()
    assert np.isfinite(placed[0, 1]).all()


def test_the_legend_is_apart_and_within_its_view() -> None:
    middles, size = place_legend(NAMES * 2)
    boxes = measure_labels(NAMES * 2)
    assert overlap(middles, boxes) == []
    assert (middles - boxes / 2 >= 0).all()
    assert (middles + boxes / 2 <= size).all()


def test_the_camera_shows_the_ride_and_no_more(views: Views, view: str, runs: dict[str, Trajectory]) -> None:
    camera = eye(views, view)
    path = runs[REFERENCE].q[:, :3]
    seen = see(camera, path, VIEW)
    assert (seen > 0).all()
    assert (seen < VIEW).all()
    # The circle's width is most of the view's.
    around = np.linspace(0, 2 * np.pi, 100)
    radius = np.hypot(path[0, 0], path[0, 1])
    circle = np.column_stack([radius * np.cos(around), radius * np.sin(around), np.full(100, path[0, 2])])
    assert np.ptp(see(camera, circle, VIEW)[:, 0]) > 0.6 * VIEW[0]


@given(st.floats(0.3, 1.2), st.floats(0, 6.28), st.floats(0, 100), st.integers(0, 2**32 - 1))
def test_a_fitted_camera_has_everything_in_its_picture(
    elevation: float, azimuth: float, above: float, seed: int
) -> None:
    points = np.random.default_rng(seed).normal(size=(20, 3)) * [3.0, 3.0, 0.5]
    camera = fit_camera(points, azimuth, elevation, above)
    seen, depth = camera.project(points)
    assert depth.min() > 0
    low, high = seen.min(axis=0), seen.max(axis=0)
    assert (low >= -np.array(VIEW) / 2).all()
    assert (high <= np.array(VIEW) / 2 - [0.0, above]).all()
    # It is the nearest: one of the margins is used up, to the distance at which centring ends.
    spare = np.array([np.array(VIEW) / 2 - 40 - [0, above] - high, np.array(VIEW) / 2 - 40 + low])
    assert spare.min() < 1.0
    np.testing.assert_allclose(camera.place(seen, depth), points, atol=1e-12)


def test_a_wide_ride_is_followed(runs: dict[str, Trajectory]) -> None:
    def widened(run: Trajectory) -> Trajectory:
        scale = np.ones(9)
        scale[:2] = 20.0
        shift = run.q[:, None, :3] * (scale[:3] - 1)
        return replace(run, q=run.q * scale, body_position=run.body_position + shift)

    wide = {name: widened(runs[name]) for name in (FELL, REFERENCE)}
    ground = make_ground(Plane(), wide[REFERENCE].q[:, :2])
    found = choose_overview(wide, BICYCLE, ground)
    assert found.followed == REFERENCE  # not the fallen one, which comes first
    assert choose_overview(runs, BICYCLE, make_ground(BOWL, runs[REFERENCE].q[:, :2])).followed is None


def test_a_camera_is_on_the_inner_side_of_the_curve(runs: dict[str, Trajectory]) -> None:
    right = runs[REFERENCE]
    left = replace(right, q=right.q * np.where(np.arange(9) == 3, -1.0, 1.0))
    camera = Camera(np.array([-2.0, -1.0, 1.0]), np.zeros(3))
    assert mirror_camera(camera, right if right.q[-1, 3] < right.q[0, 3] else left) is camera
    other = mirror_camera(camera, left if right.q[-1, 3] < right.q[0, 3] else right)
    np.testing.assert_array_equal(other.position, [-2.0, 1.0, 1.0])


def test_bicycles_at_one_place_are_shown_side_by_side_and_one_at_a_time(views: Views) -> None:
    for name in NAMES:
        ghosts = views.overridden(name, "Mesh3D:albedo_factor")
        assert set(ghosts) >= {f"/world/{REFERENCE}/rear_frame/shape", f"/world/{REFERENCE}/front_wheel/shape"}
        # The last of the four bytes is the share that is not seen through.
        assert {colour & 255 for colour in ghosts.values()} == {60}
    assert views.overridden(REFERENCE, "Mesh3D:albedo_factor") == {}


def test_a_fallen_bicycle_rules_no_axis(views: Views, runs: dict[str, Trajectory]) -> None:
    low, high = (pick(runs[NAMES[-1]].q[:, LEAN]) for pick in (np.min, np.max))
    assert runs[FELL].q[:, LEAN].max() > high + 0.5
    axis = views.get(f"{LEAN_VIEW}; {FELL} beyond", "ScalarAxis:range")
    assert axis[0] <= low
    assert high <= axis[1]
    assert axis[1] - axis[0] <= 1.2 * max(high - low, 0.02)
    radii = np.hypot(*runs[FELL].q[:, :2].T)
    assert radii.max() > 10
    assert views.get(f"distance from the axis [m]; {FELL} beyond", "ScalarAxis:range")[1] < 3


def test_a_fallen_bicycle_rules_neither_camera_nor_ground(
    views: Views, view: str, content: Content, tmp_path: Path
) -> None:
    upright = tmp_path / "upright.rrd"
    write_recording(upright, "Upright", BICYCLE, BOWL, riders(), "", "")
    for part in ("position", "look_target"):
        assert Views(upright).get(view, f"EyeControls3D:{part}") == views.get(view, f"EyeControls3D:{part}")
    key = ("/world/ground/edge", "LineStrips3D:strips")
    assert Content(upright).static[key] == content.static[key]


def test_a_fallen_bicycle_is_drawn_to_its_end(content: Content, runs: dict[str, Trajectory]) -> None:
    for entity in (f"/world/{FELL}/rear_frame", f"/world/{FELL}/contact/rear"):
        component = "Points3D:positions" if "contact" in entity else "Transform3D:translation"
        time, _, _ = content.values(entity, component)
        assert len(time) == len(runs[FELL].time)
    time, _, lean = content.values(f"/plots/lean/tested/{FELL}", "Scalars:scalars")
    np.testing.assert_array_equal(lean[:, 0], runs[FELL].q[:, LEAN])


def test_no_legend_covers_a_curve(views: Views) -> None:
    plots = [name for name in views.paths if views.properties(name)["ViewBlueprint:class_identifier"] == ["TimeSeries"]]
    assert len(plots) > 15
    assert {views.get(name, "PlotLegend:visible") for name in plots} == {False}
