"""The normal form against fields whose normal form is known, and against Kuznetsov's formula with exact derivatives."""

import numpy as np
import pytest

from velodrome.reference.bifurcations.normal_form import expand_hopf, linearise_field

ENERGY = 1.5
OMEGA, CUBIC, GROWTH = 2.3, -0.7 + 1.1j, 0.4 - 0.9j


def planted_rates(u: np.ndarray, energy: np.ndarray) -> np.ndarray:
    """Return rates of (Re z, Im z, a, b): the normal form, and two variables that decay to a manifold above it.

    z' = (i OMEGA + GROWTH e) z + CUBIC z |z|^2,  a' = -a + 3 (Re z)^2 - e,  b' = -2 b + Re z Im z.
    """
    e, (x, y, a, b) = energy - ENERGY, u.T
    square = x * x + y * y
    real, imaginary = GROWTH.real * e + CUBIC.real * square, OMEGA + GROWTH.imag * e + CUBIC.imag * square
    rates = [real * x - imaginary * y, imaginary * x + real * y, -a + 3 * x * x - e, -2 * b + x * y]
    return np.stack(rates, axis=-1)


SHEAR = np.array([[1.0, 0.2, 0.3, -0.4], [0.0, 1.0, -0.5, 0.1], [0.3, 0.0, 2.0, 0.2], [0.1, -0.2, 0.0, 1.0]])


def bend(u: np.ndarray) -> np.ndarray:
    """Return v = S (u + (a b, z-dependent terms)), near the identity and nonlinear in all variables."""
    x, y, a, b = u.T
    return np.stack([x + a * b + x * x, y - x * a, a + x * y, b + y * y * x], axis=-1) @ SHEAR.T


def unbend(v: np.ndarray) -> np.ndarray:
    target = np.linalg.solve(SHEAR, v.T).T
    u = target.copy()
    with np.errstate(all="ignore"):  # it diverges for points too far away, which then have no value
        for _ in range(60):
            u = u + target - np.linalg.solve(SHEAR, bend(u).T).T
    return u


def bent_field(v: np.ndarray, energy: np.ndarray) -> np.ndarray:
    """Return the planted field in the variables of `bend`; its derivative by the variables is taken exactly."""
    u = unbend(v)
    u[~np.isfinite(u).all(axis=1)] = np.nan
    rates, (x, y, a, b), zero = planted_rates(u, energy), u.T, 0 * u[:, 0]
    rows = [
        [1 + 2 * x, zero, b, a],
        [-a, 1 + zero, -x, zero],
        [y, x, 1 + zero, zero],
        [y * y, 2 * x * y, zero, 1 + zero],
    ]
    derivative = np.moveaxis(np.array(rows), -1, 0)
    return np.einsum("ij,njk,nk->ni", SHEAR, derivative, rates)


@pytest.mark.parametrize("scale", [np.ones(4), np.array([3.0, 0.1, np.inf, 1.0])])
def test_a_planted_normal_form_is_found_behind_a_change_of_variables(scale: np.ndarray) -> None:
    form = expand_hopf(bent_field, np.zeros(4), ENERGY, OMEGA, scale)
    assert form.frequency == pytest.approx(OMEGA, abs=1e-13)
    assert abs(form.growth.value - GROWTH) <= max(10 * form.growth.error, 1e-12)
    # z is measured by u = z (1, -i) / 2 + its conjugate to first order: |z|^2 counts in units of the eigenvector.
    size = np.linalg.solve(SHEAR, form.vector)[:2]
    unit = 2 * abs(size[0])
    assert form.cubic.value == pytest.approx(CUBIC * unit**2, rel=1e-10)
    assert form.cubic.error < 1e-8 * abs(form.cubic.value)


def test_the_equilibrium_moves_as_planted() -> None:
    form = expand_hopf(bent_field, np.zeros(4), ENERGY, OMEGA, np.ones(4))
    np.testing.assert_allclose(form.equilibrium_slope, SHEAR @ [0, 0, -1, 0], atol=1e-13)


def test_the_manifold_is_invariant_to_second_order() -> None:
    """It differs from the planted manifold by terms of third order, or higher."""
    form = expand_hopf(bent_field, np.zeros(4), ENERGY, OMEGA, np.ones(4))
    distances = []
    for size in (2e-2, 1e-2):
        u = unbend(form.manifold(complex(size, 0.3 * size))[None])[0]
        x, y = u[:2]
        # a = (3 - m w) x^2 + m x y + m w y^2 fulfils a' = -a + 3 x^2 where x' = -w y, y' = w x.
        mixed = 6 * OMEGA / (1 + 4 * OMEGA**2)
        a = (3 - mixed * OMEGA) * x * x + mixed * x * y + mixed * OMEGA * y * y
        distances.append(abs(u[2] - a))
    assert distances[0] > 7 * distances[1]


def lorenz(variables: np.ndarray, rho: np.ndarray) -> np.ndarray:
    x, y, z = variables.T
    return np.stack([10 * (y - x), rho * x - y - x * z, x * y - 8 / 3 * z], axis=-1)


def test_lorenz_system_by_kuznetsovs_formula() -> None:
    """At rho = 470/19 the Hopf point is subcritical; B is exact, C is zero (Kuznetsov 2004, section 5.4)."""
    rho = 470 / 19
    side = np.sqrt(8 / 3 * (rho - 1))
    centre = np.array([side, side, rho - 1])
    a, _ = linearise_field(lorenz, centre, rho)
    omega = np.sqrt(8 / 3 * (rho + 10))
    form = expand_hopf(lorenz, centre, rho, float(omega), np.ones(3))

    def b(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.array([0, -u[0] * v[2] - u[2] * v[0], u[0] * v[1] + u[1] * v[0]])

    q = form.vector
    values, vectors = np.linalg.eig(a.T)
    p = vectors[:, int(np.abs(values - 1j * omega).argmin())]
    p = p / (p @ q)
    inner = b(q.conj(), np.linalg.solve(2j * omega * np.eye(3) - a, b(q, q))) - 2 * b(
        q, np.linalg.solve(a, b(q, q.conj()))
    )
    coefficient = (p @ inner).real / (2 * omega)
    assert coefficient > 0
    assert form.cubic.value.real / omega == pytest.approx(coefficient, rel=1e-11)
