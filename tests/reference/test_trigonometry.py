"""Sine and cosine of the kernels, held against the C library in extended precision."""

import numpy as np
import pytest

from velodrome.reference.kernels.compilation import jit
from velodrome.reference.kernels.trigonometry import LARGEST_ANGLE, sine_and_cosine


@jit
def _evaluate(x, out):
    for i in range(x.size):
        out[i, 0], out[i, 1] = sine_and_cosine(x[i])


def evaluate(x: np.ndarray) -> np.ndarray:
    """Return sines and cosines (n, 2)."""
    out = np.empty((x.size, 2), x.dtype)
    _evaluate(x, out)
    return out


def angles() -> np.ndarray:
    """Angles of every size, and the doubles next to multiples of a quarter turn, where reduction cancels most."""
    numbers = np.random.default_rng(1)
    sizes = 10.0 ** numbers.uniform(-300, np.log10(LARGEST_ANGLE), 20_000)
    spread = [numbers.uniform(-size, size, 20_000) for size in (1.0, 4.0, 1e4, 1e9)]
    return np.concatenate([np.zeros(1), sizes, -sizes, *spread, np.arange(1, 100_000) * (np.pi / 2)])


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="no extended precision on this machine")
def test_errors_are_below_one_unit_in_the_last_place() -> None:
    """Extended precision has 11 bits more, so its own error is below a thousandth of the unit."""
    x = angles()
    found, wide = evaluate(x), x.astype(np.longdouble)
    for column, exact in enumerate((np.sin(wide), np.cos(wide))):
        unit = np.spacing(np.abs(exact.astype(float)))
        assert np.max(np.abs(found[:, column] - exact) / unit) < 1


def test_signs_follow_the_angle() -> None:
    """sin is odd and cos is even, to the bit."""
    x = angles()
    assert np.array_equal(evaluate(-x), evaluate(x) * [-1, 1])


def test_angles_beyond_the_reduction_are_not_numbers() -> None:
    for x in (1.01 * LARGEST_ANGLE, -1e300, np.inf, np.nan):
        assert np.isnan(evaluate(np.array([x]))).all()


def test_complex_step_gives_the_derivatives() -> None:
    x = np.linspace(-4, 4, 41)
    found = np.imag(evaluate(x + 1e-30j)) / 1e-30
    assert np.allclose(found, np.stack([np.cos(x), -np.sin(x)], axis=1), rtol=0, atol=2 * np.finfo(float).eps)
