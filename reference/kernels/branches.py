"""Motions of given rear rates, predicted from branches of families on two neighbouring bowls and corrected.

A branch is a part of a followed curve along which sigma b^2, the squared rear rate, is monotone. Between two of its
points the curve is interpolated by the cubic with the tangents of both.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from .arrays import copy_array
from .circle import COORDINATES, FULL
from .compilation import jit
from .curve import CHOSEN, REAR_SPEED, SIGMA, metric
from .newton import CANONICAL, REAR_RATE, PointCondition, canonical, solve_motion

_MOST = 8  # Newton's iterations
_SECANTS = 6  # each gains a digit or more
# Largest correction of a prediction: a share of the distance of both bowls' motions, and the error of the cubic.
_CORRECTION, _CUBIC = 0.25, 1e-4


class BranchPoints(NamedTuple):
    """Points of a branch.

    Attributes
    ----------
    unknowns, tangents : ndarray, shape (n, 22)
    squares : ndarray, shape (n,)
        sigma b^2, rising.
    """

    unknowns: Any
    tangents: Any
    squares: Any


@jit
def _cubic(start, end, left, right, share):
    return start + share * (end - start) + share * (1 - share) * ((1 - share) * left + share * right)


@jit
def motion_at(branch, square, u):
    """Fill the nine unknowns ``u`` of the point of a branch with a squared rear rate between those of its ends."""
    k = min(max(np.searchsorted(branch.squares, square) - 1, 0), len(branch.squares) - 2)
    start, end, along, onward = branch.unknowns[k], branch.unknowns[k + 1], branch.tangents[k], branch.tangents[k + 1]
    weights, left, right = np.empty(FULL), np.empty(FULL), np.empty(FULL)
    metric(start, weights)
    across, further, length = 0.0, 0.0, 0.0
    for i in range(FULL):
        across += weights[i] * along[i] * along[i]
        further += weights[i] * along[i] * onward[i]
        length += weights[i] * along[i] * (end[i] - start[i])
    length /= across
    for i in range(FULL):
        left[i] = length * along[i] - (end[i] - start[i])
        right[i] = (end[i] - start[i]) - length * onward[i] * across / further
    low, high = 0.0, 1.0
    below, above = branch.squares[k] - square, branch.squares[k + 1] - square
    share, side = 0.0, 0
    for _ in range(_SECANTS):
        if not above > below:
            break
        share = low - below * (high - low) / (above - below)
        sigma = _cubic(start[SIGMA], end[SIGMA], left[SIGMA], right[SIGMA], share)
        b = _cubic(start[REAR_SPEED], end[REAR_SPEED], left[REAR_SPEED], right[REAR_SPEED], share)
        value = sigma * b * b - square
        # The other end's value is halved where it has stayed twice (the Illinois method).
        if value < 0:
            low, below, above, side = share, value, 0.5 * above if side < 0 else above, -1
        else:
            high, above, below, side = share, value, 0.5 * below if side > 0 else below, 1
    for i in range(COORDINATES):
        j = CHOSEN[i]
        u[i] = _cubic(start[j], end[j], left[j], right[j], share)


@jit
def _largest(one, other):
    """Return the largest difference of the nine unknowns, relative for large ones."""
    size = 0.0
    for i in range(COORDINATES):
        part = abs(one[i] - other[i]) / (1 + abs(other[i]))
        if not part < math.inf:
            return math.inf
        size = max(size, part)
    return size


@jit
def carry_motions(first, second, sign, squares, scales, shares, parameters, real, function, a, c, full, found):
    """Solve for n motions between two bowls: fill full (n, 22), and ``found`` (n,) with whether each is certain.

    Parameters
    ----------
    first, second : BranchPoints
        The same branch on both bowls.
    sign : float
        Sign of the determinant of the equations and the rate's condition on the branch.
    squares, scales : ndarray, shape (n,)
        Targets and scales of the rates' conditions, see `newton.PointCondition`.
    shares : ndarray, shape (n,)
        Where each motion's bowl lies between the first, 0, and the second, 1.
    parameters : ndarray, shape (n, k)
        Parameters of each motion's bowl.
    real, function, a, c
        As in `newton.solve_motion`.
    """
    one, other, u = np.empty(COORDINATES), np.empty(COORDINATES), np.empty(COORDINATES)
    guess = np.empty(COORDINATES)
    for n in range(len(squares)):
        found[n] = False
        motion_at(first, squares[n], one)
        motion_at(second, squares[n], other)
        for i in range(COORDINATES):
            guess[i] = (1 - shares[n]) * one[i] + shares[n] * other[i]
        copy_array(guess, u)
        condition = PointCondition(REAR_RATE, squares[n], scales[n])
        iterations, here = solve_motion(u, condition, _MOST, real, function, parameters[n], a, c, full[n])
        if iterations == 0 or here != sign:
            continue
        if not _largest(u, guess) <= _CORRECTION * _largest(other, one) + _CUBIC:
            continue
        found[n] = canonical(u, condition, real, function, parameters[n], a, c, full[n]) == CANONICAL
