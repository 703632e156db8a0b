"""Figure 6 of Xiong et al. (2020): bicycles on their circles in the bowl, in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ....reference.bicycle import BODIES, Bicycle
from ....reference.circular import CircularMotion
from ....reference.kinematics import body_positions, rotations
from ....reference.surface import Surface, unit_normals
from ....reports.drawing import STEEPEST, ball, body_meshes, ground_disc, lift_points
from ....reports.figures import FAMILY_COLOURS, INK, WIDTHS, new_figure
from .picture import Picture, View

_FRONT = "#8d939a"  # of the front assembly, so that a reversed handlebar can be recognised
_GROUND, _GRID, _EDGE = np.array([0.90, 0.925, 0.945]), (0.68, 0.73, 0.77), (0.45, 0.50, 0.55)
_REAR_TRACK, _FRONT_TRACK, _PATH = (0.10, 0.10, 0.10), (0.45, 0.47, 0.50), (0.85, 0.60, 0.0)
_MARGIN = 0.25  # of the bowl beyond the largest circle [m]
_ELEVATION, _ASIDE = np.radians(50.0), np.radians(30.0)
_DOT = 0.03  # radius of the mark at a contact point [m]
_COLUMNS = 900  # pixels of a panel's width
_AHEAD = 0.7  # angle from D to the arrow along the circle [rad]
_AROUND = np.linspace(0, 2 * np.pi, 361)


@dataclass(frozen=True)
class Configuration:
    """A circular motion to show.

    Attributes
    ----------
    name : str
    family : int
    motion : CircularMotion
    """

    name: str
    family: int
    motion: CircularMotion


def configurations_figure(
    bicycle: Bicycle, surface: Surface, shown: Sequence[Configuration], columns: int = 2
) -> Figure:
    """Draw each bicycle on its circle in its part of the bowl; call within `use_style`."""
    rows = (len(shown) + 1) // 2
    figure = new_figure((3.15 if columns == 2 else 2.4) * rows, WIDTHS[columns])
    figure.set_layout_engine("compressed")  # pictures keep their shape: excess space goes outside, not between them
    panels = figure.subplots(rows, 2, squeeze=False).ravel()
    for axes in panels[len(shown) :]:
        axes.remove()
    for axes, item, tag in zip(panels, shown, "abcdefgh", strict=False):
        _draw_panel(axes, bicycle, surface, item, tag, columns)
    handles = [
        Line2D([], [], color=_REAR_TRACK, label="circle of the rear contact point"),
        Line2D([], [], color=_FRONT_TRACK, label="of the front contact point"),
        Line2D([], [], color=_PATH, ls="--", label="path of D"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3 if columns == 2 else 1)
    return figure


def _draw_panel(axes: Axes, bicycle: Bicycle, surface: Surface, item: Configuration, tag: str, columns: int) -> None:
    motion = item.motion
    radius = float(np.hypot(*motion.contact[:, :2].T).max()) + _MARGIN
    rim = float(lift_points(surface, np.array([radius]), np.zeros(1))[0, 2])
    view = _make_view(motion, radius, rim)
    picture = Picture(view, _COLUMNS)
    _draw_ground(picture, view, surface, radius)
    _draw_circles(picture, surface, motion)
    _draw_bicycle(picture, bicycle, motion, FAMILY_COLOURS[item.family])
    half = view.width / 2, view.height / 2
    axes.imshow(picture.pixels(), interpolation="antialiased", extent=(-half[0], half[0], -half[1], half[1]))
    axes.plot([half[0] - 0.5, half[0]], [0.04 - half[1]] * 2, color=INK, lw=1.4, solid_capstyle="butt", gid="scale")
    axes.text(half[0] - 0.25, 0.07 - half[1], "0.5 m", ha="center", va="bottom", fontsize=7)
    axes.set_axis_off()
    turns = "anticlockwise" if motion.yaw_rate > 0 else "clockwise"
    space, size = (" ", 7.0) if columns == 2 else ("\n", 6.5)  # a narrow panel has room for a third of the line
    title = f"({tag})  {item.name}, family {item.family},{space}{turns}"
    axes.set_title(title, pad=2, fontsize=size + 1)
    words = space.join(
        (
            f"$θ_0$ = {motion.lean:.2f}, $δ_0$ = {motion.steer:.2f} rad;",
            f"$ω_r$ = {motion.rear_rate:.4g}, $ω_f$ = {motion.front_rate:.2f},",
            f"$ω$ = {motion.yaw_rate:.2f} rad/s",
        )
    )
    axes.text(0.5, -0.01, words.replace("-", "−"), transform=axes.transAxes, ha="center", va="top", fontsize=size)


def _make_view(motion: CircularMotion, radius: float, rim: float) -> View:
    """Return a view from outside, above and a little ahead, from which a bicycle that leans inwards shows its side.

    The bicycle heads along x, with its circle's centre on the left for an anticlockwise motion.
    """
    azimuth = -float(np.sign(motion.yaw_rate)) * (np.pi / 2 - _ASIDE)
    centre = np.array([0.0, 0.0, rim])
    return View(azimuth, _ELEVATION, centre, 2.02 * radius, 2.04 * radius * float(np.sin(_ELEVATION)))


def _draw_ground(picture: Picture, view: View, surface: Surface, radius: float) -> None:
    ring = radius * np.column_stack([np.cos(_AROUND), np.sin(_AROUND)])
    ground = ground_disc(surface, ring, radius, STEEPEST)
    colours = np.tile(_GROUND, (len(ground.vertices), 1)) * (0.94 + 0.12 * ground.brightness[:, None])
    # The near wall would hide the bicycle: only what shows its inner side is drawn.
    picture.body(ground.vertices, ground.normals, ground.triangles, colours, cull=True)
    towards = view.axes[2]
    for line in ground.lines:
        facing = unit_normals(surface, line[:, 0], line[:, 1]) @ towards > 0.05
        for piece in np.split(line, np.flatnonzero(np.diff(facing.astype(int))) + 1):
            if unit_normals(surface, piece[:1, 0], piece[:1, 1])[0] @ towards > 0.05:
                picture.line(piece, 1.0, np.array(_GRID), lift=0.004)
    picture.line(ground.edge, 2.0, np.array(_EDGE))


def _draw_circles(picture: Picture, surface: Surface, motion: CircularMotion) -> None:
    """Draw the circles of the two contact points on the ground, and the path of D with its direction."""
    for contact, colour in zip(motion.contact, (_REAR_TRACK, _FRONT_TRACK), strict=True):
        reach = float(np.hypot(*contact[:2]))
        track = lift_points(surface, reach * np.cos(_AROUND), reach * np.sin(_AROUND), 0.004)
        picture.line(track, 3.0, np.array(colour))
        here = lift_points(surface, contact[:1], contact[1:2])[0]
        point = ball(here, _DOT)
        picture.body(point.vertices, point.normals, point.triangles, np.tile(colour, (len(point.vertices), 1)))
    reach, height = float(np.hypot(*motion.position[:2])), float(motion.position[2])
    path = np.column_stack([reach * np.cos(_AROUND), reach * np.sin(_AROUND), np.full_like(_AROUND, height)])
    for k in range(0, 360, 6):
        picture.line(path[k : k + 4], 2.6, np.array(_PATH))
    turn = float(np.sign(motion.yaw_rate))
    angle = float(np.arctan2(motion.position[1], motion.position[0])) + turn * max(_AHEAD, 0.75 / reach)
    _draw_arrow(picture, reach * np.array([np.cos(angle), np.sin(angle), height / reach]), angle + turn * np.pi / 2)


def _draw_arrow(picture: Picture, tip: np.ndarray, heading: float) -> None:
    """Draw a flat arrow head that points along a heading [rad], with its tip at a point [m]."""
    ahead, aside = (np.array([np.cos(a), np.sin(a), 0.0]) for a in (heading, heading + np.pi / 2))
    corners = tip + np.array([0 * ahead, -0.30 * ahead + 0.11 * aside, -0.22 * ahead, -0.30 * ahead - 0.11 * aside])
    colours = np.tile(np.array(_PATH) / 0.95, (4, 1))
    picture.body(corners, np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]]), colours)


def _draw_bicycle(picture: Picture, bicycle: Bicycle, motion: CircularMotion, colour: str) -> None:
    q, _ = motion.state()
    orientations, centres = rotations(bicycle, q[None])[0], body_positions(bicycle, q[None])[0]
    meshes = body_meshes(bicycle)
    for k, body in enumerate(BODIES):
        mesh = meshes[body]
        red, green, blue = (round(255 * part) for part in to_rgb(colour if body.startswith("rear") else _FRONT))
        tint = mesh.coloured((red, green, blue)) / 255
        picture.body(
            mesh.vertices @ orientations[k].T + centres[k], mesh.normals @ orientations[k].T, mesh.triangles, tint
        )
