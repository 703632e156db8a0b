import math

import numpy as np
import pytest

from velodrome.reference.bifurcations.taylor import choose_radius, differentiate, expand_conjugate, expand_on_circle

RADII = [0.4 / 2**k for k in range(8)]


def exponential(s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Have the coefficients a^j b^k / (j! k!), a = 1 + i, b its conjugate."""
    return np.exp((1 + 1j) * s + (1 - 1j) * t)[:, None]


def test_coefficients_of_an_exponential() -> None:
    a, factorials = 1 + 1j, [1, 1, 2, 6]
    for order in range(4):
        found = expand_conjugate(exponential, 0.1, order)[:, 0]
        for k, value in enumerate(found):
            j = order - k
            expected = a**j * np.conj(a) ** k / (factorials[j] * factorials[k])
            # Round-off of values up to e^0.3, divided by r^(j + k).
            assert value == pytest.approx(expected, abs=2e-15 / 0.1**order)


def test_the_chosen_radius_has_the_error_that_is_estimated() -> None:
    """With poles at s, t = 1 the coefficient of s^2 t is 18, and large radii leave terms out."""

    def rational(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        return 1 / ((1 - s) * (1 - t))[:, None] ** 3

    found = choose_radius(lambda radius: complex(expand_conjugate(rational, radius, 3)[1, 0]), RADII)
    assert abs(found.value - 18) <= found.error < 1e-9
    worst = expand_conjugate(rational, RADII[0], 3)[1, 0]
    assert abs(worst - 18) > 1e2 * found.error


def test_no_radius_with_values_is_an_error() -> None:
    with pytest.raises(ValueError, match="no value"):
        choose_radius(lambda _: complex(np.nan), RADII)


def test_coefficients_of_several_functions_of_one_variable() -> None:
    found = expand_on_circle(lambda t: np.exp(2 * t)[:, None] * np.array([1.0, 3.0]), 0.1, range(6))
    for order, values in enumerate(found):
        # The terms left out are those of order 16 more, times 0.1^16; round-off is eps / 0.1^order.
        expected = 2.0**order / math.factorial(order) * np.array([1.0, 3.0])
        assert np.abs(values - expected).max() < 1e-15 * 10**order * 3


def test_the_stencil_is_of_sixth_order() -> None:
    errors = [abs(float(differentiate(lambda t: np.sin(1 + t), size)) - np.cos(1)) for size in (0.2, 0.1)]
    assert errors[0] == pytest.approx(0.2**6 / 140 * np.cos(1), rel=0.02)  # the next term is of order size^2
    assert np.log2(errors[0] / errors[1]) == pytest.approx(6, abs=0.05)
