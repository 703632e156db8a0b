"""The modes of a family's motions: what their eigenvalues are called, followed by continuity."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from .anchors import ANCHORS, Anchor, anchor, next_anchor
from .circular import Steady
from .curve import sample_curve
from .families import Family
from .sections import sample_family
from .stability import are_zero
from .surface import Plane, is_level

MODES = ("family", "castering", "capsize", "weave", "weave", "orbital", "orbital")
_ORDERS = np.array(list(permutations(range(6))))  # of six values in the columns after the family's zero
_SAME = 1e-9  # of an eigenvalue: what round-off leaves of an imaginary part, or between a pair's halves
# From the plane to a bowl: on a paraboloid at alpha = 1, eigenvalues move by less than a tenth of their distances in
# one of so many steps.
_STEPS = 40


def follow_modes(family: Family) -> np.ndarray:
    """Eigenvalues along a family with their modes.

    They are plain on the level plane, at the family's anchor: beside the family's zero a pair is +-i times the yaw
    rate, the orbital one (the circle's centre is free); the fastest real root is castering. What is left are the weave,
    a pair, and capsize, real. From there they are followed by continuity, with the anchor to the bowl and from it
    along the curve both ways. A curve that its number's first anchor does not lie on (a part that families left
    behind) is named where of two pairs one is by far the nearer to +-i times the yaw rate.

    Parameters
    ----------
    family : Family

    Returns
    -------
    ndarray, shape (n, 7), complex
        Columns family, castering, capsize, weave (2), orbital (2). Of a pair the half of positive imaginary part
        stands first, of two real roots the lesser.
    """
    seen = sample_family(family)
    start, named = _at_the_anchor(family) or _at_the_plainest(seen.eigenvalues, seen.yaw_rate)
    rows = np.empty((len(seen.eigenvalues), 7), complex)
    rows[start] = _continued(named, seen.eigenvalues[start])
    for k in range(start + 1, len(rows)):
        rows[k] = _continued(rows[k - 1], seen.eigenvalues[k])
    for k in range(start - 1, -1, -1):
        rows[k] = _continued(rows[k + 1], seen.eigenvalues[k])
    return rows


def _at_the_anchor(family: Family) -> tuple[int, np.ndarray] | None:
    """Index of the family's anchor among its points and the named eigenvalues there; None where it has none."""
    equations, rate = family.equations, ANCHORS[family.number][0]
    bicycle, surface = equations.bicycle, equations.surface
    try:
        here = anchor(bicycle, Plane(), family.number, rate)
        named = _named(*_spectrum(here))
        for k in range(0 if is_level(surface) else _STEPS):
            between = [k / _STEPS, (k + 1) / _STEPS]
            here = next_anchor(
                lambda s, ends=between: Steady(bicycle, surface.flattened(np.interp(s, (0, 1), ends))),
                family.number,
                rate,
                here.unknowns,
            )
            named = _continued(named, _spectrum(here)[0])
    except ValueError:
        return None
    met = [k for k, point in enumerate(family.points) if here.met_by(point.unknowns)]
    return (met[0], named) if met else None


def _spectrum(here: Anchor) -> tuple[np.ndarray, float]:
    seen = sample_curve(here.equations, here.unknowns[None])
    return seen.eigenvalues[0], float(seen.yaw_rate[0])


def _at_the_plainest(eigenvalues: np.ndarray, yaw_rate: np.ndarray) -> tuple[int, np.ndarray]:
    points = list(zip(eigenvalues, yaw_rate.tolist(), strict=True))
    plainest = int(np.argmax([_plainness(*point) for point in points]))
    return plainest, _named(*points[plainest])


def _plainness(eigenvalues: np.ndarray, yaw_rate: float) -> float:
    """How plain the modes are, at most 1; below 0 where there are not two pairs, least where the bicycle stands."""
    if yaw_rate == 0:
        return -2.0
    rest = _without_zero(eigenvalues)[1]
    upper = rest[_turning(rest) & (np.imag(rest) > 0)]
    if len(upper) != 2:
        return -1.0
    near, far = sorted(np.abs(upper - 1j * abs(yaw_rate)))
    return float(1 - near / far)


def _continued(neighbour: np.ndarray, eigenvalues: np.ndarray) -> np.ndarray:
    """Eigenvalues (7,) in the columns of the neighbour's modes.

    As a whole they lie nearest to the neighbour's, but no pair is torn apart: weave and orbital are each a pair or
    two real roots, and so are castering and capsize, which may meet and turn as well. The halves of each have an order
    of their own, since a pair that turns into two real roots is as near to them one way round as the other. Distances
    count by their squares: their plain sum is the same for two real roots that pass a third, whichever is which.
    """
    zero, rest = _without_zero(eigenvalues)
    first, second = rest[_ORDERS[:, 0::2]], rest[_ORDERS[:, 1::2]]
    real = ~_turning(rest)
    pair = np.abs(first - np.conj(second)) <= _SAME * (1 + np.abs(first))
    two = real[_ORDERS[:, 0::2]] & real[_ORDERS[:, 1::2]] & ~pair
    ordered = (pair & (np.imag(first) >= np.imag(second))) | (two & (np.real(first) < np.real(second)))
    cost = (np.abs(rest[_ORDERS] - neighbour[1:]) ** 2).sum(axis=1)
    best = np.where(ordered.all(axis=1), cost, np.inf).argmin()
    return np.append(zero, rest[_ORDERS[best]])


def _without_zero(eigenvalues: np.ndarray) -> tuple[complex, np.ndarray]:
    """The family's zero and the six others.

    Where a root passes zero, continuity cannot tell it from the family's own zero, and round-off may make a pair of
    the two: what is zero is taken for real.
    """
    values = np.where(are_zero(eigenvalues), np.real(eigenvalues), eigenvalues)
    nearest = np.abs(values).argmin()
    return values[nearest], np.delete(values, nearest)


def _turning(eigenvalues: np.ndarray) -> np.ndarray:
    """Which of the eigenvalues are complex."""
    return np.abs(np.imag(eigenvalues)) > _SAME * (1 + np.abs(eigenvalues))


def _named(eigenvalues: np.ndarray, yaw_rate: float) -> np.ndarray:
    rest = list(eigenvalues)

    def take(target: complex) -> complex:
        nearest = min(rest, key=lambda value: abs(value - target))
        rest.remove(nearest)
        return nearest

    zero = take(0)
    orbital = [take(complex(0, yaw_rate)), take(complex(0, -yaw_rate))]
    castering = take(min(value.real for value in rest))
    capsize = take(min((value for value in rest), key=lambda value: (abs(value.imag), -value.real)))
    halves = [sorted(pair, key=lambda value: (-value.imag, value.real)) for pair in (rest, orbital)]
    return np.array([zero, castering, capsize, *halves[0], *halves[1]])
