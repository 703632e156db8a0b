"""The motion of a family that has a given energy."""

from __future__ import annotations

from ...reference.circular import LEAN, CircularMotion
from ...reference.continuation import Point, roots_along
from ...reference.curve import sample_curve
from ...reference.families import Family
from ...reference.sections import sample_family


def motion_of_energy(family: Family, energy: float, near: CircularMotion) -> CircularMotion:
    """Solve for the motion of a family with an energy [J]; of several, the one nearest in lean to another motion.

    Raises
    ------
    ValueError
        If the family has no such motion.
    """

    def excess(point: Point) -> float:
        return float(sample_curve(family.equations, point.unknowns[None]).energy[0]) - energy

    values = sample_family(family).energy - energy
    roots = [root for _, root in roots_along(family.equations, family.points, excess, values)]
    if not roots:
        raise ValueError(f"no motion of family {family.number} has an energy of {energy!r} J")
    nearest = min(roots, key=lambda point: abs(point.unknowns[LEAN] - near.lean))
    return family.equations.motion(nearest.unknowns)
