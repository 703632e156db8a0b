"""A recording read back: everything in it, with the numbers that went in."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import headless_viewer as viewer
import numpy as np
import pytest
import rerun as rr
from recorded import BICYCLE, BOWL, SAMPLES, Content, flat, ride
from rerun.chunk import RrdReader

from velodrome.engines.engine import REFERENCE, Problem, Trajectory
from velodrome.engines.registry import engine_names, load_engine
from velodrome.reference.bicycle import BODIES
from velodrome.reference.contact import observe
from velodrome.reference.families import find_motion
from velodrome.reference.kinematics import LEAN, STEER, WHEELS, YAW
from velodrome.reference.surface import Plane, evaluate
from velodrome.reports.drawing import bicycle_shape, ground
from velodrome.reports.drawing.palette import PALETTE, REFERENCE_COLOUR, assign_colours
from velodrome.reports.drawing.plots import CHANGE, ERROR, FORCES, PLOTS, SMALLEST_SIZE, log_size, to_nanoseconds
from velodrome.reports.recording import scene
from velodrome.reports.recording.blueprint import NEWTONS_PER_METRE
from velodrome.reports.recording.labels import HEIGHT, measure_labels
from velodrome.reports.recording.rerun_file import write_recording

VERDICT = "**All engines ride.**\n"
SUMMARY = "# A ride\n\n| engine | error |\n|---|---|\n| one | 1e-4 |\n"
RIDE = f"Ride (arrows: contact forces, {NEWTONS_PER_METRE:.0f} N a metre)"
SCENE = 1100  # columns of the window that show the ride
EPSILON = float(np.finfo(np.float32).eps)  # what space is stored in


@pytest.fixture(scope="module")
def runs() -> dict[str, Trajectory]:
    bare = dict.fromkeys(("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy"))
    return {
        REFERENCE: ride(REFERENCE),
        "one": ride("one", shift=1e-4),
        "short": ride("short", samples=61, shift=-0.05, ended="the bicycle fell"),
        "bare": replace(ride("bare", shift=0.01), **bare),
    }


@pytest.fixture(scope="module")
def rrd(runs: dict[str, Trajectory], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "comparison.rrd"
    write_recording(path, "Once around", BICYCLE, BOWL, runs, VERDICT, SUMMARY)
    return path


@pytest.fixture(scope="module")
def content(rrd: Path) -> Content:
    return Content(rrd)


def expect_float32(actual: np.ndarray, exact: np.ndarray) -> None:
    """Rounded once to float32: off by at most half a unit in the last place, eps / 2 of the value."""
    np.testing.assert_allclose(actual, exact, rtol=EPSILON / 2, atol=float(np.finfo(np.float32).tiny))


def test_one_recording_and_one_layout(rrd: Path) -> None:
    reader = RrdReader(str(rrd))
    assert [store.application_id for store in reader.recordings()] == ["velodrome"]
    assert len(reader.blueprints()) == 1


def test_times_are_exact_and_steps_count_samples(content: Content, runs: dict[str, Trajectory]) -> None:
    for name, run in runs.items():
        time, step, _ = content.values(f"/world/{name}/rear_frame", "Transform3D:translation")
        np.testing.assert_array_equal(time, np.arange(len(run.time)) * 10_000_000)
        np.testing.assert_array_equal(step, np.arange(len(run.time)))


def test_times_round_to_the_nearest_nanosecond() -> None:
    milliseconds = np.arange(20001)
    # Many of these lie just below the whole nanosecond as floats: cutting off would lose one.
    assert ((milliseconds * 1e-3 * 1e9).astype(np.int64) != milliseconds * 1_000_000).any()
    np.testing.assert_array_equal(to_nanoseconds(milliseconds * 1e-3), milliseconds * 1_000_000)


def test_bodies_stand_where_the_engine_put_them(content: Content, runs: dict[str, Trajectory]) -> None:
    for name, run in runs.items():
        for k, body in enumerate(BODIES):
            entity = f"/world/{name}/{body}"
            expect_float32(content.values(entity, "Transform3D:translation")[2], run.body_position[:, k])
            xyzw = content.values(entity, "Transform3D:quaternion")[2]
            expect_float32(xyzw[:, [3, 0, 1, 2]], run.body_quaternion[:, k])
            assert (f"{entity}/shape", "Mesh3D:vertex_positions") in content.static


def test_chase_frame_turns_with_the_yaw_only(content: Content, runs: dict[str, Trajectory]) -> None:
    for name, run in runs.items():
        entity = f"/world/{name}/chase"
        expect_float32(content.values(entity, "Transform3D:translation")[2], run.q[:, :3])
        _, _, zs, w = content.values(entity, "Transform3D:quaternion")[2].T
        # z and w are each right to eps / 2 of themselves: half the angle to |z w| eps, the angle to eps.
        angle = 2 * np.arctan2(zs.astype(float), w.astype(float))
        assert np.abs(np.exp(1j * (angle - run.q[:, YAW])) - 1).max() <= EPSILON


def test_contacts_forces_and_trails(content: Content, runs: dict[str, Trajectory]) -> None:
    for name in (REFERENCE, "one", "short"):
        run = runs[name]
        assert run.contact_point is not None
        assert run.contact_force is not None
        for k, wheel in enumerate(WHEELS):
            spot = content.values(f"/world/{name}/contact/{wheel}", "Points3D:positions")[2]
            expect_float32(spot, run.contact_point[:, k])
            arrows = f"/world/{name}/force/{wheel}"
            expect_float32(content.values(arrows, "Arrows3D:origins")[2], run.contact_point[:, k])
            vector = content.values(arrows, "Arrows3D:vectors")[2]
            expect_float32(vector, run.contact_force[:, k] / NEWTONS_PER_METRE)


def test_trail_grows_piece_by_piece_along_the_contact(content: Content, runs: dict[str, Trajectory]) -> None:
    run = runs["short"]
    assert run.contact_point is not None
    time, _, pieces = content.values("/world/short/trail/rear", "LineStrips3D:strips")
    np.testing.assert_array_equal(time, np.arange(1, len(run.time)) * 10_000_000)
    pieces = pieces.reshape(-1, 2, 3)
    np.testing.assert_array_equal(pieces[1:, 0], pieces[:-1, 1])
    layer = min(list(runs).index("short"), len(scene.TRAIL_WIDTHS) - 1)
    lift = np.linalg.norm(pieces[:, 1] - run.contact_point[1:, 0], axis=1)
    # Coordinates of up to 3 m, each rounded to float32.
    np.testing.assert_allclose(lift, (2 + layer) * ground.LINE_LIFT, atol=3 * EPSILON)


def test_curves_hold_the_numbers_in_double_precision(content: Content, runs: dict[str, Trajectory]) -> None:
    def curve(key: str, name: str) -> tuple[np.ndarray, np.ndarray]:
        path = f"/plots/{key}/{name}" if name == REFERENCE else f"/plots/{key}/tested/{name}"
        time, _, rows = content.values(path, "Scalars:scalars")
        return time, rows[:, 0]

    for name, run in runs.items():
        np.testing.assert_array_equal(curve("lean", name)[1], run.q[:, LEAN])
        np.testing.assert_array_equal(curve("steer", name)[1], run.q[:, STEER])
        np.testing.assert_array_equal(curve("rear_rate", name)[1], run.qd[:, -2])
        np.testing.assert_array_equal(curve("front_rate", name)[1], run.qd[:, -1])
        np.testing.assert_array_equal(curve("yaw_rate", name)[1], run.qd[:, YAW])
        np.testing.assert_array_equal(curve("radius", name)[1], np.hypot(run.q[:, 0], run.q[:, 1]))
    one, reference = runs["one"], runs[REFERENCE]
    error = np.linalg.norm(one.q[:, :3] - reference.q[:, :3], axis=1)
    time, values = curve("log_position_error", "one")
    assert error[0] == 0  # the same start: that sample has no logarithm and is left out
    np.testing.assert_array_equal(time, np.arange(1, SAMPLES) * 10_000_000)
    np.testing.assert_array_equal(values, np.log10(error[1:]))
    assert one.kinetic_energy is not None
    assert one.potential_energy is not None
    energy = one.kinetic_energy + one.potential_energy
    np.testing.assert_array_equal(curve("energy_change", "one")[1], (energy - energy[0]) / abs(energy[0]))
    assert one.slip is not None
    slip = log_size(np.linalg.norm(one.slip[:, 0], axis=-1))
    np.testing.assert_array_equal(curve("rear_log_slip", "one")[1], slip[np.isfinite(slip)])


def test_normal_force_is_the_part_along_the_normal(content: Content, runs: dict[str, Trajectory]) -> None:
    run = runs[REFERENCE]
    assert run.contact_force is not None
    normal = observe(BICYCLE, BOWL, run.q, run.qd).normal
    for k, plot in enumerate(FORCES[:2]):
        pushed = content.values(f"/plots/{plot.key}/{REFERENCE}", "Scalars:scalars")[2][:, 0]
        # Two ways to the same normal, each of a few operations on numbers of order one.
        np.testing.assert_allclose(
            pushed, (run.contact_force[:, k] * normal[:, k]).sum(-1), rtol=32 * np.finfo(float).eps
        )


def test_every_plot_has_every_engine_that_can_fill_it(content: Content, runs: dict[str, Trajectory]) -> None:
    found = content.entities()
    always = {"log_position_error", "radius", "lean", "steer", "lean_rate", "yaw_rate", "rear_rate", "front_rate"}
    for plot in PLOTS:
        if plot is CHANGE:
            continue  # of two runs only
        assert (f"/plots/{plot.key}/{REFERENCE}" in found) == (plot is not ERROR)
        for name in runs:
            if name != REFERENCE:
                assert (f"/plots/{plot.key}/tested/{name}" in found) == (name != "bare" or plot.key in always), plot.key


def test_what_an_engine_does_not_give_is_absent(content: Content, runs: dict[str, Trajectory]) -> None:
    found = {entity for entity in content.entities() if entity.startswith("/world/bare/")}
    assert not [entity for entity in found if "/contact/" in entity or "/force/" in entity]
    strips = content.values("/world/bare/trail/D", "LineStrips3D:strips")[2].reshape(-1, 2, 3)
    expect_float32(strips[:, 1], runs["bare"].q[1:, :3])


def test_an_early_end_is_said_from_its_time_on(content: Content) -> None:
    parts = content.timed["/world/short/here/name", "Points3D:labels"]
    said = {int(t): text for time, _, column in parts for t, text in zip(time, flat(column), strict=True)}
    assert {text for t, text in said.items() if t < 600_000_000} == {"short"}
    assert {text for t, text in said.items() if t >= 600_000_000} == {"short (ended)"}
    assert flat(content.static["/legend/short", "Points2D:labels"]).tolist() == ["short, ended at 0.60 s"]
    assert flat(content.static["/legend/one", "Points2D:labels"]).tolist() == ["one"]


def test_ground_lies_on_the_surface(content: Content) -> None:
    points = flat(content.static["/world/ground/surface", "Mesh3D:vertex_positions"]).reshape(-1, 3)
    # Rounding x and y moves the height by less than rounding the height itself does: the slope is < 1.
    np.testing.assert_allclose(points[:, 2], evaluate(BOWL, points[:, 0], points[:, 1])[:, 0], atol=EPSILON)
    assert np.linalg.norm(points[:, :2], axis=1).max() > 1.2 * np.hypot(0.98620375, 2.14769555)
    assert {"/world/ground/lines", "/world/ground/edge", "/world/ground/wall"} <= content.entities()


@pytest.mark.parametrize(("entity", "text"), [("/verdict", VERDICT), ("/summary", SUMMARY)])
def test_verdict_and_summary_are_there(content: Content, entity: str, text: str) -> None:
    assert flat(content.static[entity, "TextDocument:text"]).tolist() == [text]
    assert flat(content.static[entity, "TextDocument:media_type"]).tolist() == ["text/markdown"]


def test_a_failure_leaves_no_file_and_no_mode_behind(runs: dict[str, Trajectory], tmp_path: Path) -> None:
    path = tmp_path / "comparison.rrd"
    path.write_bytes(b"an older recording")
    broken = replace(runs["one"], body_position=runs["one"].body_position[:-1])
    before = rr.strict_mode()
    try:
        for mode in (False, True):
            rr.set_strict_mode(mode)
            with pytest.raises(ValueError, match="same length"):
                write_recording(path, "broken", BICYCLE, BOWL, {REFERENCE: runs[REFERENCE], "one": broken}, "", SUMMARY)
            assert rr.strict_mode() is mode
    finally:
        rr.set_strict_mode(before)
    assert [file.name for file in tmp_path.iterdir()] == ["comparison.rrd"]
    assert path.read_bytes() == b"an older recording"
    with pytest.raises(ValueError, match="at least one trajectory"):
        write_recording(path, "empty", BICYCLE, BOWL, {}, "", SUMMARY)


def test_nothing_is_printed(runs: dict[str, Trajectory], tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_recording(tmp_path / "quiet.rrd", "quiet", BICYCLE, BOWL, {"one": runs["one"]}, "", SUMMARY)
    assert capfd.readouterr() == ("", "")


def test_shape_touches_the_ground_where_the_wheels_do() -> None:
    meshes = bicycle_shape.body_meshes(BICYCLE)
    assert set(meshes) == set(BODIES)
    for body, radius in (("rear_wheel", BICYCLE.rear_wheel_radius), ("front_wheel", BICYCLE.front_wheel_radius)):
        reach = np.hypot(meshes[body].vertices[:, 0], meshes[body].vertices[:, 2])
        assert reach.max() == pytest.approx(radius, rel=1e-15)
    for mesh in meshes.values():
        # Outward normals on closed surfaces, anticlockwise triangles: both give the same, positive side.
        a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
        facing = np.einsum("ni,ni->n", np.cross(b - a, c - a), mesh.normals[mesh.triangles].sum(axis=1))
        assert facing.min() > -1e-12
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, rtol=1e-15)


def test_long_straight_ride_gets_a_strip_along_it() -> None:
    path = np.outer(np.linspace(0, 160, 500), [np.cos(0.3), np.sin(0.3)])
    shown = ground.make_ground(Plane(), path)
    assert not shown.disc
    assert shown.radius == pytest.approx(ground.STRIP_MARGIN)
    along = shown.vertices[:, :2] @ [np.cos(0.3), np.sin(0.3)]
    assert (along.min(), along.max()) == pytest.approx((-ground.STRIP_MARGIN, 160 + ground.STRIP_MARGIN))
    assert len(shown.lines) < 250


def test_a_standing_bicycle_has_ground_too() -> None:
    shown = ground.make_ground(Plane(), np.zeros((1, 2)))
    assert shown.radius == pytest.approx(ground.STRIP_MARGIN)
    assert np.isfinite(shown.vertices).all()


def test_engine_colours_last() -> None:
    names = [REFERENCE, "first", "second", "third"]
    assert assign_colours(names)[REFERENCE] == REFERENCE_COLOUR
    assert len(set(assign_colours(names).values())) == len(names)
    assert assign_colours(["second"])["second"] == assign_colours(["second", REFERENCE])["second"]
    many = assign_colours([f"engine {k}" for k in range(2 * len(PALETTE))])
    assert len(set(many.values())) == len(many)
    assert set([*many.values()][: len(PALETTE)]) == set(PALETTE)


def test_values_of_no_size_have_no_logarithm() -> None:
    sizes = log_size(np.array([0.0, SMALLEST_SIZE, -1e-3, np.nan, np.inf]))
    np.testing.assert_array_equal(sizes, [np.nan, np.nan, -3.0, np.nan, np.nan])


@pytest.mark.skipif(viewer.missing() is not None, reason=str(viewer.missing()))
def test_picture_shows_every_engine(rrd: Path, runs: dict[str, Trajectory]) -> None:
    with viewer.viewer(rrd) as client:
        views = {view.name for view in client.get_state().views}
        assert {"reference", "one", "short, ended at 0.60 s", "bare", "Engines", "Verdict", "Summary"} <= views
        assert "lean, + to the right [rad]" in views
        seen = viewer.pixels(client, 1.5)
        assert viewer.complaints(client) == []
    scene, plots = seen[:, :SCENE], seen[:, 1160:]
    for name, colour in assign_colours(runs).items():
        # Curves are drawn unlit in the very colour; tubes are shaded, so the ride shows darker tones of it.
        assert (np.abs(plots - colour).max(-1) < 24).sum() > 100, name
        assert alike(scene, colour).sum() > 400, name


def alike(pixels: np.ndarray, colour: tuple[int, int, int], least: float = 120.0) -> np.ndarray:
    """Whether pixels (..., 3) have the hue of a colour, and are not dark."""
    unit = np.asarray(colour) / np.linalg.norm(colour)
    length = np.linalg.norm(pixels, axis=-1)
    return (pixels @ unit > 0.995 * length) & (length > least)


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """Half a second on a circle of the level plane, where every installed engine can ride."""
    surface = Plane()
    _, motion = find_motion(BICYCLE, surface, 18.0, 2, (0.74, 2.84))
    problem = Problem(BICYCLE, surface, *motion.state(), np.arange(26) * 0.02)
    found = {}
    for name in engine_names():
        engine = load_engine(name)
        found[name] = engine.simulate(problem, engine.settings(), lambda _: None)
    path = tmp_path_factory.mktemp("real") / "comparison.rrd"
    write_recording(path, "A circle", BICYCLE, surface, found, "", SUMMARY, undisturbed=motion.state())
    return path, list(found)


@pytest.mark.slow
@pytest.mark.skipif(viewer.missing() is not None, reason=str(viewer.missing()))
def test_every_engine_of_a_real_run_can_be_seen_and_switched_off(real: tuple[Path, list[str]]) -> None:
    path, names = real
    assert len(names) >= 8
    with viewer.viewer(path) as client:
        viewer.open_tabs(client, ["One at a time"])
        for name in names:
            viewer.open_tabs(client, [name])
            shown = viewer.pixels(client, 0.3)
            viewer.switch(client, name, f"/world/{name}", visible=False)
            hidden = viewer.pixels(client, 0.3)
            # Where nothing changes stand the ground and the window; what is drawn of the engine covers the rest.
            changed = np.abs(shown - hidden).max(-1) > 24
            changed[:, SCENE:] = False
            # The ground's grey has the reference's hue, but is darker.
            least = 1.2 * float(np.linalg.norm(scene.GROUND_HIGH)) if name == REFERENCE else 120.0
            mine = [alike(window[changed], assign_colours(names)[name], least).sum() for window in (shown, hidden)]
            assert mine[0] > 2000, name
            # The reference's ghost may have it beneath.
            assert mine[1] < 0.05 * mine[0], name
        viewer.open_tabs(client, [RIDE, "Modes"])
        viewer.pixels(client, 0.3)
        assert {"castering", "capsize", "weave", "family"} <= {
            view.name.split()[0] for view in client.get_state().views
        }
        assert viewer.complaints(client) == []


@pytest.mark.slow
@pytest.mark.skipif(viewer.missing() is not None, reason=str(viewer.missing()))
def test_names_of_bicycles_at_one_place_cover_none_of_one_another(real: tuple[Path, list[str]]) -> None:
    """A name is where the picture changes when it is switched off."""
    path, names = real
    with viewer.viewer(path) as client:
        viewer.open_tabs(client, [RIDE])
        for name in names:
            viewer.switch(client, RIDE, f"/world/{name}/here/leader", visible=False)
        shown = viewer.pixels(client, 0.3)
        boxes = {}
        for name in names:
            viewer.switch(client, RIDE, f"/world/{name}/here/name", visible=False)
            changed = np.abs(shown - viewer.pixels(client, 0.3)).max(-1) > 24
            rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
            # Letters of some size, and no wider than they were taken for.
            assert 8 <= np.ptp(rows) <= HEIGHT, name
            assert 4 * len(name) <= np.ptp(columns) <= measure_labels([name])[0, 0], name
            boxes[name] = (columns[0], columns[-1], rows[0], rows[-1])
            viewer.switch(client, RIDE, f"/world/{name}/here/name", visible=True)
        for one, other in combinations(boxes.values(), 2):
            apart = max(one[0], other[0]) > min(one[1], other[1]) or max(one[2], other[2]) > min(one[3], other[3])
            assert apart, boxes
