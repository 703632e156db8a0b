import numpy as np
import pytest

from velodrome.reference.bifurcations.taylor import choose_radius, expand_conjugate, expand_on_circle

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


def test_coefficients_of_several_functions_of_one_variable() -> None:
    found = expand_on_circle(lambda x: np.stack([np.exp(x), np.sin(x)], axis=-1), 0.1, 3)
    np.testing.assert_allclose(found, [1 / 6, -1 / 6], atol=1e-12)


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
