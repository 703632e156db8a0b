"""The branch of periodic orbits born at a Hopf point, by pseudo-arclength continuation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..continuation import LARGEST_LEAN
from ..roots import find_root
from .hopf import LEAN_INDEX, HopfPoint
from .orbits import PeriodicOrbit, arc_metric, orbit_plane_condition, solve_orbit
from .shooting import Flow
from .small_orbits import flow_near, small_orbits

# Steps in the metric of the arc, in which leans and steers count as they are: the first is as long as a small orbit is
# wide, and a curve that needs steps shorter than a thousandth of that ends there.
_FIRST_STEP, _SHORTEST_STEP, _LONGEST_STEP = 1e-3, 1e-6, 0.05
_FEW = 6  # Newton's iterations in a step; more mean that it is too long
# Cosine of the angle between neighbouring tangents: a sharper turn means that the step has jumped to another branch.
_SHARPEST_TURN = 0.9


@dataclass(frozen=True, eq=False)
class OrbitBranch:
    """Periodic orbits followed from a Hopf point.

    Attributes
    ----------
    point : HopfPoint
    orbits : list of PeriodicOrbit
        In order along the branch, of positive lean amplitude; their tangents point in that direction.
    end : str
        ``hopf``: the amplitude has shrunk to zero at another Hopf point; ``largest``: it has reached the amplitude
        at which the branch is left; ``stopped``: it is left on request; ``flat``: a wheel lies nearly flat on the
        ground; ``lost``: the shortest step finds no further orbit; ``unfinished``: the largest number of orbits is
        reached.
    """

    point: HopfPoint
    orbits: list[PeriodicOrbit]
    end: str


def follow_orbits(
    point: HopfPoint,
    largest: float = 0.5,
    first: float = 1e-3,
    longest: float = _LONGEST_STEP,
    most: int = 300,
    stop: Callable[[OrbitBranch], bool] = lambda _: False,
) -> OrbitBranch:
    """Follow the periodic orbits born at a Hopf point.

    Parameters
    ----------
    point : HopfPoint
        With an amplitude slope.
    largest : float
        Lean amplitude at which the branch is left [rad].
    first : float
        Lean amplitude of the first orbit [rad], down to which the branch is followed to another Hopf point.
    longest : float
        Longest step, in the metric `velodrome.reference.bifurcations.orbits.arc_metric`.
    most : int
        Largest number of orbits.
    stop : callable
        Maps the branch, as far as it is followed, to whether it is left there.

    Returns
    -------
    OrbitBranch
    """
    near, far = small_orbits(point, [first, 1.1 * first])
    orbits = [_direct(near, far.unknowns - near.unknowns)]
    following = _follow(flow_near(point), orbits[0], longest, first)
    end: str | None = None
    while end is None:
        if stop(OrbitBranch(point, orbits, "stopped")):
            end = "stopped"
        elif orbits[-1].lean_amplitude > largest:
            end = "largest"
        elif abs(orbits[-1].state[LEAN_INDEX]) > LARGEST_LEAN:
            end = "flat"
        elif len(orbits) >= most:
            end = "unfinished"
        elif (orbit := next(following, None)) is None:
            end = "lost"
        elif orbit.lean_amplitude <= 0:
            end = "hopf"
        else:
            orbits.append(orbit)
    return OrbitBranch(point, orbits, end)


def _follow(flow: Flow, orbit: PeriodicOrbit, longest: float, smallest: float) -> Iterator[PeriodicOrbit]:
    """Yield the orbits that follow one in the direction of its tangent, until the shortest step finds none.

    Beyond a Hopf point the curve goes on with the same orbits, whose amplitude then counts as negative. It is passed
    from an orbit of the smallest amplitude [rad] or less only, since no orbit of the branch is to be left out.
    """
    distance = _FIRST_STEP
    while distance >= _SHORTEST_STEP:
        flow = flow.moved_to(orbit.state)
        found = step_along(flow, orbit, distance)
        if found is None or (found.lean_amplitude <= 0 and orbit.lean_amplitude > smallest):
            distance /= 2
        else:
            orbit, distance = found, min(longest, 1.4 * distance)
            yield orbit


def step_along(flow: Flow, orbit: PeriodicOrbit, distance: float) -> PeriodicOrbit | None:
    """Return the orbit at a distance along another's tangent, directed as that; None where none is found near by."""
    covector = arc_metric(orbit.unknowns) * orbit.tangent
    condition = orbit_plane_condition(orbit.unknowns, covector, distance)
    try:
        found = solve_orbit(flow, orbit.unknowns + distance * orbit.tangent, condition, orbit.steps, _FEW)
    except ValueError:
        return None
    found = _direct(found, orbit.tangent)
    return found if found.tangent @ covector > _SHARPEST_TURN else None


def _direct(orbit: PeriodicOrbit, towards: np.ndarray) -> PeriodicOrbit:
    """Return an orbit with its tangent pointing in a direction of its unknowns."""
    if towards @ (arc_metric(orbit.unknowns) * orbit.tangent) > 0:
        return orbit
    return replace(
        orbit,
        tangent=-orbit.tangent,
        energy_slope=-orbit.energy_slope,
        amplitude_slope=-orbit.amplitude_slope,
    )


def arc_length(first: PeriodicOrbit, second: PeriodicOrbit) -> float:
    """Return the distance of an orbit from its neighbour, along that one's tangent."""
    return float((arc_metric(first.unknowns) * first.tangent) @ (second.unknowns - first.unknowns))


def solve_between(branch: OrbitBranch, place: int, function: Callable[[PeriodicOrbit], float]) -> PeriodicOrbit | None:
    """Solve function = 0 between an orbit of a branch and the next one, where it has opposite signs.

    Parameters
    ----------
    branch : OrbitBranch
    place : int
        Index of the first of the two orbits.
    function : callable
        Maps an orbit, directed as the branch, to a number.

    Returns
    -------
    PeriodicOrbit or None
        To round-off of the distance along the branch; None where an orbit between the two is not found.
    """
    first, second = branch.orbits[place : place + 2]
    length = arc_length(first, second)
    flow, found = flow_near(branch.point).moved_to(first.state), {0.0: first, length: second}

    def value(distance: float) -> float:
        if distance not in found:
            orbit = step_along(flow, first, distance)
            if orbit is None:
                raise ValueError("there is no orbit between two of a branch")
            found[distance] = orbit
        return function(found[distance])

    try:
        return found[find_root(value, 0.0, length, tolerance=1e-12)]
    except ValueError:
        return None
