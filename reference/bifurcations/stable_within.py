"""How far from a stable circle a bicycle may weave and come back: the unstable orbits that bound stable circles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..anchors import are_same_solution
from ..circular import CircularMotion, Steady, find_unknowns
from ..families import Family, trace_through
from ..sections import SectionEnd, stable_sections
from ..stability import independent
from .energy_level import energy_level
from .hopf import HopfPoint, examine_end, explain_undefined
from .orbit_branch import OrbitBranch, follow_orbits
from .orbit_search import find_bounding_orbit, find_crossing_saddle
from .orbits import PeriodicOrbit

# Branches are followed up to this lean [rad] and this number of orbits.
_LARGEST_AMPLITUDE, _MOST_ORBITS = 0.1, 200
_FIRST_AMPLITUDE = 2.5e-4  # at which the amplitude law is a good guess even next to a point where it degenerates [rad]
_LONGEST_STEP = 0.025  # along a branch, so that drawn curves bend by some degrees from one orbit to the next


@dataclass(frozen=True, eq=False)
class BoundedCircle:
    """A stable circle and the unstable orbit that bounds it.

    Attributes
    ----------
    state : ndarray, shape (7,)
        The independent variables `velodrome.reference.stability.VARIABLES` of the circle.
    energy : float
        Of both [J].
    orbit : PeriodicOrbit or None
        The smallest unstable orbit of this energy on the branches that were searched; None if there is none.
    why_not : str or None
        Why no orbit is known.
    """

    state: np.ndarray
    energy: float
    orbit: PeriodicOrbit | None
    why_not: str | None = None

    @property
    def stable_within(self) -> float | None:
        """Lean amplitude of the orbit [rad]."""
        return None if self.orbit is None else self.orbit.lean_amplitude


def follow_branch(
    point: HopfPoint, largest: float = _LARGEST_AMPLITUDE, stop: Callable[[OrbitBranch], bool] = lambda _: False
) -> OrbitBranch:
    """Follow the orbits born at a Hopf point as far as they may bound stable circles.

    Parameters
    ----------
    point : HopfPoint
    largest, stop
        See `follow_orbits`.

    Returns
    -------
    OrbitBranch

    Raises
    ------
    ValueError
        If no orbits are known there, with the reason.
    """
    if point.amplitude_slope is None:
        raise ValueError(point.why_undefined)
    return follow_orbits(point, largest, _FIRST_AMPLITUDE, _LONGEST_STEP, _MOST_ORBITS, stop)


def bound_circle(equations: Steady, motion: CircularMotion) -> BoundedCircle:
    """Find the orbit that bounds a stable circle.

    The branches born at both ends of the circle's stable section are followed up to the first unstable orbit of its
    energy.

    Parameters
    ----------
    equations : Steady
    motion : CircularMotion
        Lyapunov stable.

    Returns
    -------
    BoundedCircle

    Raises
    ------
    ValueError
        If the rear wheel stands.
    """
    circle = BoundedCircle(independent(*motion.state()), energy_level(equations, motion).energy, None)
    why = explain_undefined(equations)
    if why is not None:
        return replace(circle, why_not=why)
    unknowns = find_unknowns(equations, motion)
    curve = trace_through(equations, unknowns)
    place = next(k for k, point in enumerate(curve.points) if are_same_solution(point.unknowns, unknowns))
    around = [ends for ends in stable_sections(curve) if ends[0].place < place <= ends[1].place]
    reasons, orbits = [], []
    for end in (end for ends in around for end in ends if end.cause == "hopf"):
        try:
            orbits += _find_first_saddle(examine_end(curve, end), circle.energy)
        except ValueError as error:
            reasons.append(str(error))
    if orbits:
        return replace(circle, orbit=min(orbits, key=_amplitude))
    none = "no unstable orbit of its energy is on the branches born at the ends of its stable section"
    return replace(circle, why_not="; ".join([none, *dict.fromkeys(reasons)]))


def _find_first_saddle(point: HopfPoint, energy: float) -> list[PeriodicOrbit]:
    """Return the first unstable orbit of an energy [J] on the branch born at a Hopf point, if there is one."""
    found: list[PeriodicOrbit] = []

    def stop(branch: OrbitBranch) -> bool:
        found.extend(find_crossing_saddle(branch, energy))
        return bool(found)

    follow_branch(point, stop=stop)
    return found


def bound_section(
    family: Family, section: tuple[SectionEnd, SectionEnd], branches: Sequence[OrbitBranch], count: int
) -> list[BoundedCircle]:
    """Find the orbits that bound the circles of a stable section.

    The energy is monotonic along a stable section, since an eigenvalue passes zero where it is extreme. So the circles
    are those of equidistant energies.

    Parameters
    ----------
    family : Family
    section : tuple of SectionEnd
    branches : sequence of OrbitBranch
        Of orbits that may bound the circles, as those born at the section's ends.
    count : int
        Number of circles, the ends not counted.

    Returns
    -------
    list of BoundedCircle
        In order along the section.

    Raises
    ------
    ValueError
        If the rear wheel stands at an end, or a circle is not found.
    """
    first, last = (energy_level(family.equations, end.motion) for end in section)
    found = []
    for share in np.arange(1, count + 1) / (count + 1):
        energy = float(first.energy + share * (last.energy - first.energy))
        orbits = [find_bounding_orbit(branch, energy) for branch in branches]
        smallest = min((orbit for orbit in orbits if orbit is not None), key=_amplitude, default=None)
        found.append(BoundedCircle((first if share <= 0.5 else last).circle(energy), energy, smallest))
    return found


def _amplitude(orbit: PeriodicOrbit) -> float:
    return orbit.lean_amplitude
