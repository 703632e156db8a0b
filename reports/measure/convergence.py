"""Observe the order of a sequence of results with halved steps, and extrapolate its limit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

_LEAST_ORDER = 0.5  # a sequence that converges more slowly is noise, or has not begun to converge


@dataclass(frozen=True)
class RichardsonLimit:
    """Extrapolated limit of a sequence.

    Attributes
    ----------
    value : ndarray
        Array of the shape of the sequence's members.
    uncertainty : float
        Largest change by the last extrapolation.
    """

    value: np.ndarray
    uncertainty: float


def observed_orders(values: Sequence[np.ndarray]) -> list[float]:
    """Return the order observed in each three successive members, log2 |v1 - v0| / |v2 - v1|.

    This needs no reference: an engine that converges to another limit shows its order all the same.

    Parameters
    ----------
    values : sequence of ndarray
        Results of one shape, each with half the step of the one before.

    Returns
    -------
    list of float
        Two fewer than the sequence has members; NaN where two members are equal.
    """
    moves = [_largest_entry(b - a) for a, b in pairwise(values)]
    return [float(np.log2(a / b)) if a > 0 and b > 0 else np.nan for a, b in pairwise(moves)]


def extrapolate(values: Sequence[np.ndarray]) -> RichardsonLimit:
    """Extrapolate a sequence with halved steps by Richardson's method.

    Each column of the table removes the power of the step that its own last three entries show, rounded to an integer,
    as in an expansion in powers of the step. The last column shows no power any more and removes the next one.
    Extrapolation ends where it changes the result by more than the column before did: the rest is then not a power
    of the step but round-off or unconverged iterations.

    Parameters
    ----------
    values : sequence of ndarray
        At least two results of one shape, each with half the step of the one before.

    Returns
    -------
    RichardsonLimit
    """
    column = [np.asarray(value, float) for value in values]
    best = RichardsonLimit(column[-1], _largest_entry(column[-1] - column[-2]))
    power = 0
    while len(column) > 1:
        orders = observed_orders(column[-3:])
        if orders and not orders[0] > _LEAST_ORDER:
            break
        if not orders and power == 0:
            break  # two members show no order at all
        power = max(round(orders[0]), power + 1) if orders else power + 1
        column = [b + (b - a) / (2**power - 1) for a, b in pairwise(column)]
        moved = _largest_entry(column[-1] - (column[-2] if len(column) > 1 else best.value))
        if moved >= best.uncertainty:
            break
        best = RichardsonLimit(column[-1], moved)
    return best


def _largest_entry(values: np.ndarray) -> float:
    return float(np.abs(values).max())
