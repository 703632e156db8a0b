"""Orbits of a branch that have a given lean amplitude or energy, and the orbit that bounds a stable circle."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from .orbit_branch import OrbitBranch, arc_length, solve_between
from .orbits import OrbitCondition, PeriodicOrbit, amplitude_condition, energy_condition, solve_orbit
from .small_orbits import flow_near, predict_orbit, small_orbits


def orbits_of_amplitude(branch: OrbitBranch, amplitude: float) -> list[PeriodicOrbit]:
    """Return the orbits of a branch with a lean amplitude [rad], in order along it."""
    first = small_orbits(branch.point, [amplitude]) if amplitude <= branch.orbits[0].lean_amplitude else []
    return first + _solve_crossings(branch, _seek_amplitude(amplitude))


def orbits_of_energy(branch: OrbitBranch, energy: float) -> list[PeriodicOrbit]:
    """Return the orbits of a branch with an energy [J], in order along it."""
    point, first = branch.point, []
    if (energy - point.energy) * (energy - branch.orbits[0].energy) < 0:  # between the Hopf point and the first orbit
        assert point.amplitude_slope is not None
        amplitude = float(np.sqrt(point.amplitude_slope * (energy - point.energy)))
        first = [solve_orbit(flow_near(point), predict_orbit(point, amplitude), energy_condition(energy))]
    return first + _solve_crossings(branch, _seek_energy(energy))


def find_largest_orbit(branch: OrbitBranch) -> PeriodicOrbit:
    """Return the orbit of a branch with the largest lean amplitude up to its end."""
    sizes = [orbit.lean_amplitude for orbit in branch.orbits]
    best = int(np.argmax(sizes))
    for place in (best - 1, best):
        pair = branch.orbits[max(place, 0) : place + 2]
        if len(pair) == 2 and pair[0].amplitude_slope > 0 > pair[1].amplitude_slope:
            largest = solve_between(branch, place, lambda orbit: orbit.amplitude_slope)
            return branch.orbits[best] if largest is None else largest
    return branch.orbits[best]


def find_crossing_saddle(branch: OrbitBranch, energy: float) -> list[PeriodicOrbit]:
    """Return the unstable orbit of an energy [J], see `find_bounding_orbit`, next to the last one of a branch.

    It lies between that one and the one before, or the Hopf point; empty if there is none.
    """
    if len(branch.orbits) == 1:
        return list(filter(_is_saddle, orbits_of_energy(branch, energy)))
    last = OrbitBranch(branch.point, branch.orbits[-2:], branch.end)
    return list(filter(_is_saddle, _solve_crossings(last, _seek_energy(energy))))


def find_bounding_orbit(branch: OrbitBranch, energy: float) -> PeriodicOrbit | None:
    """Return the smallest unstable orbit of an energy [J] on a branch, None if there is none.

    With a single multiplier outside the unit circle, the disturbances that lead to it separate those that die out from
    those that grow: a circle that is stable at this energy is stable within it.
    """
    unstable = [orbit for orbit in orbits_of_energy(branch, energy) if _is_saddle(orbit)]
    return min(unstable, key=lambda orbit: orbit.lean_amplitude, default=None)


def _is_saddle(orbit: PeriodicOrbit) -> bool:
    return int((np.abs(orbit.multipliers[2:]) > 1).sum()) == 1


class _Sought(NamedTuple):
    """A property of orbits, its derivative along a branch, the value sought, and the condition of that value."""

    measure: Callable[[PeriodicOrbit], float]
    slope: Callable[[PeriodicOrbit], float]
    target: float
    condition: OrbitCondition


def _seek_energy(energy: float) -> _Sought:
    return _Sought(attrgetter("energy"), attrgetter("energy_slope"), energy, energy_condition(energy))


def _seek_amplitude(amplitude: float) -> _Sought:
    measure, slope = attrgetter("lean_amplitude"), attrgetter("amplitude_slope")
    return _Sought(measure, slope, amplitude, amplitude_condition(amplitude))


def _solve_crossings(branch: OrbitBranch, sought: _Sought) -> list[PeriodicOrbit]:
    """Solve for the orbits between neighbours at which a property passes the value that is sought."""
    found, flow = [], flow_near(branch.point)
    for first, second in _pair_neighbours(branch, sought):
        a, b = (sought.measure(orbit) - sought.target for orbit in (first, second))
        if a * b < 0 or b == 0:
            guess = first.unknowns + a / (a - b) * (second.unknowns - first.unknowns)
            found.append(solve_orbit(flow.moved_to(first.state), guess, sought.condition, first.steps))
    return found


def _pair_neighbours(branch: OrbitBranch, sought: _Sought) -> Iterator[tuple[PeriodicOrbit, PeriodicOrbit]]:
    """Yield neighbours along a branch, with an extreme of the property between them where it passes the value twice."""
    for k, (first, second) in enumerate(pairwise(branch.orbits)):
        a, b = (sought.measure(orbit) - sought.target for orbit in (first, second))
        slopes = sought.slope(first), sought.slope(second)
        if a * b > 0 and a * slopes[0] < 0 < a * slopes[1]:
            # By the parabola through both slopes the property changes by this up to its extreme.
            change = slopes[0] ** 2 / (2 * abs(slopes[0] - slopes[1])) * arc_length(first, second)
            extreme = solve_between(branch, k, sought.slope) if abs(a) < 2 * change else None
            if extreme is not None:
                yield first, extreme
                yield extreme, second
                continue
        yield first, second
