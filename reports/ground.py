"""The ground as a picture: a mesh of the surface around the ride, and the lines drawn on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reference.surface import Surface, evaluate

# Light for the hill shading comes from here: seen from the opening view, from the upper left, where the
# eye expects it. Then a hollow is dark at the upper left and bright at the lower right.
LIGHT = np.array([-0.85, 0.53])

WALL = 0.05  # height of the wall below the lowest point, as a share of the ground's radius
STRIP_MARGIN = 4.0  # ground on either side of a ride that is not around the axis [m]
LINE_LIFT = 0.003  # lines lie this far above the mesh, or they would sink into its facets [m]


@dataclass(frozen=True)
class Ground:
    """Part of a surface, ready to draw.

    Attributes
    ----------
    vertices, normals : ndarray, shape (n, 3)
        Points of the surface [m] and its upward unit normals.
    triangles : ndarray, shape (m, 3)
        Vertex indices, anticlockwise seen from above.
    brightness : ndarray, shape (n,)
        0 to 1: darker in the hollows and on slopes that face away from the light.
    lines : list of ndarray, shape (k, 3)
        Grid lines [m]: rings and spokes of a disc, a square grid of a strip.
    edge : ndarray, shape (k, 3)
        The outline [m], closed.
    wall, wall_triangles : ndarray, shape (2 k, 3) and (m, 3)
        A wall below the outline, so that the ground is seen as a body with a hollow in it.
    radius : float
        Half the smaller extent of what is drawn, seen from above [m].
    disc : bool
        True for a disc about the z axis, False for a strip.
    """

    vertices: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    brightness: np.ndarray
    lines: list[np.ndarray]
    edge: np.ndarray
    wall: np.ndarray
    wall_triangles: np.ndarray
    radius: float
    disc: bool


def unit_normals(surface: Surface, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Upward unit normals of a surface, shape (..., 3), at coordinates of any common shape [m]."""
    values = evaluate(surface, x, y)
    normal = np.stack([-values[..., 1], -values[..., 2], np.ones_like(values[..., 0])], axis=-1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def lifted(surface: Surface, x: np.ndarray, y: np.ndarray, lift: float = 0.0) -> np.ndarray:
    """Points of a surface, moved along its normal by ``lift`` [m]; shape (..., 3)."""
    point = np.stack([x, y, evaluate(surface, x, y)[..., 0]], axis=-1)
    return point + lift * unit_normals(surface, x, y)


def _shading(heights: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Brightness 0 to 1: half by the height, half by the slope towards the light, relative to the largest.

    A map's device: a bowl of 1 part in 50 looks flat under any even light, and stretching its heights
    would lift the ground off the wheels.
    """
    slope = normals[:, :2] / normals[:, 2:]
    steepest = np.linalg.norm(slope, axis=1).max()
    if steepest == 0:
        return np.full(len(heights), 0.5)
    return 0.25 + 0.25 * (slope @ LIGHT) / steepest + 0.5 * (heights - heights.min()) / np.ptp(heights)


def _wall(edge: np.ndarray, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """Upright wall below a closed outline down to a level [m]: vertices (2k, 3) and triangles."""
    foot = edge.copy()
    foot[:, 2] = depth
    return np.concatenate([foot, edge]), _quads(2, len(edge), closed=False)


def _spacing(extent: float, lines: int) -> float:
    """The round number 1, 2 or 5 times a power of ten that gives at most ``lines`` lines [m]."""
    power = 10.0 ** np.floor(np.log10(extent / lines))
    return float(next(step * power for step in (1, 2, 5, 10) if step * power * lines >= extent * (1 - 1e-12)))


def _quads(rows: int, columns: int, closed: bool) -> np.ndarray:
    """Triangles of a grid of vertices, the columns closed to a ring or not."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns if closed else columns - 1), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = a + columns, b + columns
    return np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, c, d), (a, d, b))])


