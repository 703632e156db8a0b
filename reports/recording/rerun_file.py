"""Recording of a run for the rerun viewer: the ride in space, the curves, the summary."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import rerun as rr

from ...engines.engine import REFERENCE, Trajectory
from ...engines.files import write_whole
from ...reference.bicycle import BODIES, Bicycle
from ...reference.inputs import NO_INPUTS, Inputs
from ...reference.kinematics import WHEELS, YAW
from ...reference.surface import Surface, unit_normals
from ..drawing import (
    LINE_LIFT,
    PLOTS,
    Colour,
    GroundMesh,
    Mesh,
    Plot,
    PlotCurve,
    RideData,
    assign_colours,
    body_meshes,
    drawable_values,
    make_ground,
    mode_plots,
    to_nanoseconds,
)
from ..measure import find_modes
from .blueprint import NEWTONS_PER_METRE, blueprint, world

APPLICATION = "velodrome"
TRAIL_PIECES = 400  # the viewer queries a trail piece by piece: with more, playback stutters
GROUND_LOW, GROUND_HIGH = np.array([28.0, 35.0, 44.0]), np.array([96.0, 112.0, 126.0])
LINE_COLOUR, EDGE_COLOUR = (112, 128, 140), (165, 182, 194)
WALL_COLOUR = (44, 52, 62)
INFLATION = 0.0015  # each bicycle is drawn larger than the previous one by this much [m]
TRAIL_WIDTHS = (3.6, 2.2, 1.2, 0.8)  # trails on top of one another appear as stripes [points on the screen]
# The viewer draws curves in the order of their paths: the reference first and wide, the others on top of it.
REFERENCE_CURVE, CURVE = 3.4, 2.0
EXPECTED, EXPECTED_CURVE, EXPECTED_COLOUR = "linear law", 1.0, (150, 155, 165)
ARROW_RADIUS = 0.009


@contextmanager
def _strict_mode() -> Iterator[None]:
    """Make wrong calls of the recorder raise errors, and restore the process's setting."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


class _Clock:
    """Timelines of a recording: ``time``, and ``step``, the index of a sample among the samples of all engines."""

    def __init__(self, trajectories: Mapping[str, Trajectory]) -> None:
        self._all = np.unique(np.concatenate([to_nanoseconds(run.time) for run in trajectories.values()]))

    def columns(self, time: np.ndarray) -> list[rr.TimeColumn]:
        """Return the index columns of samples at times [s]."""
        exact = to_nanoseconds(time)
        return [
            rr.TimeColumn("time", duration=exact.astype("timedelta64[ns]")),
            rr.TimeColumn("step", sequence=np.searchsorted(self._all, exact)),
        ]


def brighten(colour: Colour) -> Colour:
    """Mix a colour half with white, so that it differs from a bicycle of the same colour."""
    red, green, blue = ((c + 255) // 2 for c in colour)
    return red, green, blue


def _log_mesh(stream: rr.RecordingStream, path: str, mesh: Mesh, colour: Colour) -> None:
    shape = rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        triangle_indices=mesh.triangles,
        vertex_colors=mesh.coloured(colour),
    )
    stream.log(path, shape, static=True)


def _log_ground(stream: rr.RecordingStream, ground: GroundMesh) -> None:
    shade = ground.brightness[:, None]
    mesh = rr.Mesh3D(
        vertex_positions=ground.vertices,
        vertex_normals=ground.normals,
        triangle_indices=ground.triangles,
        vertex_colors=np.round(GROUND_LOW + shade * (GROUND_HIGH - GROUND_LOW)).astype(np.uint8),
    )
    stream.log("/world/ground/surface", mesh, static=True)
    wall = rr.Mesh3D(vertex_positions=ground.wall, triangle_indices=ground.wall_triangles, albedo_factor=WALL_COLOUR)
    stream.log("/world/ground/wall", wall, static=True)
    thin, thick = rr.Radius.ui_points(0.5), rr.Radius.ui_points(1.5)
    stream.log("/world/ground/lines", rr.LineStrips3D(ground.lines, radii=thin, colors=LINE_COLOUR), static=True)
    stream.log("/world/ground/edge", rr.LineStrips3D([ground.edge], radii=thick, colors=EDGE_COLOUR), static=True)


