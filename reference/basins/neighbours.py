"""The stable circles next to one, over their energy, with what bounds them and the stable orbits beyond their end.

A disturbance changes the energy, and the flow keeps it: a ride can return to the circle of its own energy only. These
circles are the stable section of the family on which the undisturbed one lies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..bicycle import Bicycle
from ..bifurcations.energy_level import EnergyLevel, energy_level
from ..bifurcations.hopf import LEAN_INDEX, examine_hopf
from ..bifurcations.orbit_branch import OrbitBranch, follow_orbits
from ..bifurcations.orbit_search import find_bounding_orbit
from ..bifurcations.orbits import PeriodicOrbit
from ..bifurcations.shooting import Flow
from ..bifurcations.stable_within import bound_section
from ..circular import CircularMotion, Steady
from ..families import Family, search_curves, trace_families
from ..sections import SectionEnd, stable_sections
from ..surface import SurfaceOfRevolution
from .modal_size import ModalSize, deviation_sizes, measure_modes

# Left and right exchanged, in the independent variables.
MIRROR = np.array([1.0, -1.0, -1.0, -1.0, -1.0, -1.0, 1.0])
# Circles that are solved for over the section, dense at its ends, where the energy may be extreme along the family.
_NODES = 65
_BOUNDED = 9  # circles of the section whose bounding orbits are searched for
_SAME_CIRCLE = 1e-6  # relative difference of two solutions by Newton's method that are one circle: far above round-off
# Branches of orbits are followed up to this lean amplitude [rad] and number of orbits; of circles that grow by more
# than this in a period, single shooting finds none.
_LARGEST_AMPLITUDE, _FIRST_AMPLITUDE, _MOST_ORBITS, _LARGEST_GROWTH = 0.1, 2.5e-4, 200, 100.0
_LOOKS = 32  # points of an orbit at which its size is measured


class NotStable(ValueError):
    """Raised where a motion lies on no stable section of a family."""


@dataclass(frozen=True, eq=False)
class StableOrbits:
    """Stable orbits of a branch next to the end of a stable section, by rising energy.

    Attributes
    ----------
    energy : ndarray, shape (n,)
        [J].
    amplitude : ndarray, shape (n,)
        Halves of the peak-to-peak of the lean [rad].
    centre : ndarray, shape (n,)
        Middle of the greatest and the least lean [rad].
    """

    energy: np.ndarray
    amplitude: np.ndarray
    centre: np.ndarray


@dataclass(frozen=True, eq=False)
class StableNeighbours:
    """The stable circles of the section on which a circle lies.

    Attributes
    ----------
    equations : Steady
    motion : CircularMotion
        The circle.
    level : EnergyLevel
        The flow on the level sets of energy near it.
    family : Family
        The curve of circles.
    hand : int
        1, or -1 if the circle is the mirror image of one of the family's.
    limits : tuple of float
        Energies between which circles are stable [J].
    energies : ndarray, shape (n,)
        Energies of known circles, rising, inside the limits [J].
    circles : ndarray, shape (n, 7)
        Their independent variables, of the same hand as the circle.
    modes : list of ModalSize
        How deviations from them are measured.
    interpolation_error : float
        Largest difference of a circle from one that is interpolated between known ones [m, rad, rad/s].
    orbit : PeriodicOrbit or None
        The smallest known unstable orbit of the circle's energy, of the family's hand.
    bounds : ndarray, shape (m, 2)
        Energies [J], rising, of the known orbits that bound circles, and their sizes in all modes [rad].
    beyond : tuple of StableOrbits
        Stable orbits at energies outside the limits, of the circle's hand.
    branches : tuple of OrbitBranch
        The orbits that were searched.
    """

    equations: Steady
    motion: CircularMotion
    level: EnergyLevel
    family: Family
    hand: int
    limits: tuple[float, float]
    energies: np.ndarray
    circles: np.ndarray
    modes: list[ModalSize]
    interpolation_error: float
    orbit: PeriodicOrbit | None
    bounds: np.ndarray
    beyond: tuple[StableOrbits, ...]
    branches: tuple[OrbitBranch, ...]

    @property
    def energy(self) -> float:
        """Energy of the circle [J]."""
        return self.level.energy

    @property
    def flow(self) -> Flow:
        """The flow of the independent variables near the circle."""
        return Flow(self.equations, self.level.state)

    @property
    def own_modes(self) -> ModalSize:
        """How deviations from the circle itself are measured."""
        return self.modes[int(np.abs(self.energies - self.energy).argmin())]

    @cached_property
    def _curve(self) -> Any:
        return _interpolate(self.energies, self.circles)

    def solve_circle(self, variables: np.ndarray, energy: float) -> np.ndarray:
        """Solve for a circle of an energy [J], stable or not, from independent variables (7,) near it.

        Raises
        ------
        ValueError
            If Newton's method does not converge.
        """
        state = self.flow.moved_to(variables).near
        near = EnergyLevel(self.equations, state, variables[:-1], float(variables[-1]), energy)
        try:
            return near.circle(energy)
        except np.linalg.LinAlgError as error:  # the energy is extreme there
            raise ValueError(f"no circular motion is found: {error}") from error

    def linearise_circle(self, circle: np.ndarray) -> ModalSize:
        """Return how deviations from a circle (7,) are measured, and its slowest mode."""
        return _measure_circle(self.level, circle)

    def are_inside(self, energies: np.ndarray) -> np.ndarray:
        """Return which energies (n,) are those of stable circles of the section."""
        return (energies > self.limits[0]) & (energies < self.limits[1])

    def interpolate_circles(self, energies: np.ndarray) -> np.ndarray:
        """Return the independent variables (n, 7) of the circles of energies (n,)."""
        return self._curve(energies)

    def bounds_at(self, energies: np.ndarray) -> np.ndarray:
        """Return the sizes of the orbits that bound the circles of energies (n,) [rad]; nan where none is known.

        Squared sizes are interpolated, which are linear in the energy next to a Hopf point.
        """
        if not len(self.bounds):
            return np.full(len(energies), np.nan)
        known, sizes = self.bounds.T
        return np.sqrt(np.interp(energies, known, sizes**2, left=np.nan, right=np.nan))


def _interpolate(energies: np.ndarray, circles: np.ndarray) -> Any:
    from scipy.interpolate import CubicSpline  # imported here: it takes a third of a second

    return CubicSpline(energies, circles)


def find_stable_neighbours(bicycle: Bicycle, surface: SurfaceOfRevolution, motion: CircularMotion) -> StableNeighbours:
    """Find the stable section on which a circle lies, and what bounds its circles.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    motion : CircularMotion
        Hands-free.

    Returns
    -------
    StableNeighbours

    Raises
    ------
    NotStable
        If the circle lies on no stable section of a family.
    ValueError
        If the rear wheel stands, or the circles of the section are not found.
    """
    own = energy_level(Steady(bicycle, surface), motion)
    for family in _follow_curves(bicycle, surface):
        for section in stable_sections(family):
            try:
                levels = [energy_level(family.equations, end.motion) for end in section]
            except ValueError:  # the rear wheel stands at an end
                continue
            hand = _find_hand(own, levels)
            if hand is not None:
                return _describe_section(family, section, motion, [own, *levels], hand)
    raise NotStable(
        f"the circle at lean {motion.lean:.6g}, steer {motion.steer:.6g} lies on no stable section of a family"
    )


def _follow_curves(bicycle: Bicycle, surface: SurfaceOfRevolution) -> Iterator[Family]:
    """Yield the curves of circular motions, those of the families first: the search for others takes longer."""
    families, _ = trace_families(bicycle, surface)
    yield from families
    yield from search_curves(bicycle, surface, families)


def _find_hand(own: EnergyLevel, ends: Sequence[EnergyLevel]) -> int | None:
    """Return 1 if a circle lies on the section between two others, -1 if its mirror image does, None if neither."""
    low, high = sorted(end.energy for end in ends)
    if not low < own.energy < high:
        return None
    try:
        circle = min(ends, key=lambda end: abs(end.energy - own.energy)).circle(own.energy)
    except ValueError:
        return None
    mine = np.append(own.centre, own.rear_rate)
    for hand, image in ((1, mine), (-1, MIRROR * mine)):
        if np.all(np.abs(circle - image) <= _SAME_CIRCLE * (1 + np.abs(circle))):
            return hand
    return None


def _describe_section(
    family: Family,
    section: tuple[SectionEnd, SectionEnd],
    motion: CircularMotion,
    levels: Sequence[EnergyLevel],
    hand: int,
) -> StableNeighbours:
    """Solve for the circles of a section; the first of the levels is that of the motion, the others of the ends."""
    own, ends = levels[0], levels[1:]
    low, high = sorted(end.energy for end in ends)
    angles = np.pi * (np.arange(_NODES) + 0.5) / _NODES
    energies = 0.5 * (low + high) - 0.5 * (high - low) * np.cos(angles)
    circles = np.array([_solve_circle(levels, hand, energy) for energy in energies])
    between = 0.5 * (energies[1:] + energies[:-1])
    exact = np.array([_solve_circle(levels, hand, energy) for energy in between])
    error = float(np.abs(_interpolate(energies, circles)(between) - exact).max())
    modes = [_measure_circle(own, circle) for circle in circles]
    branches = tuple(_follow_branches(family, section))
    orbits = [find_bounding_orbit(branch, own.energy) for branch in branches]
    return StableNeighbours(
        equations=own.equations,
        motion=motion,
        level=own,
        family=family,
        hand=hand,
        limits=(low, high),
        energies=energies,
        circles=circles,
        modes=modes,
        interpolation_error=error,
        orbit=min((orbit for orbit in orbits if orbit is not None), key=lambda one: one.lean_amplitude, default=None),
        bounds=_measure_bounds(family, section, branches),
        beyond=tuple(_list_beyond(branches, low, high, hand)),
        branches=branches,
    )


def _solve_circle(levels: Sequence[EnergyLevel], hand: int, energy: float) -> np.ndarray:
    """Return the independent variables of the circle of an energy, from the nearest of the known ones."""
    nearest = min(range(len(levels)), key=lambda k: abs(levels[k].energy - energy))
    circle = levels[nearest].circle(float(energy))
    return circle if nearest == 0 or hand == 1 else MIRROR * circle


def _measure_circle(level: EnergyLevel, circle: np.ndarray) -> ModalSize:
    """Return how deviations from a circle (7,) are measured."""
    equations, state = level.equations, Flow(level.equations, level.state).moved_to(circle).near
    return measure_modes(equations.bicycle, equations.surface, state[:9], state[9:18])


def _follow_branches(family: Family, section: tuple[SectionEnd, SectionEnd]) -> Iterator[OrbitBranch]:
    """Yield the branches of orbits born at the ends of a section, where they can be followed."""
    for end in section:
        if end.cause != "hopf":
            continue
        point = examine_hopf(family, end.motion, end.eigenvalue.imag, True)
        if point.amplitude_slope is None or point.growth_in_period > _LARGEST_GROWTH:
            continue
        try:
            yield follow_orbits(point, _LARGEST_AMPLITUDE, _FIRST_AMPLITUDE, most=_MOST_ORBITS)
        except ValueError:  # the first orbits are not found
            continue


def _measure_bounds(
    family: Family, section: tuple[SectionEnd, SectionEnd], branches: Sequence[OrbitBranch]
) -> np.ndarray:
    """Return energies and sizes (m, 2) of the orbits that bound circles of a section, by rising energy."""
    if not branches:
        return np.empty((0, 2))
    found = [
        (circle.energy, _measure_orbit(family.equations, branches[0], circle.state, circle.orbit))
        for circle in bound_section(family, section, branches, _BOUNDED)
        if circle.orbit is not None
    ]
    low, high = sorted((found[0][0], found[-1][0])) if found else (0.0, 0.0)
    # Orbits shrink to nothing at the subcritical end from which their branch starts.
    for branch in branches:
        energy = branch.point.energy
        if found and branch.point.criticality == "subcritical" and not low < energy < high:
            found.append((energy, 0.0))
    return np.array(sorted(found)).reshape(-1, 2)


def _measure_orbit(equations: Steady, branch: OrbitBranch, circle: np.ndarray, orbit: PeriodicOrbit) -> float:
    """Return the mean size of an orbit, in the modes of the circle (7,) of its energy [rad]."""
    flow = Flow(equations, branch.point.level.state).moved_to(orbit.state)
    durations, steps = np.full(_LOOKS, orbit.period / _LOOKS), np.full(_LOOKS, max(orbit.steps // _LOOKS, 2))
    points = np.real(flow.ride(orbit.state, durations, steps)[0])
    forms = _measure_circle(branch.point.level, circle).forms
    sizes = deviation_sizes(forms[None], (points - circle)[None])[0, 1]
    return float(np.sqrt(np.mean(sizes**2)))


def _list_beyond(branches: Sequence[OrbitBranch], low: float, high: float, hand: int) -> Iterator[StableOrbits]:
    """Yield the stable orbits next to supercritical ends, at energies at which no circle of the section is stable."""
    for branch in branches:
        rows = [(branch.point.energy, 0.0, branch.point.motion.lean)]
        for orbit in branch.orbits:
            if not orbit.growth < 1 or low < orbit.energy < high:
                break
            if len(rows) > 1 and (orbit.energy - rows[-1][0]) * (rows[1][0] - rows[0][0]) <= 0:
                break  # beyond a fold in energy
            rows.append((orbit.energy, orbit.lean_amplitude, float(orbit.state[LEAN_INDEX]) - orbit.lean_amplitude))
        if len(rows) > 2:
            energy, amplitude, centre = np.array(sorted(rows)).T
            yield StableOrbits(energy, amplitude, hand * centre)
