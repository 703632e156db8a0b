"""Cameras of the views in space, with the viewer's own perspective."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

# The viewer's field of view over a view's height; a recording cannot choose it.
FIELD_OF_VIEW = np.radians(55.0)
# Width and height of the smallest view for which cameras and labels are laid out [points]: that of a laptop's screen.
# In a larger view everything but letters is larger, so what is apart stays apart.
VIEW = (760.0, 600.0)
_MARGIN = np.array([40.0, 40.0])  # free on every side of what a camera is to show [points]
_CENTRINGS = 30  # each brings the picture's middle to that of the view up to a share that falls with the distance


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera in the frame of its view's origin.

    Attributes
    ----------
    position, target : ndarray, shape (3,)
        Place of the eye and the place that it looks at [m].
    """

    position: np.ndarray
    target: np.ndarray

    @cached_property
    def axes(self) -> np.ndarray:
        """Unit vectors to the right, upwards and forwards in the picture, as rows, shape (3, 3)."""
        forward = (self.target - self.position) / np.linalg.norm(self.target - self.position)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(right, forward), forward])

    @property
    def scale(self) -> float:
        """Size in the smallest view of one metre at a distance of one metre [points m]."""
        return VIEW[1] / 2 / float(np.tan(FIELD_OF_VIEW / 2))

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where points (..., 3) are in the picture, (..., 2) from its middle [points], and depths (...) [m]."""
        seen = (points - self.position) @ self.axes.T
        depth = seen[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(depth[..., None] > 0, self.scale * seen[..., :2] / depth[..., None], np.nan), depth

    def place(self, where: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Return the points (..., 3) that are seen at places (..., 2) of the picture [points], at depths (...) [m]."""
        across = where * (depth / self.scale)[..., None]
        return self.position + across @ self.axes[:2] + depth[..., None] * self.axes[2]


def fit_camera(points: np.ndarray, azimuth: float, elevation: float, above: float = 0.0) -> Camera:
    """Make the nearest camera of a direction that has points (n, 3) in its picture.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        What is to be seen [m].
    azimuth, elevation : float
        Direction in which the camera is, from the points [rad].
    above : float
        Height that is to be free above the points besides the margin [points].
    """
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    # How far from the middle of the picture points may be: to the right and upwards, to the left and downwards.
    room = np.array(VIEW) / 2 - _MARGIN
    limits = np.array([room - [0.0, above], room])
    target = 0.5 * (points.min(axis=0) + points.max(axis=0))
    camera = Camera(target + towards, target)
    for _ in range(_CENTRINGS):
        camera = Camera(target + _find_distance(points - target, camera, limits) * towards, target)
        seen, _ = camera.project(points)
        free = np.array([limits[0] - seen.max(axis=0), limits[1] + seen.min(axis=0)])
        off = 0.5 * (free[1] - free[0])
        if np.abs(off).max() < 0.5:
            break
        target = target + (off * np.linalg.norm(camera.position - target) / camera.scale) @ camera.axes[:2]
    return camera


def _find_distance(points: np.ndarray, camera: Camera, limits: np.ndarray) -> float:
    """Return the distance from the target at which points relative to it are within limits (2, 2) [points].

    A point at a distance c across the line of sight and b behind the target is within a limit r if
    scale c <= r (distance + b).
    """
    across, behind = points @ camera.axes[:2].T, points @ camera.axes[2]
    needed = camera.scale * np.stack([across, -across]) / limits[:, None] - behind[:, None]
    return max(float(needed.max()), 1e-3)
