"""Explain the error of a ride in single precision by the errors of its steps and the sensitivity of the ride.

A step in float32 ends beside the step in float64 from the same state by an error d_k. To first order a ride ends beside
the ride in float64 by

    D(T) = sum over k of Phi(T, t_k) d_k

where Phi is the derivative of the state at T with respect to that at t_k, measured by finite differences of rides in
float64. Deviations are those of the generalised coordinates and rates, x and y along and across the heading: on a
circle they change slowly, and Phi with them.

Two models of d_k use the ride in float64 alone. The last digit of a number x in float32 is its spacing u(x). Every
rounding of a number counts in one of them; both results are parts of the prediction, whose squares add up.

- Repeated: where the increment of a position is the same as that of the step before, to within u, as in rolling
  straight on, the increment of the ride in float64 is added in float32. Such steps are rounded alike, and the errors
  themselves add up.
- Unrelated: everywhere else the rounding is evenly spread over +-u / 2 and unrelated from step to step, with the
  variance u^2 / 12. The variances of all steps add up. Velocities always count here: contacts answer an error of a
  velocity within two steps, by increments as large as the error, so that no increment stays the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...reference.kinematics import FRONT_ANGLE, PITCH, REAR_ANGLE, YAW

_DISTURBANCE = (
    1e-6  # of a coordinate or rate; errors of second order and float64's round-off are both 1e-6 of it or less
)
_SIZE = 18  # coordinates and rates
# The angles of wheels change nothing else: wheels are round.
_MATTERING = [i for i in range(_SIZE) if i not in (REAR_ANGLE, FRONT_ANGLE)]

Advance = Callable[[np.ndarray, np.ndarray, int], tuple[np.ndarray, np.ndarray]]
Store = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def find_deviations(q: np.ndarray, qd: np.ndarray, base_q: np.ndarray, base_qd: np.ndarray) -> np.ndarray:
    """Return the deviations (n, 18) of states from others, x and y along and across the others' heading.

    Parameters
    ----------
    q, qd, base_q, base_qd : ndarray, shape (n, 9)
    """
    found = np.concatenate([q - base_q, qd - base_qd], axis=1)
    for angle in (YAW, PITCH):
        found[:, angle] = (found[:, angle] + np.pi) % (2 * np.pi) - np.pi
    cosine, sine = np.cos(base_q[:, YAW]), np.sin(base_q[:, YAW])
    for x, y in ((0, 1), (9, 10)):
        along = cosine * found[:, x] + sine * found[:, y]
        found[:, y] = cosine * found[:, y] - sine * found[:, x]
        found[:, x] = along
    return found


def disturb_states(q: np.ndarray, qd: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add deviations (n, 18) to states (n, 9): the inverse of `find_deviations`."""
    cosine, sine = np.cos(q[:, YAW]), np.sin(q[:, YAW])
    turned = deviations.copy()
    for x, y in ((0, 1), (9, 10)):
        turned[:, x] = cosine * deviations[:, x] - sine * deviations[:, y]
        turned[:, y] = sine * deviations[:, x] + cosine * deviations[:, y]
    return q + turned[:, :9], qd + turned[:, 9:]


@dataclass(frozen=True)
class Sensitivity:
    """How a ride in float64 carries deviations.

    Attributes
    ----------
    q, qd : ndarray, shape (n, 9)
        The ride, sampled at every step; n - 1 steps are a whole number of blocks.
    block : int
        Number of steps of a block.
    forming : int
        Number of blocks at the start in which contacts form. An exact start just touches the ground, and a disturbance
        decides whether a wheel does: derivatives there say nothing.
    flow : ndarray, shape (m, 18, 18)
        Derivatives of the state at the end of a block with respect to that at its start.
    """

    q: np.ndarray
    qd: np.ndarray
    block: int
    forming: int
    flow: np.ndarray

    def carry_to(self, end: int) -> np.ndarray:
        """Return the derivatives (end + 1, 3, 18) of the position after ``end`` blocks with respect to all states.

        Those of the states before contacts have formed are taken as if they were of the state by then.
        """
        found = np.zeros((end + 1, 3, _SIZE))
        found[end, :, :3] = np.eye(3)
        for j in range(end - 1, -1, -1):
            found[j] = found[j + 1] @ self.flow[j]
        formed = min(self.forming, end)
        found[:formed] = found[formed]
        return found


def measure_sensitivity(q: np.ndarray, qd: np.ndarray, block: int, forming: int, advance: Advance) -> Sensitivity:
    """Measure how a ride carries deviations.

    Parameters
    ----------
    q, qd : ndarray, shape (n, 9)
        The ride, sampled at every step.
    block : int
        Number of steps of a block; a rest of less than a block is left out.
    forming : int
        Number of blocks in which contacts form.
    advance : callable
        Moves states (n, 9), (n, 9) by a number of steps in float64.
    """
    count = (len(q) - 1) // block
    starts_q, starts_qd = q[: count * block : block], qd[: count * block : block]
    base_q, base_qd = advance(starts_q, starts_qd, block)
    flow = np.zeros((count, _SIZE, _SIZE))
    flow[:, REAR_ANGLE, REAR_ANGLE] = flow[:, FRONT_ANGLE, FRONT_ANGLE] = 1
    for i in _MATTERING:
        deviations = np.zeros((count, _SIZE))
        deviations[:, i] = _DISTURBANCE
        moved = advance(*disturb_states(starts_q, starts_qd, deviations), block)
        flow[:, :, i] = find_deviations(*moved, base_q, base_qd) / _DISTURBANCE
    return Sensitivity(q[: count * block + 1], qd[: count * block + 1], block, forming, flow)


