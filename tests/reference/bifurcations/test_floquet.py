import numpy as np
import pytest

from velodrome.reference.bifurcations.floquet import floquet_multipliers


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


def test_the_two_of_time_and_energy_are_one_to_round_off_and_the_others_are_found() -> None:
    found, invariance = floquet_multipliers(*planted_monodromy())
    np.testing.assert_allclose(found[:2], 1, atol=1e-14)
    expected = [1.2, 0.6 + 0.9j, 0.6 - 0.9j, -0.3, 1e-9]
    for value in expected:
        assert np.abs(found[2:] - value).min() < 1e-14
    assert np.abs(found[2:]).tolist() == sorted(np.abs(found[2:]), reverse=True)
    assert invariance < 1e-14


def test_eigenvalues_of_the_whole_matrix_would_be_off_by_the_root_of_round_off() -> None:
    monodromy, field, gradient = planted_monodromy()
    noisy = monodromy + 1e-14 * np.random.default_rng(1).normal(size=(7, 7))
    found, _ = floquet_multipliers(noisy, field, gradient)
    assert np.abs(found[:2] - 1).max() < 1e-13
    plain = np.sort(np.abs(np.linalg.eigvals(noisy) - 1))[:2]
    assert plain.max() > 1e-9


def test_a_matrix_that_does_not_conserve_the_energy_is_noticed() -> None:
    monodromy, field, gradient = planted_monodromy()
    monodromy[0, 0] += 1e-6
    _, invariance = floquet_multipliers(monodromy, field, gradient)
    assert invariance == pytest.approx(1e-6, rel=10)
    assert invariance > 1e-8
