"""A picture of the ground: a mesh of the surface around the ride, and the lines drawn on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...reference.surface import Surface, evaluate, unit_normals

# Direction of the light for the hill shading: in the opening view it comes from the upper left, where viewers expect
# it. A hollow is then dark at the upper left and bright at the lower right.
LIGHT = np.array([-0.85, 0.53])

WALL = 0.05  # height of the wall below the lowest point, relative to the ground's radius
STRIP_MARGIN = 4.0  # ground on either side of a ride that does not go around the axis [m]
LINE_LIFT = 0.003  # height of lines above the mesh, without which they would sink into its facets [m]
# Ground may end where it is vertical, as a sphere's does at its equator: it is drawn up to this slope, or
# to twice the steepest slope under the ride.
STEEPEST = 5.0
_HALVINGS = 40  # from any size on the ground to far below a picture's resolution


@dataclass(frozen=True)
class GroundMesh:
    """Part of a surface, prepared for drawing.

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
        Closed outline [m].
    wall, wall_triangles : ndarray, shape (2 k, 3) and (m, 3)
        A wall below the outline, so that the ground looks like a body with a hollow in it.
    radius : float
        Half the smaller extent of the drawn part, seen from above [m].
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


def lift_points(surface: Surface, x: np.ndarray, y: np.ndarray, lift: float = 0.0) -> np.ndarray:
    """Return points of a surface, moved along its normal by ``lift`` [m]; shape (..., 3)."""
    point = np.stack([x, y, evaluate(surface, x, y)[..., 0]], axis=-1)
    return point + lift * unit_normals(surface, x, y)


def _is_drawable(surface: Surface, x: np.ndarray, y: np.ndarray, steepest: float) -> np.ndarray:
    """Return whether there is ground at points (...), no steeper than a slope."""
    values = evaluate(surface, x, y)
    # A comparison with nan is false.
    return np.isfinite(values).all(axis=-1) & (np.hypot(values[..., 1], values[..., 2]) <= steepest)


def _cut_at_edge(surface: Surface, start: np.ndarray, end: np.ndarray, steepest: float) -> np.ndarray:
    """Return the ends (..., 2) of lines from above that start on the ground, cut where the ground ends."""
    start, end = np.broadcast_arrays(start, end)

    def drawable(share: np.ndarray) -> np.ndarray:
        place = start + share[..., None] * (end - start)
        return _is_drawable(surface, place[..., 0], place[..., 1], steepest)

    low, high = np.zeros(end.shape[:-1]), np.ones(end.shape[:-1])
    whole = drawable(high)
    if not whole.all():
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            good = drawable(middle)
            low, high = np.where(good, middle, low), np.where(good, high, middle)
    return np.where(whole[..., None], end, start + low[..., None] * (end - start))


def _shade_hills(heights: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Compute brightness 0 to 1: half from the height, half from the slope towards the light, relative to the largest.

    This is a technique of maps: a bowl of 1 part in 50 looks flat under any even light, and stretching its heights
    would lift the ground off the wheels.
    """
    slope = normals[:, :2] / normals[:, 2:]
    steepest = np.linalg.norm(slope, axis=1).max()
    if steepest == 0:
        return np.full(len(heights), 0.5)
    return 0.25 + 0.25 * (slope @ LIGHT) / steepest + 0.5 * (heights - heights.min()) / np.ptp(heights)


def _make_wall(edge: np.ndarray, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """Make the vertical wall below a closed outline, down to a level [m]: vertices (2k, 3) and triangles."""
    foot = edge.copy()
    foot[:, 2] = depth
    return np.concatenate([foot, edge]), _grid_triangles(2, len(edge), closed=False)


def _line_spacing(extent: float, lines: int) -> float:
    """Return the number 1, 2 or 5 times a power of ten that gives at most ``lines`` lines [m]."""
    power = 10.0 ** np.floor(np.log10(extent / lines))
    return float(next(step * power for step in (1, 2, 5, 10) if step * power * lines >= extent * (1 - 1e-12)))


def _grid_triangles(rows: int, columns: int, closed: bool) -> np.ndarray:
    """Return the triangles of a grid of vertices, with its columns closed to a ring or not."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns if closed else columns - 1), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = a + columns, b + columns
    return np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, c, d), (a, d, b))])


def _lift_polar(surface: Surface, r: np.ndarray, angle: np.ndarray, lift: float) -> np.ndarray:
    return lift_points(surface, r * np.cos(angle), r * np.sin(angle), lift)


