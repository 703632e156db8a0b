"""The ride in space: the ground, the bicycles with their contacts and paths, and the names."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import rerun as rr

from ...engines.engine import Trajectory
from ...reference.bicycle import BODIES
from ...reference.kinematics import WHEELS, YAW
from ...reference.surface import Surface, unit_normals
from ..drawing import LINE_LIFT, Colour, GroundMesh, Mesh
from .blueprint import NEWTONS_PER_METRE, world
from .clock import Clock
from .legend import hang_labels
from .overview import Names

TRAIL_PIECES = 400  # the viewer queries a trail piece by piece: with more, playback stutters
GROUND_LOW, GROUND_HIGH = np.array([28.0, 35.0, 44.0]), np.array([96.0, 112.0, 126.0])
LINE_COLOUR, EDGE_COLOUR = (112, 128, 140), (165, 182, 194)
WALL_COLOUR = (44, 52, 62)
INFLATION = 0.0015  # each bicycle is drawn larger than the previous one by this much [m]
TRAIL_WIDTHS = (3.6, 2.2, 1.2, 0.8)  # trails on top of one another appear as stripes [points on the screen]
ARROW_RADIUS = 0.009
LEADER_WIDTH = 1.0  # [points on the screen]


def brighten(colour: Colour) -> Colour:
    """Mix a colour half with white, so that it differs from a bicycle of the same colour."""
    red, green, blue = ((c + 255) // 2 for c in colour)
    return red, green, blue


def log_ground(stream: rr.RecordingStream, ground: GroundMesh) -> None:
    """Log the ground with its lines."""
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


def send_bicycle(
    stream: rr.RecordingStream,
    name: str,
    run: Trajectory,
    meshes: Mapping[str, Mesh],
    surface: Surface,
    colour: Colour,
    place: int,
    clock: Clock,
) -> None:
    """Send everything of an engine's bicycle: bodies, chase frame, contacts, paths and forces.

    Parameters
    ----------
    stream : rr.RecordingStream
    name : str
        Engine.
    run : Trajectory
        Samples to send.
    meshes : mapping
        By body.
    surface : Surface
    colour : tuple of int
    place : int
        Number of bicycles drawn before: each is larger than these, and its paths are narrower.
    clock : Clock
    """
    root = world(name)
    for body in BODIES:
        _log_mesh(stream, f"{root}/{body}/shape", meshes[body].inflated(place * INFLATION), colour)
    _send_bodies(stream, root, run, clock)
    _send_contacts(stream, root, run, surface, colour, place, clock)


def _log_mesh(stream: rr.RecordingStream, path: str, mesh: Mesh, colour: Colour) -> None:
    shape = rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        triangle_indices=mesh.triangles,
        vertex_colors=mesh.coloured(colour),
    )
    stream.log(path, shape, static=True)


def _send_bodies(stream: rr.RecordingStream, root: str, run: Trajectory, clock: Clock) -> None:
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


def _send_trail(stream: rr.RecordingStream, path: str, points: np.ndarray, run: Trajectory, clock: Clock) -> None:
    """Send a line in pieces, each at the time of its last point, so that the trail grows with the cursor."""
    stride = max(1, len(points) // TRAIL_PIECES)
    ends = np.arange(stride, len(points), stride)
    if len(ends) == 0:
        return
    pieces = [points[end - stride : end + 1] for end in ends]
    stream.send_columns(path, clock.columns(run.time[ends]), rr.LineStrips3D.columns(strips=pieces))


def _send_contacts(
    stream: rr.RecordingStream, root: str, run: Trajectory, surface: Surface, colour: Colour, place: int, clock: Clock
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


def send_names(
    stream: rr.RecordingStream,
    names: Names,
    trajectories: Mapping[str, Trajectory],
    paint: Mapping[str, Colour],
    clock: Clock,
) -> None:
    """Send the engines' names beside their bicycles, with lines to them; from its end on, a name says when it was."""
    frame_index, index = clock.columns(names.frame_time), clock.columns(names.time)
    for name, ends in names.points.items():
        root = f"{world(name)}/here"
        position, quaternion = names.frames[name]
        stream.send_columns(root, frame_index, rr.Transform3D.columns(translation=position, quaternion=quaternion))
        label = rr.Points3D.from_fields(radii=0.0, colors=paint[name], show_labels=True)
        stream.log(f"{root}/name", label, static=True)
        over = names.time >= trajectories[name].time[-1]
        text = [names.texts[name][int(ended)] for ended in over]
        stream.send_columns(f"{root}/name", index, rr.Points3D.columns(positions=ends[:, 0], labels=text))
        line = rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(LEADER_WIDTH / 2), colors=paint[name])
        stream.log(f"{root}/leader", line, static=True)
        strips = np.stack([np.zeros_like(ends[:, 1]), ends[:, 1]], axis=1)
        stream.send_columns(f"{root}/leader", index, rr.LineStrips3D.columns(strips=list(strips)))


def log_legend(
    stream: rr.RecordingStream, texts: Mapping[str, str], middles: np.ndarray, paint: Mapping[str, Colour]
) -> None:
    """Log the engines' names in their colours at places (n, 2) of a view of its own."""
    for (name, text), hook in zip(texts.items(), hang_labels(middles), strict=True):
        label = rr.Points2D([hook], labels=[text], radii=0.0, colors=paint[name], show_labels=True)
        stream.log(rr.new_entity_path(["legend", name]), label, static=True)
