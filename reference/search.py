"""Bounded search for curves of circular motions that no anchor of a family leads to.

At fixed lean (against the ground) and steer the bicycle rolls in one circle of the tangent plane, so that two angles
describe every circular motion on the level plane, and to leading order on a bowl too: there the circle around the axis
whose geodesic curvature is that of the plane's circle. Starts are therefore a grid of both angles. From each,
Gauss-Newton steps lead to the nearest circular motion and to a static equilibrium, in which short curves begin, and the
curves through them are followed unless they are known.

The search is deterministic. It finds the curves that one of its starts leads to; a closed curve smaller than the grid's
spacing may be missed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from .anchors import above_ground, are_same_solution, start_on_plane
from .bicycle import Bicycle
from .circular import (
    CONTACT,
    LEAN,
    PITCH,
    SIGMA,
    STEER,
    Condition,
    Steady,
    as_solved,
    nearest_condition,
    newton,
    plane_condition,
    unknown_condition,
)
from .continuation import Point, largest_sigma, metric, tangent
from .inputs import NO_INPUTS, Inputs
from .kernels import curve as kernel
from .roots import find_root
from .surface import SurfaceOfRevolution, evaluate, is_level

# Leans against the ground and steers of the starts [rad]. With left and right exchanged a hands-free motion has a steer
# in (0, pi); a steer of 0 or pi belongs to straight motion. A steer torque tells left from right: with it, the starts
# have steers of either sign.
LEANS, STEERS = np.linspace(-1.5, 1.5, 16), np.pi * (np.arange(12) + 0.5) / 12
_STATIC = 1e-12  # squared speed, of order one, of a static equilibrium: round-off
_MOST = 15  # Gauss-Newton steps: from the grid, what converges takes six or so
_NEAR = 0.4  # distance, in the arclength's metric, within which a start may lie on a segment of a followed curve


def describe_search(inputs: Inputs = NO_INPUTS) -> str:
    """Describe the starts in words."""
    least = "0" if inputs.steer_torque == 0 else "-pi"
    return (
        f"Gauss-Newton steps, to the nearest motion and to a static equilibrium, from {len(LEANS)} leans of "
        f"{LEANS[0]:g} to {LEANS[-1]:g} rad against the ground and {len(_starting_steers(inputs))} steers "
        f"between {least} and pi, and the "
        "whole curves through what they lead to"
    )


def search_starts(bicycle: Bicycle, surface: SurfaceOfRevolution, inputs: Inputs = NO_INPUTS) -> Iterator[Point]:
    """Find circular motions from the grid of angles, turning to the left, many of them on the same curve.

    A motion that turns to the left with its rear wheel rolling backward is, run the other way, one that turns to the
    right and rolls forward.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    inputs : Inputs

    Yields
    ------
    Point
        In the order of the grid, steers outermost; the tangents have either sign.
    """
    equations, fastest = Steady(bicycle, surface, inputs), largest_sigma(bicycle)
    for steer in _starting_steers(inputs):
        for lean in LEANS:
            for guess in guesses_at(bicycle, surface, float(lean), float(steer), inputs):
                for condition in (nearest_condition(), unknown_condition(SIGMA, 0.0)):
                    found = _solve(equations, guess, condition)
                    if found is not None and found[SIGMA] < fastest:
                        yield Point(found, tangent(equations, found))


def _starting_steers(inputs: Inputs) -> np.ndarray:
    return STEERS if inputs.steer_torque == 0 else np.concatenate([-STEERS[::-1], STEERS])


def guesses_at(
    bicycle: Bicycle, surface: SurfaceOfRevolution, lean: float, steer: float, inputs: Inputs = NO_INPUTS
) -> Iterator[np.ndarray]:
    """Guess the unknowns (22,) of circular motions at a lean against the ground and a steer.

    On a bowl the plane's solution is turned into the tangent plane at every radius where the circle around the axis
    has the curvature of the plane's circle.
    """
    try:
        level = start_on_plane(bicycle, lean, steer, inputs)
    except ValueError:
        return
    level = as_solved(level)
    if is_level(surface):
        yield level
        return
    rear = level[CONTACT][:2]
    curvature = 1 / float(np.hypot(*rear))
    for radius in _radii_of_curvature(surface, curvature):
        yield _tilted(surface, level, radius)


def _radii_of_curvature(surface: SurfaceOfRevolution, curvature: float) -> Iterator[float]:
    """Yield the radii of circles around the axis that have a geodesic curvature, cos(slope) / radius."""

    def excess(radius: Any) -> Any:
        slope = evaluate(surface, radius, 0.0)[..., 1]
        return 1 / (radius * np.hypot(1.0, slope)) - curvature

    inner, outer = surface.extent
    inner, outer = max(inner, 1e-3) * (1 + 1e-9), min(outer, 1e3) * (1 - 1e-9)
    radii = np.geomspace(inner, outer, 60)
    values = excess(radii)
    for k in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0):
        yield find_root(excess, radii[k], radii[k + 1])


def _tilted(surface: SurfaceOfRevolution, level: np.ndarray, radius: float) -> np.ndarray:
    """Turn a solution on the plane into the tangent plane of a bowl, at a radius of the rear contact."""
    u = level.copy()
    height, slope = evaluate(surface, radius, 0.0)[:2]  # the slope outwards
    side = np.sign(level[CONTACT][1])  # of the axis the rear contact is on; it heads along its circle
    # The ground rises outwards: the bicycle is turned about its heading, away from the outside.
    turn = side * np.arctan(slope)
    cosine, sine = np.cos(turn), np.sin(turn)
    contact = np.array([0.0, side * radius, height])
    rear = np.array([*level[CONTACT][:2], 0.0])
    offset = level[:3] - rear
    across, up = cosine * offset[1] - sine * offset[2], sine * offset[1] + cosine * offset[2]
    u[:3] = contact + np.array([offset[0], across, up])
    u[LEAN] += turn
    front = np.array([*level[CONTACT][3:5], 0.0]) - rear
    u[CONTACT.start : CONTACT.start + 2] = contact[:2]
    u[CONTACT.start + 3 : CONTACT.start + 5] = contact[:2] + np.array([front[0], cosine * front[1]])
    return u


def _solve(equations: Steady, guess: np.ndarray, condition: Callable[[np.ndarray], Condition]) -> np.ndarray | None:
    """Return the circular motion, under a condition, that a guess leads to; None if there is none."""
    try:
        found, _ = newton(equations, guess, condition, most=_MOST)
    except ValueError:
        return None
    found[[LEAN, PITCH, STEER]] = (found[[LEAN, PITCH, STEER]] + np.pi) % (2 * np.pi) - np.pi
    least = 0.0 if equations.inputs.steer_torque == 0 else -np.pi
    possible = found[SIGMA] > -_STATIC and least < found[STEER] < np.pi and above_ground(equations, found)
    return as_solved(found) if possible else None


def is_on_curve(equations: Steady, points: Sequence[Point], start: Point) -> bool:
    """Return whether a followed curve passes through a motion.

    Near the motion, the curve's point in the plane through the motion and across its tangent is solved for; it must be
    the motion itself, since another branch may pass close by.

    Parameters
    ----------
    equations : Steady
    points : sequence of Point
        In the order followed.
    start : Point
    """
    chosen = kernel.CHOSEN
    weights = metric(start.unknowns)
    covector = np.zeros_like(weights)
    covector[chosen] = (weights * start.tangent)[chosen]
    unknowns = np.array([point.unknowns for point in points])
    apart = unknowns - start.unknowns
    near = np.sqrt((apart[:, chosen] ** 2 * weights[chosen]).sum(axis=1)) < _NEAR
    heights = apart @ covector
    condition = plane_condition(start.unknowns, covector, 0.0)
    for k in np.flatnonzero(near[:-1] & near[1:] & (heights[:-1] * heights[1:] <= 0)):
        span = heights[k] - heights[k + 1]
        share = heights[k] / span if span else 0.0
        try:
            met, _ = newton(equations, unknowns[k] + share * (unknowns[k + 1] - unknowns[k]), condition)
        except ValueError:
            continue
        if are_same_solution(met, start.unknowns):
            return True
    # A motion at the very end of a curve has no segment on one of its sides.
    return any(are_same_solution(unknowns[k], start.unknowns) for k in (0, -1))