def ground_disc(surface: Surface, path: np.ndarray, radius: float, steepest: float) -> GroundMesh:
    """Draw a disc about the z axis to a radius [m], as far as there is ground around a path (n, 2) about the axis."""
    ride, around = np.linalg.norm(path, axis=1), np.arange(180) * 2 * np.pi / 180

    def bounds(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the smallest and largest radius with ground, from the point of the ride nearest in angle."""
        out = np.column_stack([np.cos(angle), np.sin(angle)])
        known = ride[np.argmax(out @ (path / ride[:, None]).T, axis=1), None] * out
        ends = (_cut_at_edge(surface, known, end, steepest) for end in (np.zeros(2), radius * out))
        inner, outer = (np.linalg.norm(end, axis=1) for end in ends)
        return inner, outer

    inner, outer = bounds(around)
    r = inner + np.linspace(0, 1, 81)[:, None] * (outer - inner)
    ring = np.append(around, 0.0)
    radius = float(outer.min())
    spacing = _line_spacing(radius, 10)
    marks = np.arange(spacing, radius * (1 - 1e-9), spacing)
    lines = [_lift_polar(surface, np.full_like(ring, k), ring, LINE_LIFT) for k in marks if k > inner.max()]
    spokes = np.arange(24) * np.pi / 12
    for angle, first, last in zip(spokes, *bounds(spokes), strict=True):
        spoke = np.linspace(max(spacing, first), last, 60)
        lines.append(_lift_polar(surface, spoke, np.full_like(spoke, angle), LINE_LIFT))
    vertices = _lift_polar(surface, r, around, 0.0).reshape(-1, 3)
    normals = unit_normals(surface, vertices[:, 0], vertices[:, 1])
    edge = _lift_polar(surface, np.append(outer, outer[0]), ring, LINE_LIFT)
    wall, wall_triangles = _make_wall(edge, float(vertices[:, 2].min()) - WALL * radius)
    return GroundMesh(
        vertices=vertices,
        normals=normals,
        triangles=_grid_triangles(len(r), len(around), closed=True),
        brightness=_shade_hills(vertices[:, 2], normals),
        lines=lines,
        edge=edge,
        wall=wall,
        wall_triangles=wall_triangles,
        radius=radius,
        disc=True,
    )


def ground_strip(surface: Surface, path: np.ndarray, margin: float, steepest: float) -> GroundMesh:
    """Draw a rectangle along a path (n, 2), wider by a margin on every side [m], as far as there is ground."""
    middle = path.mean(axis=0)
    along = np.linalg.svd(path - middle, full_matrices=False)[2][0] if len(path) > 1 else np.array([1.0, 0.0])
    along = along * np.sign(along @ (path[-1] - path[0]) or 1.0)
    axes = np.array([along, [-along[1], along[0]]])

    def place(u: np.ndarray, v: np.ndarray, lift: float = LINE_LIFT) -> np.ndarray:
        wanted = middle + u[..., None] * axes[0] + v[..., None] * axes[1]
        x, y = np.moveaxis(_cut_at_edge(surface, nearest(u), wanted, steepest), -1, 0)
        return lift_points(surface, x, y, lift)

    def nearest(u: np.ndarray) -> np.ndarray:
        """Return the point of the ride nearest to each position along the rectangle."""
        order = np.argsort(reach[:, 0], kind="stable")
        after = np.clip(np.searchsorted(reach[order, 0], u), 0, len(order) - 1)
        return path[order[after]]

    reach = (path - middle) @ axes.T
    low, high = reach.min(axis=0) - margin, reach.max(axis=0) + margin
    size = high - low
    spacing = max(_line_spacing(float(size.min()), 20), _line_spacing(float(size.max()), 200))
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
    wall, wall_triangles = _make_wall(edge, float(vertices[:, 2].min()) - WALL * margin)
    return GroundMesh(
        vertices=vertices,
        normals=normals,
        triangles=_grid_triangles(len(us), len(vs), closed=False),
        brightness=_shade_hills(vertices[:, 2], normals),
        lines=lines,
        edge=edge,
        wall=wall,
        wall_triangles=wall_triangles,
        radius=float(size.min()) / 2,
        disc=False,
    )


def make_ground(surface: Surface, path: np.ndarray) -> GroundMesh:
    """Draw the part of a surface around a ride, with a margin.

    Parameters
    ----------
    surface : Surface
    path : ndarray, shape (n, 2)
        Positions of the bicycles [m].

    Returns
    -------
    GroundMesh
        A disc about the z axis if the ride goes around it, otherwise a strip along the path.
    """
    slopes = evaluate(surface, path[:, 0], path[:, 1])[:, 1:3]
    steepest = max(STEEPEST, 2 * float(np.nanmax(np.linalg.norm(slopes, axis=1), initial=0.0)))
    # A bicycle that falls may reach beyond the ground.
    path = path[_is_drawable(surface, path[:, 0], path[:, 1], steepest)]
    low, high = path.min(axis=0), path.max(axis=0)
    around_axis = np.all(low < 0) and np.all(high > 0) and np.ptp(path, axis=0).min() > 0.5 * np.ptp(path, axis=0).max()
    if around_axis:
        reach = float(np.linalg.norm(path, axis=1).max())
        disc = ground_disc(surface, path, reach + max(1.0, 0.4 * reach), steepest)
        # There may be a hole between two points of a ride; a strip starts from the points only.
        if np.isfinite(disc.vertices).all():
            return disc
    return ground_strip(surface, path, STRIP_MARGIN, steepest)
