"""The atlas of circular motions: every family from end to end over alpha, and where and why it is stable."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .anchors import ANCHORS, Anchor, anchor, next_anchor
from .bicycle import Bicycle
from .bifurcations.bautin import BautinPoint, changes_criticality, solve_bautin
from .bifurcations.hopf import HopfPoint, examine_end
from .circular import Steady
from .critical import CriticalPoint, reconnections, vanishing_between
from .curve import Samples
from .families import FAMILIES, Family, trace, trace_from
from .rideability import Rideability
from .rideable_parts import assess_family
from .sections import SectionEnd, sample_family, stable_sections
from .surface import Paraboloid

ATLAS_SIZE = 400_000
SIDES = ("start", "end")  # of a stable section, in the order of the family's points
_CROWDED = 0.04  # the last stable section vanishes at 0.033, the cusps meet at 0.017
# Distances in alpha from the point where a section vanishes, of that from the last shape before it, at which the
# criticality of its ends is looked at.
_LEFT = (0.1, 1e-2, 1e-3, 1e-4)
_ARC = 38.0  # arclength of all four families together, a mean over alpha
_LONGEST_STEP = 0.05  # of the arc: every known section is long enough to be found with this step

Section = tuple[SectionEnd, SectionEnd]
HopfPair = tuple[HopfPoint | None, HopfPoint | None]
Ends = tuple[float, list[HopfPair]]  # a shape [1/m], and the Hopf points at the ends of a family's stable sections


@dataclass(frozen=True)
class AtlasCurve:
    """One family at one alpha, sampled.

    Attributes
    ----------
    alpha : float
        [1/m].
    family : int
    ends : tuple of str
        See `velodrome.reference.families.Family`.
    samples : Samples
        Its motions in the order of the curve.
    rideability : Rideability
        Whether the motions can be ridden, and what friction they need.
    sections : list of (SectionEnd, SectionEnd)
        Its stable sections, their ends solved to round-off.
    hopf : list of (HopfPoint or None, HopfPoint or None)
        Criticality and amplitude at their ends; None where an end is no Hopf point.
    """

    alpha: float
    family: int
    ends: tuple[str, str]
    samples: Samples
    rideability: Rideability
    sections: list[Section]
    hopf: list[HopfPair]


@dataclass(frozen=True)
class Boundary:
    """The two ends of a stable section, followed over alpha.

    Attributes
    ----------
    family : int
    alpha : list of float
        Those of the curves and, before the section vanishes, some between the last of these and that point [1/m].
    ends : list of (SectionEnd, SectionEnd)
        At each alpha, in the order of the family's points.
    hopf : list of (HopfPoint or None, HopfPoint or None)
        The same of `AtlasCurve.hopf`.
    bautin : list of (str, BautinPoint)
        Where an end changes its criticality: the side, of `SIDES`, and the degenerate Hopf point, by rising alpha.
    vanishing : CriticalPoint or None
        Where both ends meet and the section vanishes as alpha grows; None where it reaches the last alpha, and where
        the point is not solved.
    """

    family: int
    alpha: list[float]
    ends: list[Section]
    hopf: list[HopfPair]
    bautin: list[tuple[str, BautinPoint]]
    vanishing: CriticalPoint | None


@dataclass(frozen=True)
class Absence:
    """A family that has no curve at an alpha, or a point of it that is not solved there, and why."""

    alpha: float
    family: int
    reason: str


@dataclass(frozen=True)
class Atlas:
    """All curves, the boundaries of their stable sections, and the points where families touch.

    Attributes
    ----------
    bicycle : Bicycle
    alphas : ndarray, shape (k,)
        Rising [1/m].
    curves : list of AtlasCurve
        In order of rising alpha, then family.
    absent : list of Absence
    boundaries : list of Boundary
    reconnections : list of CriticalPoint
        Where families touch and exchange their parts, within the alphas.
    """

    bicycle: Bicycle
    alphas: np.ndarray
    curves: list[AtlasCurve]
    absent: list[Absence]
    boundaries: list[Boundary]
    reconnections: list[CriticalPoint]

    @property
    def size(self) -> int:
        """Number of motions."""
        return sum(len(curve.samples.lean) for curve in self.curves)


def spacing(size: int = ATLAS_SIZE, largest: float = 1.0) -> tuple[np.ndarray, float]:
    """Choose the shapes and the longest step of the arc for an atlas of about ``size`` motions.

    Half of the shapes lie evenly between 0 and 0.04, where the stable sections and the cusps vanish, the others evenly
    in log alpha up to the largest.

    Returns
    -------
    alphas : ndarray
        Rising from 0 [1/m].
    longest : float
    """
    shapes = max(4, round(min(np.sqrt(size / 2.5), size * _LONGEST_STEP / _ARC)))
    if largest <= _CROWDED:
        return np.linspace(0.0, largest, shapes), min(_LONGEST_STEP, _ARC * shapes / size)
    crowded = np.linspace(0.0, _CROWDED, shapes // 2, endpoint=False)
    alphas = np.concatenate([crowded, np.geomspace(_CROWDED, largest, shapes - len(crowded))])
    return alphas, min(_LONGEST_STEP, _ARC * shapes / size)


def compute_atlas(
    bicycle: Bicycle,
    alphas: Sequence[float] | np.ndarray,
    longest: float,
    progress: Callable[[float], None] = lambda _: None,
) -> Atlas:
    """Compute the atlas of a bicycle on paraboloids.

    Parameters
    ----------
    bicycle : Bicycle
    alphas : sequence of float
        Rising shapes [1/m].
    longest : float
        Longest step along a family's arc.
    progress : callable
        Called with the fraction done.

    Returns
    -------
    Atlas

    Raises
    ------
    ValueError
        If no family has a curve at any alpha.
    """
    curves: list[AtlasCurve] = []
    absent: list[Absence] = []
    anchors: dict[float | None, tuple[float, np.ndarray]] = {}
    for k, alpha in enumerate(map(float, alphas)):
        for family in FAMILIES:
            try:
                curves.append(_compute_curve(bicycle, alpha, family, longest, anchors))
            except ValueError as error:
                absent.append(Absence(alpha, family, str(error)))
        progress(0.9 * (k + 1) / len(alphas))
    if not curves:
        raise ValueError(f"the bicycle has none of the families: {absent[0].reason}")
    largest = float(alphas[-1])
    touching = reconnections(bicycle, largest=largest)
    progress(0.95)
    boundaries = [boundary for family in FAMILIES for boundary in _follow_boundaries(bicycle, curves, family, absent)]
    progress(1.0)
    return Atlas(bicycle, np.asarray(alphas, float), curves, absent, boundaries, touching)


def _compute_curve(
    bicycle: Bicycle, alpha: float, number: int, longest: float, anchors: dict[float | None, tuple[float, np.ndarray]]
) -> AtlasCurve:
    """Compute one family at one alpha.

    Its anchor is carried from the last alpha, where ``anchors`` holds it, and the new one replaces it there.
    """
    rear_rate = ANCHORS[number][-1]
    start = _carry_anchor(bicycle, alpha, number, anchors.pop(rear_rate, None))
    anchors[rear_rate] = alpha, start.unknowns
    family = trace_from(start, longest)
    seen = sample_family(family)
    sections = stable_sections(family, seen.growth_rate)
    hopf = _examine_sections(family, sections)
    return AtlasCurve(alpha, number, family.ends, seen, assess_family(family), sections, hopf)


def _examine_sections(family: Family, sections: list[Section]) -> list[HopfPair]:
    """Compute criticality and amplitude at the ends of stable sections, where they are Hopf points."""
    found = [[examine_end(family, end) if end.cause == "hopf" else None for end in ends] for ends in sections]
    return [(start, end) for start, end in found]


def _carry_anchor(bicycle: Bicycle, alpha: float, number: int, known: tuple[float, np.ndarray] | None) -> Anchor:
    rear_rate = ANCHORS[number][-1]
    if known is not None:
        low, unknowns = known
        try:
            return next_anchor(
                lambda s: Steady(bicycle, Paraboloid(low + s * (alpha - low))), number, rear_rate, unknowns
            )
        except ValueError:
            pass  # one pivoting motion has vanished; there may be another
    return anchor(bicycle, Paraboloid(alpha), number, rear_rate)


def _follow_boundaries(
    bicycle: Bicycle, curves: list[AtlasCurve], number: int, absent: list[Absence]
) -> list[Boundary]:
    """Follow the stable sections of a family, each from its first alpha to its last.

    A point at which the last one vanishes or an end changes its criticality, and which cannot be solved, is added to
    ``absent``.
    """
    found: list[Boundary] = []
    current: list[Boundary] = []
    before = None
    for curve in (curve for curve in curves if curve.family == number):
        if before is None or len(curve.sections) != len(current):
            if before is not None and current and not curve.sections:
                found[-1] = _close_boundary(bicycle, current, before, curve.alpha, absent)
            current = [Boundary(number, [], [], [], [], None) for _ in curve.sections]
            found += current
        else:
            _add_bautin_points(bicycle, current, (before.alpha, before.hopf), (curve.alpha, curve.hopf), absent)
        _append_shape(current, curve.alpha, curve.sections, curve.hopf)
        before = curve
    return found


def _append_shape(boundaries: list[Boundary], alpha: float, sections: list[Section], hopf: list[HopfPair]) -> None:
    """Append the ends of a family's stable sections at one shape to their boundaries."""
    for boundary, ends, points in zip(boundaries, sections, hopf, strict=True):
        boundary.alpha.append(alpha)
        boundary.ends.append(ends)
        boundary.hopf.append(points)


