import numpy as np
import pytest

from velodrome.reports.measure.convergence import extrapolate, observed_orders

RNG = np.random.default_rng(5)
LIMIT, FIRST, SECOND, THIRD = RNG.normal(size=(4, 6))


def sequence(levels: int, powers: tuple[int, int, int], noise: float = 0.0) -> list[np.ndarray]:
    """Members with an exact expansion in the step, at steps 1/4, 1/8, ..."""
    steps = [0.25 / 2**level for level in range(levels)]
    terms = zip((FIRST, SECOND, THIRD), powers, strict=True)
    known = list(terms)
    return [LIMIT + sum(c * h**p for c, p in known) + noise * RNG.normal(size=6) for h in steps]


@pytest.mark.parametrize("powers", [(1, 2, 3), (2, 4, 6), (2, 3, 4), (4, 5, 6)])
def test_orders_tend_to_the_leading_power(powers: tuple[int, int, int]) -> None:
    orders = observed_orders(sequence(8, powers))
    # The next term is smaller by the step to the difference of the powers: 1/256 at the fourth level, times
    # the coefficients' ratio of some units.
    assert orders[-1] == pytest.approx(powers[0], abs=0.05)
    assert abs(orders[-1] - powers[0]) < abs(orders[0] - powers[0])


@pytest.mark.parametrize("powers", [(1, 2, 3), (2, 4, 6), (2, 3, 4)])
def test_the_limit_is_exact_to_the_terms_removed(powers: tuple[int, int, int]) -> None:
    members = sequence(6, powers)
    limit = extrapolate(members)
    error = np.abs(limit.value - LIMIT).max()
    # Two terms removed leave the third at the finest steps, 1/128 to its power, times the table's factors of
    # some units.
    assert error < 10 * (1 / 128) ** powers[2]
    assert error <= 10 * limit.uncertainty + 1e-14
    assert error < 1e-2 * np.abs(members[-1] - LIMIT).max()


def test_noise_is_not_extrapolated() -> None:
    limit = extrapolate(sequence(7, (2, 4, 6), noise=1e-9))
    # Removing a power multiplies noise by (2^p + 1) / (2^p - 1), 5/3 for the first: a few such factors.
    assert np.abs(limit.value - LIMIT).max() < 2e-8
    assert limit.uncertainty > 1e-10


def test_members_that_do_not_converge_are_left_as_they_are() -> None:
    members = [RNG.normal(size=6) for _ in range(5)]
    growing = [2.0**level * members[0] for level in range(4)]
    assert np.array_equal(extrapolate(growing).value, growing[-1])
    assert np.array_equal(extrapolate(growing[:2]).value, growing[1])


def test_equal_members_are_their_own_limit() -> None:
    limit = extrapolate([LIMIT, LIMIT, LIMIT])
    assert np.array_equal(limit.value, LIMIT)
    assert limit.uncertainty == 0
    assert np.isnan(observed_orders([LIMIT, LIMIT, LIMIT])[0])