def measure_step_errors(q: np.ndarray, qd: np.ndarray, advance: Advance) -> np.ndarray:
    """Return the deviations (n - 1, 18) of each step of a ride from the step in float64 from the same state.

    Parameters
    ----------
    q, qd : ndarray, shape (n, 9)
        The ride, sampled at every step.
    advance : callable
        Moves states by a number of steps in float64.
    """
    return find_deviations(q[1:], qd[1:], *advance(q[:-1], qd[:-1], 1))


def carry_errors(sensitivity: Sensitivity, errors: np.ndarray, end: int) -> np.ndarray:
    """Return the deviation of the position (3,) after ``end`` blocks that errors of steps lead to.

    Contacts answer an error at right angles to the ground within some steps, so that little is left of it. Derivatives
    that are interpolated between the ends of a block miss that by the square of the angle by which the motion turns in
    a block: where such errors keep their sign, blocks must be short for the little to come out right.

    Parameters
    ----------
    sensitivity : Sensitivity
    errors : ndarray, shape (n, 18)
        The error at the start, then those of the steps.
    end : int
    """
    carried, block = sensitivity.carry_to(end), sensitivity.block
    # Between the ends of a block the derivatives are interpolated.
    late = np.arange(1, block + 1)[None, :, None] / block
    steps = errors[1 : end * block + 1].reshape(end, block, _SIZE)
    early, behind = ((1 - late) * steps).sum(axis=1), (late * steps).sum(axis=1)
    total = np.einsum("jik,jk->i", carried[:-1], early) + np.einsum("jik,jk->i", carried[1:], behind)
    return total + carried[0] @ errors[0]


class LastDigits:
    """What the last digits of a state in float32 lead to, by the ride in float64 alone.

    Parameters
    ----------
    sensitivity : Sensitivity
    store : callable
        Returns the positions and velocities that an engine keeps, of q (9,) and qd (9,).
    rounded : tuple of str
        The parts that are rounded, of ``positions`` and ``velocities``.
    """

    def __init__(self, sensitivity: Sensitivity, store: Store, rounded: tuple[str, ...]) -> None:
        self._sensitivity, block = sensitivity, sensitivity.block
        kept = [store(*state) for state in zip(sensitivity.q, sensitivity.qd, strict=True)]
        numbers = np.array([np.concatenate(pair) for pair in kept])
        count = len(kept[0][0])
        is_rounded = np.r_[
            np.full(count, "positions" in rounded), np.full(numbers.shape[1] - count, "velocities" in rounded)
        ]
        digits = np.where(is_rounded, np.spacing(np.abs(numbers).astype(np.float32)).astype(float), 0.0)
        repeats = (np.abs(_find_changes(numbers)) < digits) & (np.arange(numbers.shape[1]) < count)
        self._digits = np.where(repeats, 0.0, digits)
        middles = np.arange(len(sensitivity.flow)) * block + block // 2
        # Of a quaternion's four numbers the inverse takes the part that turns, and leaves its length out.
        self._inverses = [np.linalg.pinv(_differentiate(store, sensitivity, k)) for k in middles.tolist()]
        self._repeated = self._replay(numbers, is_rounded, repeats)

    def _replay(self, numbers: np.ndarray, is_rounded: np.ndarray, repeats: np.ndarray) -> np.ndarray:
        """Return the errors (n, 18) of repeating steps if the increments of the ride are added up in float32."""
        now, errors = numbers[0].copy(), np.zeros_like(numbers)
        for k in range(len(numbers)):
            exact = now + (numbers[k] - numbers[k - 1] if k else 0.0)
            now = np.where(is_rounded, exact.astype(np.float32), exact)
            errors[k] = np.where(repeats[k], now - exact, 0.0)
        block = self._sensitivity.block
        found = np.zeros((len(numbers), _SIZE))
        found[0] = self._inverses[0] @ errors[0]
        for j, inverse in enumerate(self._inverses):
            part = slice(j * block + 1, (j + 1) * block + 1)
            found[part] = errors[part] @ inverse.T
        return found

    def predict_unrelated(self, end: int) -> float:
        """Return the root mean square of the part of the distance [m] after ``end`` blocks by unrelated roundings."""
        carried, block = self._sensitivity.carry_to(end), self._sensitivity.block
        total = 0.0
        for j in range(end):
            by_number = 0.5 * (carried[j] + carried[j + 1]) @ self._inverses[j]
            digits = self._digits[j * block + 1 : (j + 1) * block + 1]
            total += float(((by_number**2).sum(axis=0) * (digits**2).sum(axis=0)).sum()) / 12
        return float(np.sqrt(total))

    def predict_repeated(self, end: int) -> float:
        """Return the part of the distance [m] after ``end`` blocks by roundings that repeat."""
        return float(np.linalg.norm(carry_errors(self._sensitivity, self._repeated, end)))


def _find_changes(numbers: np.ndarray) -> np.ndarray:
    """Return the changes (n, m) of the increments of numbers from step to step, those of the ends as beside them."""
    return np.pad(np.diff(numbers, 2, axis=0), ((1, 1), (0, 0)), mode="edge")


def _differentiate(store: Store, sensitivity: Sensitivity, k: int) -> np.ndarray:
    """Return the derivatives of the stored numbers with respect to deviations from the state of step k."""
    columns = []
    for i in range(_SIZE):
        deviation = np.zeros((2, _SIZE))
        deviation[:, i] = _DISTURBANCE, -_DISTURBANCE
        q, qd = disturb_states(sensitivity.q[[k, k]], sensitivity.qd[[k, k]], deviation)
        ahead, back = (np.concatenate(store(*state)) for state in zip(q, qd, strict=True))
        columns.append((ahead - back) / (2 * _DISTURBANCE))
    return np.array(columns).T
