"""The view of all bicycles of a ride: which camera shows them, and where their names are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.kinematics import YAW
from ..drawing import GroundMesh, to_nanoseconds
from .camera import Camera, fit_camera
from .labels import HANG, HEIGHT, measure_labels, place_names

_AZIMUTH, _ELEVATION = np.radians(-105.5), np.radians(38.0)  # of the camera, from a ride around the axis
_STEEPEST_ELEVATION = np.radians(80.0)
_OVER_THE_RIM = np.radians(8.0)
_SHORTEST_BICYCLE = 60.0  # length in the picture [points] below which bicycles cannot be told apart
_FREE_ABOVE = 90.0  # for names above the farthest bicycle [points]
_HALF_HEIGHT = 0.65  # of a bicycle, from D [m]
_USUAL_VIEW = 1.4  # size of a view, of the smallest one
_LABEL_INTERVAL = 0.05  # a name is beside its bicycle at all times; where, is decided this often [s]
_FOLLOWING = Camera(np.array([-2.4, -4.0, 2.2]), np.array([0.4, 0.0, 0.2]))


@dataclass(frozen=True, eq=False)
class Overview:
    """The camera of the view of a ride.

    Attributes
    ----------
    camera : Camera
    followed : str or None
        Engine whose bicycle the camera follows, turning with its yaw; None if the camera is at rest.
    """

    camera: Camera
    followed: str | None


def find_staying(trajectories: Mapping[str, Trajectory]) -> list[str]:
    """List the engines that ride to the end; if none does, those that ride the longest.

    Camera, ground and axes follow these: a bicycle that has fallen may be anywhere.
    """
    whole = [name for name, run in trajectories.items() if run.ended is None]
    last = max(float(run.time[-1]) for run in trajectories.values())
    return whole or [name for name, run in trajectories.items() if float(run.time[-1]) == last]


def choose_overview(trajectories: Mapping[str, Trajectory], bicycle: Bicycle, ground: GroundMesh) -> Overview:
    """Choose a camera at rest that sees the whole ride, or one that follows it if bicycles would be too small.

    Parameters
    ----------
    trajectories : mapping
        By engine; only those of `find_staying` are considered.
    bicycle : Bicycle
    ground : GroundMesh
        As drawn.
    """
    staying = find_staying(trajectories)
    if ground.disc:
        camera = _show_whole_ride({name: trajectories[name] for name in staying}, bicycle, ground)
        distance = float(np.linalg.norm(camera.position - camera.target))
        if camera.scale * _measure_length(bicycle) / distance >= _SHORTEST_BICYCLE:
            return Overview(camera, None)
    return Overview(mirror_camera(_FOLLOWING, trajectories[staying[0]]), staying[0])


def _measure_length(bicycle: Bicycle) -> float:
    return bicycle.wheelbase + bicycle.rear_wheel_radius + bicycle.front_wheel_radius


def _show_whole_ride(rides: Mapping[str, Trajectory], bicycle: Bicycle, ground: GroundMesh) -> Camera:
    chosen = [run.body_position[:: max(1, len(run.time) // 200)].reshape(-1, 3) for run in rides.values()]
    centres = np.concatenate(chosen)
    centres = centres[np.isfinite(centres).all(axis=1)]
    # Everything of a bicycle is within a wheel's radius of a body's centre of mass, or nearly.
    half = max(bicycle.rear_wheel_radius, bicycle.front_wheel_radius)
    corners = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    points = (centres[:, None] + corners).reshape(-1, 3)
    outer, rim = float(np.hypot(centres[:, 0], centres[:, 1]).max()), float(ground.edge[:, 2].max())
    # The near rim must not hide the ride's nearest point, which is lower and further in.
    over = np.arctan2(rim - float(centres[:, 2].min()), max(ground.radius - outer, 1e-9)) + _OVER_THE_RIM
    return fit_camera(points, _AZIMUTH, float(np.clip(over, _ELEVATION, _STEEPEST_ELEVATION)), _FREE_ABOVE)


def mirror_camera(camera: Camera, run: Trajectory) -> Camera:
    """Return a camera made for a bicycle that turns to the right, or mirrored for one that turns to the left.

    It is on the inner side of the curve, where the ground of a bowl is lower.
    """
    if run.q[-1, YAW] <= run.q[0, YAW]:
        return camera
    mirror = np.array([1.0, -1.0, 1.0])
    return Camera(camera.position * mirror, camera.target * mirror)


@dataclass(frozen=True, eq=False)
class Names:
    """The engines' names in the overview.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Times of the places [s].
    texts : dict
        By engine, the text while it rides, and from its end on.
    frames : dict
        By engine, the position of D [m], shape (m, 3), and the quaternion (x, y, z, w), shape (m, 4), of a frame at D
        with the axes of the camera's frame, at the ``frame_time``: there the places are.
    frame_time : ndarray, shape (m,)
        [s]
    points : dict
        By engine, the points that the viewer hangs the names on, and the ends of the lines to them, in these frames,
        shapes (n, 2, 3) [m].
    """

    time: np.ndarray
    texts: dict[str, tuple[str, str]]
    frames: dict[str, tuple[np.ndarray, np.ndarray]]
    frame_time: np.ndarray
    points: dict[str, np.ndarray]


def name_bicycles(trajectories: Mapping[str, Trajectory], overview: Overview, time: np.ndarray) -> Names:
    """Find places for the engines' names in the overview, beside the bicycles and apart from one another.

    Those that ride to the end choose first.

    Parameters
    ----------
    trajectories : mapping
        By engine.
    overview : Overview
    time : ndarray, shape (m,)
        Times of all samples [s], rising.
    """
    staying = find_staying(trajectories)
    order = [*staying, *(name for name in trajectories if name not in staying)]
    texts = {name: (name, name if trajectories[name].ended is None else f"{name} (ended)") for name in order}
    positions = {name: _hold_last(trajectories[name], time) for name in order}
    yaw = np.zeros(len(time)) if overview.followed is None else _hold_yaw(trajectories[overview.followed], time)
    quaternion = np.column_stack([0 * yaw, 0 * yaw, np.sin(yaw / 2), np.cos(yaw / 2)])
    interval = float(time[-1] - time[0]) / max(1, len(time) - 1)
    chosen = np.arange(0, len(time), max(1, int(_LABEL_INTERVAL / interval))) if interval > 0 else np.array([0])
    turn = _turn_back(yaw[chosen])
    centre = np.zeros(3) if overview.followed is None else positions[overview.followed][chosen]
    seen = np.stack([np.einsum("nij,nj->ni", turn, positions[name][chosen] - centre) for name in order], axis=1)
    camera = overview.camera
    anchors, depth = camera.project(seen)
    reach = np.nan_to_num(camera.scale * _HALF_HEIGHT / np.where(depth > 0, depth, np.nan))
    placed = place_names(anchors, reach, measure_labels([max(texts[name], key=len) for name in order]))
    hook = placed + np.array([0.0, HEIGHT / 2 + HANG])
    # The line ends at the side of the label that faces the bicycle. A label hangs on its point by as many points in
    # every view: the line's end is right in one larger than the smallest, and within the label's frame in that one.
    above = placed[..., 1:] > anchors[..., 1:]
    foot = hook - np.where(above, (HANG + HEIGHT) / _USUAL_VIEW, HANG / _USUAL_VIEW) * [0.0, 1.0]
    # The name of a bicycle behind the camera, which is not seen, stays with it.
    ends = np.nan_to_num(np.stack([camera.place(where, depth) - seen for where in (hook, foot)], axis=2))
    return Names(
        time=time[chosen],
        texts=texts,
        frames={name: (positions[name], quaternion) for name in order},
        frame_time=time,
        points={name: ends[:, k] for k, name in enumerate(order)},
    )


def describe_end(name: str, run: Trajectory) -> str:
    """Return an engine's name, with the time of its end if it did not ride to the end."""
    return name if run.ended is None else f"{name}, ended at {run.time[-1]:.2f} s"


def _hold_last(run: Trajectory, time: np.ndarray) -> np.ndarray:
    """Return the positions of D at times: those of the last sample before each [m]."""
    return run.q[_find_last(run, time), :3]


def _hold_yaw(run: Trajectory, time: np.ndarray) -> np.ndarray:
    return run.q[_find_last(run, time), YAW]


def _find_last(run: Trajectory, time: np.ndarray) -> np.ndarray:
    after = np.searchsorted(to_nanoseconds(run.time), to_nanoseconds(time), side="right")
    return np.clip(after - 1, 0, len(run.time) - 1)


def _turn_back(yaw: np.ndarray) -> np.ndarray:
    """Return the rotations from inertial axes to axes turned by a yaw, shape (n, 3, 3)."""
    turn = np.zeros((len(yaw), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(yaw)
    turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = np.sin(yaw), -np.sin(yaw), 1.0
    return turn
