"""The coefficients kept here against those of scipy, of which they are a copy, and their own order conditions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest
from scipy.integrate import DOP853

from velodrome.reference.kernels import dormand_prince as method
from velodrome.reference.kernels.tableau import DENSE_OUTPUT, ERROR_3, ERROR_5, EXTRA_STAGES, STAGES, SUM

SIZE = method.SIZE
START = np.zeros(SIZE)


def fill_table(rows: Sequence[Mapping[int, float]], columns: int) -> np.ndarray:
    table = np.zeros((len(rows), columns))
    for i, row in enumerate(rows):
        table[i, list(row)] = list(row.values())
    return table


def test_coefficients_are_those_of_scipy() -> None:
    np.testing.assert_array_equal(fill_table(STAGES, 12), DOP853.A)
    np.testing.assert_array_equal(fill_table([SUM], 12)[0], DOP853.B)
    np.testing.assert_array_equal(fill_table([ERROR_3], 13)[0], DOP853.E3)
    np.testing.assert_array_equal(fill_table([ERROR_5], 13)[0], DOP853.E5)
    np.testing.assert_array_equal(fill_table(EXTRA_STAGES, 16), DOP853.A_EXTRA)
    np.testing.assert_array_equal(fill_table(DENSE_OUTPUT, 16), DOP853.D)


def test_order_conditions_hold() -> None:
    """Quadrature of powers up to order 8, to the round-off of twelve terms of coefficients up to 7."""
    stages, weights = fill_table(STAGES, 12), fill_table([SUM], 12)[0]
    nodes = stages.sum(axis=1)
    for order in range(1, 9):
        np.testing.assert_allclose(weights @ nodes ** (order - 1), 1 / order, rtol=0, atol=2e-14)


def read_weights(fill: Callable[[np.ndarray, np.ndarray], object], shape: tuple[int, ...]) -> np.ndarray:
    """Return the weights (..., 16) of a sum of stages: what it fills where one stage is 1 and all others are 0."""
    weights = np.empty((*shape, 16))
    for j in range(16):
        k, out = np.zeros((16, SIZE)), np.full((*shape, SIZE), np.nan)
        k[j] = 1
        fill(k.reshape(-1), out)
        np.testing.assert_array_equal(out, np.broadcast_to(out[..., :1], out.shape))
        weights[..., j] = out[..., 0]
    return weights


@pytest.mark.parametrize("s", range(1, 12))
def test_stages_have_their_weights(s: int) -> None:
    found = read_weights(lambda k, out: method.fill_stage(s, START, 1.0, k, out), ())
    np.testing.assert_array_equal(found[:12], DOP853.A[s])
    np.testing.assert_array_equal(found[12:], 0)


@pytest.mark.parametrize("s", range(3))
def test_extra_stages_have_their_weights(s: int) -> None:
    found = read_weights(lambda k, out: method.fill_extra_stage(13 + s, START, 1.0, k, out), ())
    np.testing.assert_array_equal(found, DOP853.A_EXTRA[s])


def test_the_step_has_its_weights() -> None:
    found = read_weights(lambda k, out: method.fill_step(START, 1.0, k, out), ())
    np.testing.assert_array_equal(found[:12], DOP853.B)
    np.testing.assert_array_equal(found[12:], 0)


def test_the_dense_output_has_its_weights() -> None:
    found = read_weights(lambda k, out: method.fill_dense_output(START, START, 1.0, k, out), (7,))
    expected = np.zeros((7, 16))
    expected[1, 0], expected[2, 0], expected[2, 12], expected[3:] = 1, -1, -1, DOP853.D
    np.testing.assert_array_equal(found, expected)


def test_a_step_starts_from_its_state_and_has_its_length() -> None:
    rng = np.random.default_rng(0)
    y, k, out = rng.normal(size=SIZE), rng.normal(size=(16, SIZE)), np.empty(SIZE)
    method.fill_step(y, 0.3, k.reshape(-1), out)
    # Twelve terms below 6, added in another order.
    np.testing.assert_allclose(out, y + 0.3 * DOP853.B @ k[:12], rtol=0, atol=1e-14)


def test_the_error_norm_is_that_of_scipy() -> None:
    rng = np.random.default_rng(0)
    y, new, k = rng.normal(size=SIZE), rng.normal(size=SIZE), rng.normal(size=(16, SIZE))
    found = method.error_norm(y, new, 0.3, k.reshape(-1), 1e-3, np.empty(SIZE), np.empty(SIZE))
    unit = 1e-3 * (1 + np.maximum(abs(y), abs(new)))
    squares5, squares3 = (np.sum((e @ k[:13] / unit) ** 2) for e in (DOP853.E5, DOP853.E3))
    assert found == pytest.approx(0.3 * squares5 / np.sqrt((squares5 + 0.01 * squares3) * SIZE), rel=1e-13)