def _send_bodies(stream: rr.RecordingStream, root: str, run: Trajectory, clock: _Clock) -> None:
    """Send the poses of the bodies and of the chase frame, which is at D and turns with the yaw only."""
    index = clock.columns(run.time)
    for k, body in enumerate(BODIES):
        pose = rr.Transform3D.columns(
            translation=run.body_position[:, k], quaternion=run.body_quaternion[:, k][:, [1, 2, 3, 0]]
        )
        stream.send_columns(f"{root}/{body}", index, pose)
    half, zero = 0.5 * run.q[:, YAW], np.zeros(len(run.time))
    heading = np.column_stack([zero, zero, np.sin(half), np.cos(half)])
    chase = rr.Transform3D.columns(translation=run.q[:, :3], quaternion=heading)
    stream.send_columns(f"{root}/chase", index, chase)


def _send_trail(stream: rr.RecordingStream, path: str, points: np.ndarray, run: Trajectory, clock: _Clock) -> None:
    """Send a line in pieces, each at the time of its last point, so that the trail grows with the cursor."""
    stride = max(1, len(points) // TRAIL_PIECES)
    ends = np.arange(stride, len(points), stride)
    if len(ends) == 0:
        return
    pieces = [points[end - stride : end + 1] for end in ends]
    stream.send_columns(path, clock.columns(run.time[ends]), rr.LineStrips3D.columns(strips=pieces))


def _send_contacts(
    stream: rr.RecordingStream, root: str, run: Trajectory, surface: Surface, colour: Colour, place: int, clock: _Clock
) -> None:
    """Send contact points, their trails and the contact forces, as far as the engine reports them."""
    layer = min(place, len(TRAIL_WIDTHS) - 1)
    width, lift = rr.Radius.ui_points(TRAIL_WIDTHS[layer] / 2), (2 + layer) * LINE_LIFT
    if run.contact_point is None:
        stream.log(f"{root}/trail/D", rr.LineStrips3D.from_fields(radii=width, colors=colour), static=True)
        _send_trail(stream, f"{root}/trail/D", run.q[:, :3], run, clock)
        return
    index = clock.columns(run.time)
    for k, wheel in enumerate(WHEELS):
        point = run.contact_point[:, k]
        spot = rr.Points3D.from_fields(radii=rr.Radius.ui_points(3.5), colors=colour)
        stream.log(f"{root}/contact/{wheel}", spot, static=True)
        stream.send_columns(f"{root}/contact/{wheel}", index, rr.Points3D.columns(positions=point))
        above = point + lift * unit_normals(surface, point[:, 0], point[:, 1])
        stream.log(f"{root}/trail/{wheel}", rr.LineStrips3D.from_fields(radii=width, colors=colour), static=True)
        _send_trail(stream, f"{root}/trail/{wheel}", above, run, clock)
        if run.contact_force is not None:
            vector = run.contact_force[:, k] / NEWTONS_PER_METRE
            arrow = rr.Arrows3D.from_fields(radii=ARROW_RADIUS, colors=brighten(colour))
            stream.log(f"{root}/force/{wheel}", arrow, static=True)
            stream.send_columns(f"{root}/force/{wheel}", index, rr.Arrows3D.columns(origins=point, vectors=vector))


def _send_name(
    stream: rr.RecordingStream, root: str, name: str, place: int, run: Trajectory, colour: Colour, clock: _Clock
) -> None:
    """Send the engine's name above its bicycle and, if it ended early, the reason."""
    at = [[0.0, 0.0, 0.95 + 0.2 * place]]
    label = rr.Points3D(at, labels=[name], radii=0.0, colors=colour, show_labels=True)
    stream.log(f"{root}/chase/name", label, static=True)
    if run.ended is not None:
        spot = rr.Points3D.from_fields(radii=rr.Radius.ui_points(5), colors=colour, show_labels=True)
        stream.log(f"{root}/ended", spot, static=True)
        text = f"{name} ended at {run.time[-1]:.2f} s: {run.ended}"
        columns = rr.Points3D.columns(positions=run.q[-1:, :3], labels=[text])
        stream.send_columns(f"{root}/ended", clock.columns(run.time[-1:]), columns)


def _finite_curves(ride: RideData, plots: Iterable[Plot]) -> dict[str, dict[str, PlotCurve]]:
    """Return the finite samples of every plot: (times, values) by key and engine, without empty ones."""
    curves: dict[str, dict[str, PlotCurve]] = {}
    for plot in plots:
        found: dict[str, PlotCurve] = {}
        for name, values in drawable_values(ride, plot).items():
            finite = np.isfinite(values)
            found[name] = ride.trajectories[name].time[finite], values[finite]
        law = plot.expected(ride)
        if law is not None and found:
            # Values below all measured ones would only extend the axis.
            visible = law[1] >= min(values.min() for _, values in found.values())
            found |= {EXPECTED: (law[0][visible], law[1][visible])} if visible.any() else {}
        if found:
            curves[plot.key] = found
    return curves


def write_recording(
    path: Path,
    title: str,
    bicycle: Bicycle,
    surface: Surface,
    trajectories: Mapping[str, Trajectory],
    summary: str,
    *,
    undisturbed: tuple[np.ndarray, np.ndarray] | None = None,
    before: Mapping[str, str] | None = None,
    paint: Mapping[str, Colour] | None = None,
    inputs: Inputs = NO_INPUTS,
) -> None:
    """Write a recording with its layout, completely or not at all.

    Parameters
    ----------
    path : Path
        File to write, ``.rrd``.
    title : str
        Name of the scenario.
    bicycle : Bicycle
    surface : Surface
    trajectories : mapping of str to Trajectory
        By engine name, in the order of display. Some may have ended early; optional fields that are
        None are omitted from the recording.
    summary : str
        Markdown for the summary tab.
    undisturbed : tuple of ndarray, shapes (9,), optional
        Coordinates and rates of the steady motion that the rides started from, on a surface of revolution or a
        plane; its modes get a tab.
    before : mapping of str to str, optional
        For two runs shown together: the name of the earlier trajectory that each trajectory is compared with.
    paint : mapping, optional
        Colours by name; those of `velodrome.reports.drawing.assign_colours` if not given.
    inputs : Inputs
        Inputs of all rides.

    Raises
    ------
    ValueError
        If there is no trajectory, one has no sample, or the motion cannot be linearised.
    """
    if not trajectories or any(len(run.time) == 0 for run in trajectories.values()):
        raise ValueError("a recording needs at least one trajectory, and each at least one sample")
    modes = None if undisturbed is None else find_modes(bicycle, surface, *undisturbed, inputs)
    ride = RideData(surface, trajectories, before or {}, modes, inputs)
    with write_whole(path) as partial, _strict_mode():
        _write_stream(partial, title, bicycle, ride, summary, paint or assign_colours(trajectories))


def _write_stream(
    path: Path, title: str, bicycle: Bicycle, ride: RideData, summary: str, paint: Mapping[str, Colour]
) -> None:
    """Write the whole recording to a path."""
    own = mode_plots(ride.modes)
    curves = _finite_curves(ride, (*PLOTS, *own))
    places = np.concatenate([run.q[:, :2] for run in ride.trajectories.values()])
    ground = make_ground(ride.surface, places[np.isfinite(places).all(axis=1)])
    layout = blueprint(
        tuple(ride.trajectories), ground, {key: {e: v for e, (_, v) in by.items()} for key, by in curves.items()}, own
    )
    clock, meshes = _Clock(ride.trajectories), body_meshes(bicycle)
    stream = rr.RecordingStream(APPLICATION)
    try:
        stream.save(path, default_blueprint=layout)
        stream.send_recording_name(title)
        stream.log("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log("/summary", rr.TextDocument(summary, media_type=rr.MediaType.MARKDOWN), static=True)
        _log_ground(stream, ground)
        for place, (name, run) in enumerate(ride.trajectories.items()):
            root = world(name)
            for body in BODIES:
                _log_mesh(stream, f"{root}/{body}/shape", meshes[body].inflated(place * INFLATION), paint[name])
            _send_bodies(stream, root, run, clock)
            _send_contacts(stream, root, run, ride.surface, paint[name], place, clock)
            _send_name(stream, root, name, place, run, paint[name], clock)
        for key, by_engine in curves.items():
            for name, curve in by_engine.items():
                _send_curve(stream, key, name, curve, paint, clock)
    finally:
        stream.disconnect()


def _send_curve(
    stream: rr.RecordingStream, key: str, name: str, curve: PlotCurve, paint: Mapping[str, Colour], clock: _Clock
) -> None:
    """Send one engine's curve of a plot, or the curve that theory predicts."""
    if name == EXPECTED:
        entity, colour, width = [key, "expected"], EXPECTED_COLOUR, EXPECTED_CURVE
    elif name == REFERENCE:
        entity, colour, width = [key, name], paint[name], REFERENCE_CURVE
    else:
        entity, colour, width = [key, "tested", name], paint[name], CURVE
    path = rr.new_entity_path(["plots", *entity])
    stream.log(path, rr.SeriesLines(names=name, colors=colour, widths=width), static=True)
    stream.send_columns(path, clock.columns(curve[0]), rr.Scalars.columns(scalars=curve[1]))
