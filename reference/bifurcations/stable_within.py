"""How far from a stable circle a bicycle may weave and come back: the unstable orbits that bound a stable section."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..families import Family
from ..sections import SectionEnd
from .energy_level import energy_level
from .orbit_branch import OrbitBranch
from .orbit_search import find_bounding_orbit
from .orbits import PeriodicOrbit


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
    """

    state: np.ndarray
    energy: float
    orbit: PeriodicOrbit | None

    @property
    def stable_within(self) -> float | None:
        """Lean amplitude of the orbit [rad]."""
        return None if self.orbit is None else self.orbit.lean_amplitude


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
