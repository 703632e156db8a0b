"""The modes of a family's motions: names of their eigenvalues, followed by continuity."""

from __future__ import annotations

from dataclasses import replace
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
_SAME = 1e-9  # relative round-off of an eigenvalue's imaginary part, or between the halves of a pair
# Steps from the plane to a bowl: on a paraboloid at alpha = 1, eigenvalues then move in one step by less than a tenth
# of their distances.
_STEPS = 40


def follow_modes(family: Family) -> np.ndarray:
    """Compute the eigenvalues along a family, each in the column of its mode.

    The modes are identified on the level plane, at the family's anchor: beside the family's zero, a pair of +-i times
    the yaw rate is the orbital mode (the circle's centre is free), and the fastest real root is castering. The others
    are weave, a pair, and capsize, a real root. From there the eigenvalues are followed by continuity, with the anchor
    to the bowl and from it along the curve both ways. On a curve that does not pass through the first anchor of its
    number (a part that families left behind) the modes are identified at the point where one of two pairs is by far
    the nearer to +-i times the yaw rate.

    Parameters
    ----------
    family : Family

    Returns
    -------
    ndarray, shape (n, 7), complex
        Columns family, castering, capsize, weave (2), orbital (2). Of a pair, the half with positive imaginary part
        comes first; of two real roots, the smaller.
    """
    seen = sample_family(family)
    start, named = _identify_at_anchor(family) or _identify_at_clearest(seen.eigenvalues, seen.yaw_rate)
    rows = np.empty((len(seen.eigenvalues), 7), complex)
    rows[start] = _order_like(named, seen.eigenvalues[start])
    for k in range(start + 1, len(rows)):
        rows[k] = _order_like(rows[k - 1], seen.eigenvalues[k])
    for k in range(start - 1, -1, -1):
        rows[k] = _order_like(rows[k + 1], seen.eigenvalues[k])
    return rows


def _identify_at_anchor(family: Family) -> tuple[int, np.ndarray] | None:
    """Return the index of the family's anchor among its points and the eigenvalues there by mode; None without one."""
    if family.number is None:
        return None
    equations, rate = family.equations, ANCHORS[family.number][0]
    bicycle, surface = equations.bicycle, equations.surface
    try:
        here = anchor(bicycle, Plane(), family.number, rate)
        named = _identify_modes(*_sample_anchor(here, equations))
        for k in range(0 if is_level(surface) else _STEPS):
            between = [k / _STEPS, (k + 1) / _STEPS]
            here = next_anchor(
                lambda s, ends=between: Steady(bicycle, surface.flattened(np.interp(s, (0, 1), ends))),
                family.number,
                rate,
                here.unknowns,
            )
            named = _order_like(named, _sample_anchor(here, equations)[0])
    except ValueError:
        return None
    met = [k for k, point in enumerate(family.points) if here.is_same_as(point.unknowns)]
    return (met[0], named) if met else None


def _sample_anchor(here: Anchor, equations: Steady) -> tuple[np.ndarray, float]:
    """Return the eigenvalues and the yaw rate at an anchor, with the inputs of a family's equations."""
    seen = sample_curve(replace(here.equations, inputs=equations.inputs), here.unknowns[None])
    return seen.eigenvalues[0], float(seen.yaw_rate[0])


def _identify_at_clearest(eigenvalues: np.ndarray, yaw_rate: np.ndarray) -> tuple[int, np.ndarray]:
    points = list(zip(eigenvalues, yaw_rate.tolist(), strict=True))
    plainest = int(np.argmax([_rate_clarity(*point) for point in points]))
    return plainest, _identify_modes(*points[plainest])


def _rate_clarity(eigenvalues: np.ndarray, yaw_rate: float) -> float:
    """Rate how clearly the modes can be told apart, at most 1.

    Negative where there are not two pairs, lowest where the bicycle is at rest.
    """
    if yaw_rate == 0:
        return -2.0
    rest = _separate_zero(eigenvalues)[1]
    upper = rest[_are_complex(rest) & (np.imag(rest) > 0)]
    if len(upper) != 2:
        return -1.0
    near, far = sorted(np.abs(upper - 1j * abs(yaw_rate)))
    return float(1 - near / far)


def _order_like(neighbour: np.ndarray, eigenvalues: np.ndarray) -> np.ndarray:
    """Order eigenvalues (7,) by the columns of a neighbour's modes.

    The order chosen is the one nearest to the neighbour as a whole, but no pair is split: weave and orbital are each a
    pair or two real roots, and so are castering and capsize, which may meet and become complex as well. The two halves
    have an order of their own, since a pair that becomes two real roots is equally near to them either way round.
    Distances are squared: their plain sum is the same for two real roots that pass a third, in either order.
    """
    zero, rest = _separate_zero(eigenvalues)
    first, second = rest[_ORDERS[:, 0::2]], rest[_ORDERS[:, 1::2]]
    real = ~_are_complex(rest)
    pair = np.abs(first - np.conj(second)) <= _SAME * (1 + np.abs(first))
    two = real[_ORDERS[:, 0::2]] & real[_ORDERS[:, 1::2]] & ~pair
    ordered = (pair & (np.imag(first) >= np.imag(second))) | (two & (np.real(first) < np.real(second)))
    cost = (np.abs(rest[_ORDERS] - neighbour[1:]) ** 2).sum(axis=1)
    best = np.where(ordered.all(axis=1), cost, np.inf).argmin()
    return np.append(zero, rest[_ORDERS[best]])


def _separate_zero(eigenvalues: np.ndarray) -> tuple[complex, np.ndarray]:
    """Separate the family's zero from the six other eigenvalues.

    Where a root passes zero, continuity cannot tell it from the family's own zero, and round-off may turn the two into
    a pair. Values that are zero but for round-off are therefore taken as real.
    """
    values = np.where(are_zero(eigenvalues), np.real(eigenvalues), eigenvalues)
    nearest = np.abs(values).argmin()
    return values[nearest], np.delete(values, nearest)


def _are_complex(eigenvalues: np.ndarray) -> np.ndarray:
    """Return which of the eigenvalues are complex."""
    return np.abs(np.imag(eigenvalues)) > _SAME * (1 + np.abs(eigenvalues))


def _identify_modes(eigenvalues: np.ndarray, yaw_rate: float) -> np.ndarray:
    """Order eigenvalues by mode, where the modes can be told apart by their values alone."""
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
