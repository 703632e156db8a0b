"""Explanations of wrong numbers: mirrored, swapped, scaled, shifted or late."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...reference.kinematics import COORDINATES

# A fault explains a difference if it leaves no more than this share of it.
EXPLAINED = 0.1
_LONGEST_LAG = 2.0  # in output intervals, each about as long as the longest steps
_UNITS = {180 / np.pi: "in degrees", np.pi / 180: "in radians twice over", 1e-3: "in thousands", 1e3: "in thousandths"}


def rate_names() -> list[str]:
    """Return the names of the nine rates."""
    return [f"the rate of {name}" for name in COORDINATES]


def size_of(values: np.ndarray) -> float:
    """Return the root of the sum of squares, or inf if a value is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        size = float(np.sqrt(np.sum(np.square(values))))
    return size if np.isfinite(size) else np.inf


def explains(given: np.ndarray, guess: np.ndarray, expected: np.ndarray) -> bool:
    """Return whether a guess leaves at most `EXPLAINED` of the difference between given and expected values."""
    return size_of(given - guess) <= EXPLAINED * size_of(given - expected)


def fit_factor(given: np.ndarray, expected: np.ndarray) -> float | None:
    """Return the factor that turns ``expected`` into ``given``, or None if no factor explains the difference."""
    square = float(np.sum(expected * expected))
    if not 0 < square < np.inf:
        return None
    factor = float(np.sum(given * expected)) / square
    return factor if np.isfinite(factor) and explains(given, factor * expected, expected) else None


def fit_lag(given: np.ndarray, expected: np.ndarray, time: np.ndarray) -> float | None:
    """Return by how much samples (n, ...) from the second on are late [s], or None if no lag explains the difference.

    A lag longer than two output intervals is not accepted, nor one that explains no more than a constant does.
    """
    if len(time) < 4:
        return None
    slope = np.gradient(expected, time, axis=0, edge_order=2)[1:]
    apart, square = (given - expected)[1:], float(np.sum(slope * slope))
    if not 0 < square < np.inf:
        return None
    lag = -float(np.sum(apart * slope)) / square
    if not np.isfinite(lag):
        return None
    left, constant = size_of(apart + lag * slope), size_of(apart - apart.mean(axis=0))
    # The first-order shift neglects the curvature of the samples over the lag.
    bend = 0.5 * lag * lag * size_of(np.gradient(slope, time[1:], axis=0))
    explained = left <= EXPLAINED * size_of(apart) + bend and left <= constant
    return lag if explained and abs(lag) <= _LONGEST_LAG * float(np.max(np.diff(time))) else None


def explain_numbers(
    given: np.ndarray, expected: np.ndarray, off: Sequence[int], names: Sequence[str], factors: bool = True
) -> Iterator[str]:
    """Describe the wrong columns: their values, and what they look like.

    Parameters
    ----------
    given, expected : ndarray, shape (n, k)
    off : sequence of int
        The columns that are wrong.
    names : sequence of str
        Names of all columns.
    factors : bool
        Whether to report columns that look scaled.
    """
    for i in off:
        yield _explain_column(given, expected, i, names, factors)


def _explain_column(given: np.ndarray, expected: np.ndarray, i: int, names: Sequence[str], factors: bool) -> str:
    own, right = given[:, i], expected[:, i]
    fault = f"{names[i]} is {own[0]:.6g}" + (f", not {right[0]:.6g}" if len(own) == 1 else " at first")
    if len(own) > 1:
        worst = int(np.argmax(np.abs(own - right)))
        fault = f"{names[i]} is {own[worst]:.6g}, not {right[worst]:.6g}, in sample {worst}"
    if explains(own, -right, right):
        return f"{fault}: {names[i]} looks mirrored"
    for j in range(given.shape[1]):
        if j != i and explains(own, expected[:, j], right) and explains(given[:, j], right, expected[:, j]):
            return f"{fault}: {names[i]} looks swapped with {names[j]}"
    factor = fit_factor(own, right) if factors else None
    if factor is not None:
        for unit, words in _UNITS.items():
            if abs(factor / unit - 1) < EXPLAINED:
                return f"{fault}: {names[i]} looks to be {words}"
        return f"{fault}: {names[i]} looks scaled by {factor:.6g}"
    return fault
