"""Orbits of a branch that have a given lean amplitude or energy, and the orbit that bounds a stable circle."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .orbit_branch import OrbitBranch, solve_between
from .orbits import OrbitCondition, PeriodicOrbit, amplitude_condition, energy_condition, solve_orbit
from .small_orbits import flow_near, predict_orbit, small_orbits


def orbits_of_amplitude(branch: OrbitBranch, amplitude: float) -> list[PeriodicOrbit]:
    """Return the orbits of a branch with a lean amplitude [rad], in order along it."""
    sizes = [orbit.lean_amplitude for orbit in branch.orbits]
    first = small_orbits(branch.point, [amplitude]) if amplitude <= sizes[0] else []
    return first + _solve_crossings(branch, np.array(sizes) - amplitude, amplitude_condition(amplitude))


def orbits_of_energy(branch: OrbitBranch, energy: float) -> list[PeriodicOrbit]:
    """Return the orbits of a branch with an energy [J], in order along it."""
    point, energies = branch.point, np.array([orbit.energy for orbit in branch.orbits])
    condition, first = energy_condition(energy), []
    if (energy - point.energy) * (energy - energies[0]) < 0:  # between the Hopf point and the first orbit
        assert point.amplitude_slope is not None
        amplitude = float(np.sqrt(point.amplitude_slope * (energy - point.energy)))
        first = [solve_orbit(flow_near(point), predict_orbit(point, amplitude), condition)]
    return first + _solve_crossings(branch, energies - energy, condition)


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
    energies = np.array([orbit.energy for orbit in last.orbits])
    return list(filter(_is_saddle, _solve_crossings(last, energies - energy, energy_condition(energy))))


def find_bounding_orbit(branch: OrbitBranch, energy: float) -> PeriodicOrbit | None:
    """Return the smallest unstable orbit of an energy [J] on a branch, None if there is none.

    With a single multiplier outside the unit circle, the disturbances that lead to it separate those that die out from
    those that grow: a circle that is stable at this energy is stable within it.
    """
    unstable = [orbit for orbit in orbits_of_energy(branch, energy) if _is_saddle(orbit)]
    return min(unstable, key=lambda orbit: orbit.lean_amplitude, default=None)


def _is_saddle(orbit: PeriodicOrbit) -> bool:
    return int((np.abs(orbit.multipliers[2:]) > 1).sum()) == 1


def _solve_crossings(branch: OrbitBranch, values: np.ndarray, condition: OrbitCondition) -> list[PeriodicOrbit]:
    """Solve for the orbits between neighbours where values (n,) change their sign."""
    found, flow = [], flow_near(branch.point)
    for k, (a, b) in enumerate(pairwise(values)):
        if a * b < 0 or b == 0:
            first, second = branch.orbits[k], branch.orbits[k + 1]
            guess = first.unknowns + a / (a - b) * (second.unknowns - first.unknowns)
            found.append(solve_orbit(flow.moved_to(first.state), guess, condition, first.steps))
    return found
