import numpy as np
import pytest

from velodrome.reference.bifurcations.floquet import eigenvalues_of_product, floquet_multipliers


def planted_monodromy() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a matrix with a Jordan block of multipliers 1, its field and its gradient, and two others."""
    rng = np.random.default_rng(7)
    inner = np.array(
        [[0.6, -0.9, 0, 0, 0], [0.9, 0.6, 0, 0, 0], [0, 0, 1.2, 0, 0], [0, 0, 0, -0.3, 0], [0, 0, 0, 0, 1e-9]]
    )
    blocks = np.zeros((7, 7))
    blocks[0, 0] = blocks[6, 6] = 1
    blocks[0, 1:], blocks[1:6, 6] = rng.normal(size=6), rng.normal(size=5)
    blocks[1:6, 1:6] = inner
    turn = np.linalg.qr(rng.normal(size=(7, 7)))[0]
    return turn @ blocks @ turn.T, 3 * turn[:, 0], -2 * turn[:, 6]


def floquet_of_one_leg(monodromy: np.ndarray, field: np.ndarray, gradient: np.ndarray) -> tuple[np.ndarray, float]:
    return floquet_multipliers(monodromy[None], field[None], gradient[None])


def test_the_two_of_time_and_energy_are_one_to_round_off_and_the_others_are_found() -> None:
    found, invariance = floquet_of_one_leg(*planted_monodromy())
    np.testing.assert_allclose(found[:2], 1, atol=1e-14)
    expected = [1.2, 0.6 + 0.9j, 0.6 - 0.9j, -0.3, 1e-9]
    for value in expected:
        assert np.abs(found[2:] - value).min() < 1e-14
    assert np.abs(found[2:]).tolist() == sorted(np.abs(found[2:]), reverse=True)
    assert invariance < 1e-14


def test_eigenvalues_of_the_whole_matrix_would_be_off_by_the_root_of_round_off() -> None:
    monodromy, field, gradient = planted_monodromy()
    noisy = monodromy + 1e-14 * np.random.default_rng(1).normal(size=(7, 7))
    found, _ = floquet_of_one_leg(noisy, field, gradient)
    assert np.abs(found[:2] - 1).max() < 1e-13
    plain = np.sort(np.abs(np.linalg.eigvals(noisy) - 1))[:2]
    assert plain.max() > 1e-9


def test_a_matrix_that_does_not_conserve_the_energy_is_noticed() -> None:
    monodromy, field, gradient = planted_monodromy()
    monodromy[0, 0] += 1e-6
    _, invariance = floquet_of_one_leg(monodromy, field, gradient)
    assert invariance == pytest.approx(1e-6, rel=10)
    assert invariance > 1e-8


def planted_legs(seed: int, count: int = 6) -> tuple[np.ndarray, np.ndarray, float]:
    """Return matrices whose product has known eigenvalues, from 3e10 to 1e-9, these, and the round-off of their plant.

    The last is that of a leg, relative to the eigenvalues of size 1: the root of the largest eigenvalue, times the
    conditions of the bases on both sides.
    """
    rng = np.random.default_rng(seed)
    turn, shrink = 0.97 * np.exp(0.3j), 1e-9
    known = np.array([-3e10, 1 + 1e-6, turn, turn.conjugate(), shrink])
    root = np.exp(0.3j / count) * 0.97 ** (1 / count)
    rotation = np.array([[root.real, -root.imag], [root.imag, root.real]])
    bases = [
        np.linalg.qr(rng.normal(size=(5, 5)))[0] @ (np.eye(5) + 0.1 * rng.normal(size=(5, 5))) for _ in range(count)
    ]
    legs = []
    for i in range(count):
        blocks = np.zeros((5, 5))
        blocks[0, 0] = (-1 if i == 0 else 1) * 3e10 ** (1 / count)
        blocks[1, 1], blocks[4, 4] = (1 + 1e-6) ** (1 / count), shrink ** (1 / count)
        blocks[2:4, 2:4] = rotation
        legs.append(bases[(i + 1) % count] @ blocks @ np.linalg.inv(bases[i]))
    condition = max(np.linalg.cond(basis) for basis in bases)
    round_off = float(count * np.finfo(float).eps * 3e10 ** (1 / count) * condition**2)
    return np.array(legs), known, round_off


@pytest.mark.parametrize("seed", range(5))
def test_small_eigenvalues_of_a_product_are_found_beside_a_large_one(seed: int) -> None:
    legs, known, round_off = planted_legs(seed)
    found = eigenvalues_of_product(legs)
    assert round_off < 1e-11
    for value in known[:-1]:
        assert np.abs(found / value - 1).min() < round_off
    assert np.abs(found - known[-1]).min() < round_off
    # Real eigenvalues are exactly real, and others exactly conjugate.
    imaginary = np.sort(np.imag(found))
    assert (imaginary == 0).sum() == 3
    assert imaginary.tolist() == (-imaginary[::-1]).tolist()
    plain = np.linalg.eigvals(np.linalg.multi_dot(legs[::-1]))
    assert np.abs(plain - known[1]).min() > 1e2 * np.abs(found - known[1]).min()
