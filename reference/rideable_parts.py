"""Parts of a curve of circular motions that can be ridden, their ends solved to round-off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .circular import CircularMotion
from .continuation import Point, arc_distance, roots_along
from .families import Family
from .rideability import OBSTACLES, Rideability, assess_motions
from .sections import SectionEnd


@dataclass(frozen=True)
class PartEnd:
    """One end of a part of a curve that can be ridden.

    Attributes
    ----------
    cause : str
        The one of `velodrome.reference.rideability.OBSTACLES` that begins there, or what ends the whole: ``end`` for a
        curve, the cause of its end for a stable section.
    motion : CircularMotion
    """

    cause: str
    motion: CircularMotion


def assess_family(family: Family) -> Rideability:
    """Assess whether the motions at all points of a family can be ridden."""
    unknowns = np.array([point.unknowns for point in family.points])
    return assess_motions(family.equations.bicycle, family.equations.surface, unknowns)


def find_rideable_parts(family: Family) -> list[tuple[PartEnd, PartEnd]]:
    """Find the parts of a family that can be ridden, in the order of its points.

    A part shorter than the distance of two points may be missed.
    """
    motions = [family.equations.motion(family.points[k].unknowns) for k in (0, -1)]
    return _split(family, family.points, PartEnd("end", motions[0]), PartEnd("end", motions[1]))


def find_rideable_parts_of_section(
    family: Family, section: tuple[SectionEnd, SectionEnd]
) -> list[tuple[PartEnd, PartEnd]]:
    """Find the parts of a stable section of a family that can be ridden, in the order of its points."""
    start, end = section
    points = [start.point, *family.points[start.place + 1 : end.place + 1], end.point]
    return _split(family, points, PartEnd(start.cause, start.motion), PartEnd(end.cause, end.motion))


def _split(family: Family, points: Sequence[Point], first: PartEnd, last: PartEnd) -> list[tuple[PartEnd, PartEnd]]:
    """Return the parts of a followed curve in which all margins are positive."""
    equations = family.equations
    where = equations.bicycle, equations.surface
    margins = assess_motions(*where, np.array([point.unknowns for point in points])).margins

    def make_margin(k: int) -> Callable[[Point], float]:
        return lambda point: float(assess_motions(*where, point.unknowns[None]).margins[0, k])

    changes = []
    for k in range(len(OBSTACLES)):
        for i, root in roots_along(equations, points, make_margin(k), margins[:, k]):
            changes.append((i, arc_distance(points[i], root), k, root))
    blocking = {k for k, column in enumerate(margins.T) if not _first_sign(column) > 0}
    parts, start = [], None if blocking else first
    for *_, k, root in sorted(changes, key=lambda change: change[:3]):
        was_free = not blocking
        blocking ^= {k}
        here = PartEnd(OBSTACLES[k], equations.motion(root.unknowns))
        if was_free and start is not None:
            parts.append((start, here))
        start = None if blocking else here
    return parts if start is None else [*parts, (start, last)]


def _first_sign(values: np.ndarray) -> float:
    """Return the sign of the first value that is not zero."""
    signed = values[values != 0]
    return float(np.sign(signed[0])) if len(signed) else 0.0
