import math

import numpy as np
import pytest

from velodrome.reference.bifurcations.taylor import choose_radius, differentiate, expand_on_circle, expand_on_torus

RADII = [0.4 / 2**k for k in range(8)]


def exponential(s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Have the coefficients 1 / j! and 2^k / k!."""
    return np.exp(s + 2 * t)[:, None]


def test_coefficients_of_an_exponential() -> None:
    found = expand_on_torus(exponential, 0.1)[..., 0]
    for j, k, expected in ((0, 0, 1), (1, 0, 1), (0, 1, 2), (1, 1, 2), (2, 1, 1), (1, 2, 2), (0, 3, 4 / 3)):
        # Round-off of values up to e^0.3 in sums of 256, divided by r^(j + k).
        assert found[j, k] == pytest.approx(expected, abs=1e-14 / 0.1 ** (j + k))


def test_the_chosen_radius_has_the_error_that_is_estimated() -> None:
    """With a pole at s = 1 the coefficient of s^2 t is 6, and large radii leave terms out."""

    def rational(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        return (t / (1 - s) ** 3)[:, None]

    found = choose_radius(lambda radius: complex(expand_on_torus(rational, radius)[2, 1, 0]), RADII)
    assert abs(found.value - 6) <= found.error < 1e-11
    worst = expand_on_torus(rational, RADII[0])[2, 1, 0]
    assert abs(worst - 6) > 1e3 * found.error


def test_no_radius_with_values_is_an_error() -> None:
    with pytest.raises(ValueError, match="no value"):
        choose_radius(lambda _: complex(np.nan), RADII)


def test_coefficients_of_one_variable() -> None:
    found = expand_on_circle(lambda t: np.exp(2 * t)[:, None] * np.array([1.0, 3.0]), 0.1)
    for order in range(6):
        # The terms left out are those of order 16 more, times 0.1^16; round-off is eps / 0.1^order.
        expected = 2.0**order / math.factorial(order) * np.array([1.0, 3.0])
        assert np.abs(found[order] - expected).max() < 1e-15 * 10**order * 3


def test_the_stencil_is_of_sixth_order() -> None:
    errors = [abs(float(differentiate(lambda t: np.sin(1 + t), size)) - np.cos(1)) for size in (0.2, 0.1)]
    assert errors[0] == pytest.approx(0.2**6 / 140 * np.cos(1), rel=0.02)  # the next term is of order size^2
    assert np.log2(errors[0] / errors[1]) == pytest.approx(6, abs=0.05)
