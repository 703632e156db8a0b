"""Figures 8 and 9 of Xiong et al. (2020): rides from Q1 and Q2 by the paper's integrator and by the precise one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from ....reference.bicycle import Bicycle
from ....reference.circular import CircularMotion
from ....reference.contact import observe
from ....reference.kinematics import FRONT_ANGLE, REAR_ANGLE
from ....reference.simulate import PreciseMotion
from ....reference.surface import Surface
from ....reports.figures import FAMILY_COLOURS, GREY, INK, WIDTHS, new_figure

REAR, FRONT = FAMILY_COLOURS[1], FAMILY_COLOURS[2]
DISTURBED_COLOURS = (FAMILY_COLOURS[1], FAMILY_COLOURS[2])
_FIRST = 20.0  # end of the drawn paths [s]: later laps overlap
_PRECISE: dict[str, Any] = {"lw": 2.4, "alpha": 0.55, "solid_capstyle": "butt", "gid": "precise"}
_PAPER: dict[str, Any] = {"lw": 0.9, "color": INK, "dashes": (4, 2), "gid": "modified Euler"}


@dataclass(frozen=True)
class FigureRide:
    """One start, integrated twice, until the ground would have to pull a wheel.

    Attributes
    ----------
    name : str
    precise, paper : PreciseMotion
        By the projected method of order 8, and by modified Euler at 1 ms.
    """

    name: str
    precise: PreciseMotion
    paper: PreciseMotion

    @property
    def both(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,) [s] common to both, and D of each at these times, shape (n, 2) [m]."""
        n = min(len(self.precise.time), len(self.paper.time))
        return self.precise.time[:n], self.precise.q[:n, :2], self.paper.q[:n, :2]

    @property
    def apart(self) -> np.ndarray:
        """Distance of D between the two integrations at their common times, shape (n,) [m]."""
        _, precise, paper = self.both
        return np.hypot(*(precise - paper).T)


def while_pushed(motion: PreciseMotion, bicycle: Bicycle, surface: Surface) -> PreciseMotion:
    """Cut a motion before the first sample where the ground would have to pull a wheel, which leaves the ground."""
    seen = observe(bicycle, surface, motion.q, motion.qd)
    normal = np.einsum("nwi,nwi->nw", motion.force, seen.normal)
    pulled = np.flatnonzero(~np.all(normal > 0, axis=1))
    if len(pulled) == 0:
        return motion
    n = int(pulled[0])
    ended = f"a wheel leaves the ground at t = {motion.time[n]:.6g} s"
    rows: dict[str, Any] = {name: getattr(motion, name)[:n] for name in ("time", "q", "qd", "contact", "force")}
    return replace(motion, ended=ended, **rows)


def radius_change(motion: PreciseMotion, circle: CircularMotion) -> np.ndarray:
    """Return the distance of D from its circle, shape (n,) [m]."""
    return np.abs(np.hypot(*motion.q[:, :2].T) - np.hypot(*circle.position[:2]))


def leaves_at(motion: PreciseMotion, circle: CircularMotion, share: float) -> float | None:
    """Return the first time at which D is off its circle by a share of the radius [s], or None."""
    off = np.flatnonzero(radius_change(motion, circle) > share * np.hypot(*circle.position[:2]))
    return float(motion.time[off[0]]) if len(off) else None


