"""Errors of single precision, on motions whose sensitivity and roundings are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from velodrome.reference.kinematics import PITCH, YAW
from velodrome.reports.measure.float32 import (
    LastDigits,
    Sensitivity,
    carry_errors,
    disturb_states,
    find_deviations,
    measure_sensitivity,
    measure_step_errors,
)

STEP, BLOCK, BLOCKS = 0.01, 10, 40
SPEED = np.array([4.6, 0.3, 0.0])


def drift(q: np.ndarray, qd: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Uniform motion: q' = qd, qd' = 0."""
    return q + steps * STEP * qd, qd.copy()


def coast(heading: float = 0.0, start: float = 0.0, acceleration: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A uniform motion, or one whose positions are accelerated, sampled at every step, in double precision."""
    q, qd = np.zeros((BLOCKS * BLOCK + 1, 9)), np.zeros((BLOCKS * BLOCK + 1, 9))
    qd[:, :3] = SPEED
    time = STEP * np.arange(len(q))[:, None]
    q[:, :3] = start + time * SPEED + 0.5 * acceleration * time**2
    q[:, YAW] = heading
    return q, qd


def store(q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return q, qd


def test_deviations_are_along_and_across_the_heading() -> None:
    q, qd = coast(heading=np.pi / 2)
    moved = q.copy()
    moved[:, 1] += 1e-3  # y is forward at this heading
    found = find_deviations(moved, qd, q, qd)
    np.testing.assert_allclose(found[:, 0], 1e-3, rtol=1e-9)
    np.testing.assert_allclose(found[:, 1:], 0, atol=1e-15)


def test_deviations_have_no_whole_turns_and_an_inverse() -> None:
    q, qd = coast(heading=0.7)
    numbers = np.random.default_rng(3)
    given = 1e-3 * numbers.uniform(-1, 1, (len(q), 18))
    moved_q, moved_qd = disturb_states(q, qd, given)
    moved_q[:, YAW] += 4 * np.pi
    moved_q[:, PITCH] -= 2 * np.pi
    np.testing.assert_allclose(find_deviations(moved_q, moved_qd, q, qd), given, atol=1e-14)


def test_the_sensitivity_of_uniform_motion_is_its_time() -> None:
    q, qd = coast(heading=1.1)
    found = measure_sensitivity(q, qd, BLOCK, 1, drift)
    carried = found.carry_to(BLOCKS)
    left = STEP * BLOCK * (BLOCKS - 3)
    np.testing.assert_allclose(carried[3, :, :3], np.eye(3), atol=1e-8)
    np.testing.assert_allclose(carried[3, :, 9:12], left * np.eye(3), rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(carried[3][:, [3, 4, 5, 6, 7, 8, 12, 17]], 0, atol=1e-7)


def test_errors_of_steps_add_up_to_the_distance() -> None:
    q, qd = coast()
    exact = measure_sensitivity(q, qd, BLOCK, 1, drift)
    wrong_q, wrong_qd = q.copy(), qd.copy()
    numbers = np.random.default_rng(4)
    kicks = 1e-6 * numbers.normal(size=(len(q), 18))
    kicks[0] = 0
    for k in range(1, len(q)):
        moved = drift(wrong_q[[k - 1]], wrong_qd[[k - 1]], 1)
        disturbed = disturb_states(*moved, kicks[[k]])
        wrong_q[k], wrong_qd[k] = disturbed[0][0], disturbed[1][0]
    errors = np.concatenate([np.zeros((1, 18)), measure_step_errors(wrong_q, wrong_qd, drift)])
    np.testing.assert_allclose(errors, kicks, atol=1e-14)
    distance = wrong_q[-1, :3] - q[-1, :3]
    # The first block's errors are carried as if they had happened at its end, 0.1 s of 4 s later.
    np.testing.assert_allclose(carry_errors(exact, errors, BLOCKS), distance, atol=0.1 * np.abs(distance).max())


def make_digits(
    start: float, rounded: tuple[str, ...], acceleration: float = 0.0
) -> tuple[LastDigits, Sensitivity, np.ndarray]:
    q, qd = coast(start=start, acceleration=acceleration)
    sensitivity = measure_sensitivity(q, qd, BLOCK, 1, drift)
    return LastDigits(sensitivity, store, rounded), sensitivity, q


def test_increments_that_repeat_are_rounded_the_same_way() -> None:
    """The prediction is what numpy's float32 does with x + h v, and grows as the number of steps."""
    digits, _, q = make_digits(70.0, ("positions",))
    now, added = q[0, :3].astype(np.float32).astype(float), [np.zeros(3)]
    for k in range(1, len(q)):
        now = (now + STEP * SPEED).astype(np.float32).astype(float)
        added.append(now - q[k, :3])
    half, whole = digits.predict_repeated(BLOCKS // 2), digits.predict_repeated(BLOCKS)
    # The increments of the sampled ride differ from h v by its own round-off, 2^-53 of 70 m, which is 2^-29 of a digit.
    assert whole == pytest.approx(float(np.linalg.norm(added[-1])), rel=1e-3)
    assert whole == pytest.approx(2 * half, rel=0.05)
    assert digits.predict_unrelated(BLOCKS) == 0  # each rounding counts once


def test_unrelated_roundings_grow_as_the_root_of_the_steps() -> None:
    """Increments that change by 1e-4 m in each step, where the digit is 8e-6 m, are rounded in unrelated ways."""
    digits, _, q = make_digits(70.0, ("positions",), acceleration=1.0)
    spacing = np.spacing(q[1:, :3].astype(np.float32)).astype(float)
    expected = np.sqrt((spacing**2).sum() / 12)
    assert digits.predict_unrelated(BLOCKS) == pytest.approx(expected, rel=1e-6)
    assert digits.predict_repeated(BLOCKS) == 0


def test_what_is_not_rounded_predicts_nothing() -> None:
    digits, _, _ = make_digits(70.0, ())
    assert digits.predict_unrelated(BLOCKS) == 0
    assert digits.predict_repeated(BLOCKS) == 0


def test_roundings_of_velocities_are_unrelated() -> None:
    """Each is carried for the time that is left; those of the first block as if they had happened at its end."""
    digits, _, q = make_digits(0.0, ("velocities",))
    spacing = np.spacing(np.abs(SPEED).astype(np.float32)).astype(float)
    left = STEP * np.minimum(len(q) - 1 - np.arange(1, len(q)), BLOCK * (BLOCKS - 1))
    expected = np.sqrt((spacing**2).sum() / 12 * (left**2).sum())
    # A block's derivative is that of its middle.
    assert digits.predict_unrelated(BLOCKS) == pytest.approx(expected, rel=0.01)
    assert digits.predict_repeated(BLOCKS) == 0