def disc(surface: Surface, radius: float) -> Ground:
    """A disc about the z axis out to a radius [m]."""
    around = np.arange(180) * 2 * np.pi / 180
    ring = np.append(around, 0.0)
    out = np.linspace(0, radius, 81)
    r, a = np.meshgrid(out, around, indexing="ij")
    x, y = r * np.cos(a), r * np.sin(a)
    spacing = _spacing(radius, 10)
    rings = np.arange(spacing, radius * (1 - 1e-9), spacing)
    lines = [lifted(surface, k * np.cos(ring), k * np.sin(ring), LINE_LIFT) for k in rings]
    spoke = np.linspace(spacing, radius, 60)
    lines += [lifted(surface, spoke * np.cos(b), spoke * np.sin(b), LINE_LIFT) for b in np.arange(24) * np.pi / 12]
    normals = unit_normals(surface, x, y).reshape(-1, 3)
    vertices = lifted(surface, x, y).reshape(-1, 3)
    edge = lifted(surface, radius * np.cos(ring), radius * np.sin(ring), LINE_LIFT)
    return Ground(
        vertices,
        normals,
        _quads(len(out), len(around), closed=True),
        _shading(vertices[:, 2], normals),
        lines,
        edge,
        *_wall(edge, float(vertices[:, 2].min()) - WALL * radius),
        radius,
        True,
    )


def strip(surface: Surface, path: np.ndarray, margin: float) -> Ground:
    """A rectangle along a path (n, 2), wider by a margin on every side [m]."""
    middle = path.mean(axis=0)
    along = np.linalg.svd(path - middle, full_matrices=False)[2][0] if len(path) > 1 else np.array([1.0, 0.0])
    along = along * np.sign(along @ (path[-1] - path[0]) or 1.0)
    axes = np.array([along, [-along[1], along[0]]])

    def place(u: np.ndarray, v: np.ndarray, lift: float = LINE_LIFT) -> np.ndarray:
        x, y = np.moveaxis(middle + u[..., None] * axes[0] + v[..., None] * axes[1], -1, 0)
        return lifted(surface, x, y, lift)

    reach = (path - middle) @ axes.T
    low, high = reach.min(axis=0) - margin, reach.max(axis=0) + margin
    size = high - low
    spacing = max(_spacing(float(size.min()), 20), _spacing(float(size.max()), 200))
    counts = np.clip(np.ceil(size / 0.25), 8, 400).astype(int)
    us, vs = (np.linspace(low[k], high[k], counts[k] + 1) for k in (0, 1))
    u, v = np.meshgrid(us, vs, indexing="ij")
    vertices = place(u, v, 0.0).reshape(-1, 3)
    normals = unit_normals(surface, vertices[:, 0], vertices[:, 1])
    lines = [place(np.full_like(vs, at), vs) for at in np.arange(low[0] + spacing, high[0], spacing)]
    lines += [place(us, np.full_like(us, at)) for at in np.arange(low[1] + spacing, high[1], spacing)]
    edge_u = np.concatenate([us, np.full_like(vs, high[0]), us[::-1], np.full_like(vs, low[0])])
    edge_v = np.concatenate([np.full_like(us, low[1]), vs, np.full_like(us, high[1]), vs[::-1]])
    edge = place(edge_u, edge_v)
    return Ground(
        vertices,
        normals,
        _quads(len(us), len(vs), closed=False),
        _shading(vertices[:, 2], normals),
        lines,
        edge,
        *_wall(edge, float(vertices[:, 2].min()) - WALL * margin),
        float(size.min()) / 2,
        False,
    )


def ground_of_ride(surface: Surface, path: np.ndarray) -> Ground:
    """The part of a surface that shows a ride with a margin.

    Parameters
    ----------
    surface : Surface
    path : ndarray, shape (n, 2)
        Where the bicycles ride [m].

    Returns
    -------
    Ground
        A disc about the z axis where the ride goes around it, else a strip around the path.
    """
    low, high = path.min(axis=0), path.max(axis=0)
    around_axis = np.all(low < 0) and np.all(high > 0) and np.ptp(path, axis=0).min() > 0.5 * np.ptp(path, axis=0).max()
    if around_axis:
        reach = float(np.linalg.norm(path, axis=1).max())
        return disc(surface, reach + max(1.0, 0.4 * reach))
    return strip(surface, path, STRIP_MARGIN)