def _close_boundary(
    bicycle: Bicycle, boundaries: list[Boundary], last: AtlasCurve, unstable: float, absent: list[Absence]
) -> Boundary:
    """Return the last of a family's boundaries with the point at which it vanishes.

    That lies between the last alpha of the boundaries and an alpha without a stable section.
    """
    boundary, number = boundaries[-1], last.family
    try:
        closing = vanishing_between(bicycle, number, last.alpha, unstable)
    except ValueError as error:
        absent.append(Absence(last.alpha, number, str(error)))
        return boundary
    try:
        _follow_to_vanishing(bicycle, boundaries, last, closing, absent)
    except ValueError as error:
        absent.append(Absence(last.alpha, number, f"its ends are not followed to alpha = {closing.alpha:.9g}: {error}"))
    return replace(boundary, vanishing=closing)


def _follow_to_vanishing(
    bicycle: Bicycle, boundaries: list[Boundary], last: AtlasCurve, closing: CriticalPoint, absent: list[Absence]
) -> None:
    """Append shapes between the last one of a family's boundaries and the point where the last of them vanishes.

    Raises
    ------
    ValueError
        If the family cannot be followed there, or the ends' criticality is not the same where they meet.
    """
    before: Ends = last.alpha, last.hopf
    for left in _LEFT:
        alpha = closing.alpha - left * (closing.alpha - last.alpha)
        family = trace(bicycle, Paraboloid(alpha), last.family)
        sections = stable_sections(family)
        here: Ends = alpha, _examine_sections(family, sections)
        _add_bautin_points(bicycle, boundaries, before, here, absent)
        if len(sections) == len(boundaries):
            _append_shape(boundaries, alpha, sections, here[1])
        before = here
        # Where the ends meet at a single pair of eigenvalues, their criticality is the same.
        if closing.kind != "tangency" or not any(a and b and changes_criticality(a, b) for a, b in here[1]):
            return
    raise ValueError(f"their criticality is not the same at alpha = {before[0]:.9g}")


def _add_bautin_points(
    bicycle: Bicycle, boundaries: list[Boundary], low: Ends, high: Ends, absent: list[Absence]
) -> None:
    """Solve for the degenerate Hopf points between two neighbouring shapes, and add them to their boundaries."""
    sides = [[point for points in hopf for point in points] for _, hopf in (low, high)]
    places = [[point is not None for point in side] for side in sides]
    if places[0] != places[1]:  # what ends a section has changed, as next to the plane
        return
    for k, (before, after) in enumerate(zip(*sides, strict=True)):
        if before is not None and after is not None and changes_criticality(before, after):
            family, place = boundaries[0].family, sum(places[0][:k])
            try:
                solved = solve_bautin(bicycle, family, place, (low[0], before), (high[0], after))
                boundaries[k // 2].bautin.append((SIDES[k % 2], solved))
            except ValueError as error:
                absent.append(Absence(low[0], family, str(error)))