def departure_figure(ride: FigureRide, circle: CircularMotion, growth_rate: float, columns: int = 2) -> Figure:
    """Draw a ride that leaves its circle: path, wheel rates, distance from the circle on a log scale.

    Parameters
    ----------
    ride : FigureRide
    circle : CircularMotion
        Circle at the start.
    growth_rate : float
        Growth rate of the linear theory [1/s].
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    figure, path, rates, growth = _make_panels("off the circle [m]", "wheel rates [rad/s]", columns)
    _draw_circle(path, circle)
    for motion, look in ((ride.precise, _change_style(_PRECISE, color=REAR)), (ride.paper, _PAPER)):
        path.plot(motion.q[:, 0], motion.q[:, 1], **look)
        path.plot(motion.q[-1, 0], motion.q[-1, 1], "x", color=look["color"], ms=6, mew=1.6, gid="end")
        rates.plot(motion.time, motion.qd[:, REAR_ANGLE], **look)
        front = _change_style(look, color=FRONT) if motion is ride.precise else look
        rates.plot(motion.time, motion.qd[:, FRONT_ANGLE], **front)
        growth.plot(motion.time, np.maximum(radius_change(motion, circle), 1e-16), **look)
    for wheel, name in ((REAR_ANGLE, "rear"), (FRONT_ANGLE, "front")):
        rate = ride.precise.qd[0, wheel]
        rates.annotate(name, (0, rate), (3, 5), textcoords="offset points", color=(REAR, FRONT)[wheel - REAR_ANGLE])
    _draw_theory(growth, ride.precise, circle, growth_rate)
    growth.set_ylim(1e-15, 1e2)
    precise = Line2D([], [], color=REAR, **_without_id(_PRECISE), label="precise, projected, order 8")
    _draw_legend(figure, [precise], columns)
    return figure


def _draw_theory(axes: Axes, motion: PreciseMotion, circle: CircularMotion, growth_rate: float) -> None:
    """Draw the slope of the linear theory below the precise curve."""
    off = radius_change(motion, circle)
    middle = int(np.argmin(np.abs(np.log(np.maximum(off, 1e-300)) - np.log(1e-7))))
    times = motion.time[middle] + np.array([-12.0, 12.0])
    values = off[middle] * np.exp(growth_rate * (times - motion.time[middle])) / 20
    axes.plot(times, values, color=GREY, lw=0.9, gid="theory")
    text = f"exp({growth_rate:.3f} t)"
    axes.annotate(text, (times[0], values[0]), (14, 0), textcoords="offset points", va="center")


def disturbed_figure(
    rides: Sequence[FigureRide],
    circle: CircularMotion,
    neighbours: Mapping[str, CircularMotion],
    columns: int = 2,
) -> Figure:
    """Draw disturbed rides about a stable circle: paths, rear-wheel rates, distance of the integrators.

    Parameters
    ----------
    rides : sequence of FigureRide
        At most two.
    circle : CircularMotion
        The undisturbed motion.
    neighbours : mapping
        Circular motion of each ride's energy, to which the ride tends, by the ride's name.
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    figure, path, rates, apart = _make_panels("integrators apart [m]", "rear-wheel rate [rad/s]", columns)
    lens = path.inset_axes((0.27, 0.27, 0.46, 0.46), xticks=[], yticks=[], aspect="equal")
    handles = []
    for ride, colour in zip(rides, DISTURBED_COLOURS, strict=False):
        look, thin = _change_style(_PRECISE, color=colour, lw=1.6), _change_style(_PAPER, lw=0.55)
        early = ride.precise.time <= _FIRST
        for axes in (path, lens):
            x, y = ride.precise.q[early, :2].T
            axes.plot(x, y, **_change_style(look, lw=0.7 if axes is path else 1.6))
        x, y = ride.paper.q[: early.sum(), :2].T
        lens.plot(x, y, **thin)
        for motion, line in ((ride.precise, look), (ride.paper, thin)):
            rates.plot(motion.time, motion.qd[:, REAR_ANGLE], **line)
        level = neighbours[ride.name].rear_rate
        rates.axhline(level, color=colour, lw=0.9, ls=":", gid="neighbour")
        apart.plot(ride.both[0][1:], ride.apart[1:], color=colour, lw=1.2, gid="apart")
        handles.append(Line2D([], [], color=colour, **_without_id(_PRECISE), label=f"{ride.name}, precise"))
    for axes in (path, lens):
        _draw_circle(axes, circle)
    reach = float(np.hypot(*circle.position[:2]))
    lens.set(xlim=(-1.11 * reach, -0.91 * reach), ylim=(-0.10 * reach, 0.10 * reach))
    path.indicate_inset_zoom(lens, edgecolor=GREY, lw=0.6)
    rates.axhline(circle.rear_rate, color=GREY, lw=0.9, gid="undisturbed")
    handles.append(Line2D([], [], color=GREY, lw=0.9, label="undisturbed"))
    handles.append(Line2D([], [], color=GREY, lw=0.9, ls=":", label="circle of equal energy"))
    _draw_legend(figure, handles, columns)
    return figure


def _make_panels(lower: str, upper: str, columns: int) -> tuple[Figure, Axes, Axes, Axes]:
    """Make a figure with a square panel for the path, and two panels above one another over time."""
    if columns == 2:
        figure = new_figure(3.9)
        panels = figure.subplot_mosaic([["path", "rates"], ["path", "lower"]], width_ratios=[1.0, 1.12])
    else:
        figure = new_figure(7.6, WIDTHS[1])
        panels = figure.subplot_mosaic([["path"], ["rates"], ["lower"]], height_ratios=[2.0, 1.0, 1.0])
    path, rates, last = panels["path"], panels["rates"], panels["lower"]
    path.set_aspect("equal", adjustable="datalim")
    path.set(xlabel="x of D [m]", ylabel="y of D [m]")
    rates.sharex(last)
    rates.tick_params(labelbottom=False)
    rates.set_ylabel(upper)
    last.set(xlabel="time [s]", ylabel=lower, yscale="log")
    last.yaxis.set_minor_locator(NullLocator())
    for axes, tag in ((path, "a"), (rates, "b"), (last, "c")):
        axes.grid()
        axes.set_title(f"({tag})", loc="left", pad=3)
    return figure, path, rates, last


def _draw_circle(axes: Axes, circle: CircularMotion) -> None:
    around = np.linspace(0, 2 * np.pi, 361)
    reach = float(np.hypot(*circle.position[:2]))
    axes.plot(reach * np.cos(around), reach * np.sin(around), color=GREY, lw=0.9, gid="undisturbed")


def _change_style(look: Mapping[str, Any], **changes: Any) -> dict[str, Any]:
    return {**look, **changes}


def _without_id(look: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in look.items() if name != "gid"}


def _draw_legend(figure: Figure, handles: list[Line2D], columns: int) -> None:
    handles = [*handles, Line2D([], [], **_without_id(_PAPER), label="modified Euler, 1 ms")]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles) if columns == 2 else 1)
