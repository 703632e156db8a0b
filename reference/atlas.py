"""The atlas of circular motions: every family from end to end over alpha, and where and why it is stable."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .anchors import ANCHORS, Anchor, anchor, next_anchor
from .bicycle import Bicycle
from .circular import Steady
from .critical import CriticalPoint, reconnections, vanishing_between
from .curve import Samples
from .families import FAMILIES, trace_from
from .rideability import Rideability
from .rideable_parts import assess_family
from .sections import SectionEnd, sample_family, stable_sections
from .surface import Paraboloid

ATLAS_SIZE = 400_000
_CROWDED = 0.04  # the last stable section vanishes at 0.033, the cusps meet at 0.017
_ARC = 38.0  # arclength of all four families together, a mean over alpha
_LONGEST_STEP = 0.05  # of the arc: every known section is long enough to be found with this step


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
    """

    alpha: float
    family: int
    ends: tuple[str, str]
    samples: Samples
    rideability: Rideability
    sections: list[tuple[SectionEnd, SectionEnd]]


@dataclass(frozen=True)
class Boundary:
    """The two ends of a stable section, followed over alpha.

    Attributes
    ----------
    family : int
    alpha : list of float
        [1/m].
    ends : list of (SectionEnd, SectionEnd)
        At each alpha, in the order of the family's points.
    vanishing : CriticalPoint or None
        Where both ends meet and the section vanishes as alpha grows; None where it reaches the last alpha, and where
        the point is not solved.
    """

    family: int
    alpha: list[float]
    ends: list[tuple[SectionEnd, SectionEnd]]
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
    return AtlasCurve(alpha, number, family.ends, seen, assess_family(family), sections)


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

    A point at which the last one vanishes, and which cannot be solved, is added to ``absent``.
    """
    found: list[Boundary] = []
    current: list[Boundary] = []
    before = None
    for curve in (curve for curve in curves if curve.family == number):
        if len(curve.sections) != len(current):
            if before is not None and current and not curve.sections:
                try:
                    closing = vanishing_between(bicycle, number, before.alpha, curve.alpha)
                    found[-1] = replace(found[-1], vanishing=closing)
                except ValueError as error:
                    absent.append(Absence(before.alpha, number, str(error)))
            current = [Boundary(number, [], [], None) for _ in curve.sections]
            found += current
        for boundary, ends in zip(current, curve.sections, strict=True):
            boundary.alpha.append(curve.alpha)
            boundary.ends.append(ends)
        before = curve
    return found
