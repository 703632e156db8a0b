"""The motion of a family that has a given energy."""

from __future__ import annotations

from itertools import pairwise

from reference.circular import LEAN, CircularMotion
from reference.continuation import Point, root_between
from reference.curve import sample
from reference.families import Family
from reference.sections import sample_family


def motion_of_energy(family: Family, energy: float, near: CircularMotion) -> CircularMotion:
    """Solve for the motion of a family with an energy [J], of several the nearest in lean to another.

    Raises
    ------
    ValueError
        If the family has none.
    """

    def excess(point: Point) -> float:
        return float(sample(family.equations, point.unknowns[None]).energy[0]) - energy

    values = sample_family(family).energy - energy
    brackets = [pair for k, pair in enumerate(pairwise(family.points)) if values[k] * values[k + 1] < 0]
    if not brackets:
        raise ValueError(f"no motion of family {family.number} has an energy of {energy!r} J")
    first, second = min(brackets, key=lambda pair: abs(pair[0].unknowns[LEAN] - near.lean))
    return family.equations.motion(root_between(family.equations, first, second, excess).unknowns)
