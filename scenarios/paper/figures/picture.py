"""A picture of bodies and lines in space in parallel projection, with hidden parts removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import raster

_FINER = 2  # drawn pixels per shown pixel each way, for smooth edges
_AMBIENT, _DIFFUSE = 0.45, 0.62


@dataclass(frozen=True)
class View:
    """A parallel projection.

    Attributes
    ----------
    azimuth, elevation : float
        Direction of the eye [rad].
    centre : ndarray, shape (3,)
        Point in the middle of the picture [m].
    width, height : float
        Extent of the picture [m].
    """

    azimuth: float
    elevation: float
    centre: np.ndarray
    width: float
    height: float

    @property
    def axes(self) -> np.ndarray:
        """Unit vectors to the right, upwards and towards the eye, as rows, shape (3, 3)."""
        ca, sa = np.cos(self.azimuth), np.sin(self.azimuth)
        ce, se = np.cos(self.elevation), np.sin(self.elevation)
        return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return the position in the picture, right and up from its middle, and the depth, shape (n, 3) [m]."""
        return (points - self.centre) @ self.axes.T * [1.0, 1.0, -1.0]


class Picture:
    """Pixels with a depth buffer, transparent where nothing is drawn."""

    def __init__(self, view: View, columns: int) -> None:
        self._view = view
        self._scale = _FINER * columns / view.width
        rows = _FINER * round(columns * view.height / view.width)
        self._depth = np.full((rows, _FINER * columns), np.inf)
        self._image = np.zeros((rows, _FINER * columns, 4), np.float32)
        light = np.array([-0.45, 0.75, 0.85]) @ view.axes  # from the eye's upper left
        self._light = light / np.linalg.norm(light)

    def _screen(self, points: np.ndarray) -> np.ndarray:
        right, up, depth = self._view.project(points).T
        rows, columns = self._depth.shape
        return np.column_stack([columns / 2 + self._scale * right, rows / 2 - self._scale * up, depth])

    def body(
        self, points: np.ndarray, normals: np.ndarray, triangles: np.ndarray, colours: np.ndarray, cull: bool = False
    ) -> None:
        """Draw a mesh: points (n, 3) [m], unit normals (n, 3), triangles (m, 3), colours (n, 3) 0 to 1."""
        shade = _AMBIENT + _DIFFUSE * np.clip(normals @ self._light, 0, 1)
        lit = np.clip(colours * shade[:, None], 0, 1)
        raster.fill(self._screen(points), triangles.astype(np.int64), lit, cull, self._depth, self._image)

    def line(self, points: np.ndarray, width: float, colour: np.ndarray, lift: float = 0.02) -> None:
        """Draw a line through points (n, 3) [m], its width in pixels, in front of all less than ``lift`` [m] nearer."""
        colour = np.asarray(colour, float)
        raster.stroke(self._screen(points), _FINER * width, lift, colour, self._depth, self._image)

    def pixels(self) -> np.ndarray:
        """Return red, green, blue and opacity, 0 to 1, shape (rows, columns, 4)."""
        steps = range(_FINER)
        samples = [self._image[i::_FINER, j::_FINER] for i in steps for j in steps]
        cover = sum(sample[..., 3:] for sample in samples) / len(samples)
        # Colours of empty samples are zero, so the sum weights each by its coverage.
        colour = sum(sample[..., :3] for sample in samples) / len(samples) / np.maximum(cover, 1e-6)
        return np.concatenate([colour, cover], axis=2)
