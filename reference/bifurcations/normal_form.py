"""The normal form of a Hopf point of a vector field with one parameter.

A field y' = g(y, E) with an equilibrium y0 at E0, Jacobian A, A q = i omega q, p A = i omega p, p . q = 1 (no
conjugation) has the centre manifold, to second order,

    y = y0 + z q + zbar qbar + z^2 h20 / 2 + z zbar h11 + zbar^2 h02 / 2,
    (2 i omega - A) h20 = B(q, q),    -A h11 = B(q, qbar),    h02 = conj(h20)

and on it  z' = (i omega + k (E - E0)) z + c1 z^2 zbar + ...,  with the first Lyapunov coefficient l1 = Re c1 / omega
(Kuznetsov 2004, sections 3.5 and 5.4). With s and t for z and zbar, two independent complex numbers, and the field
evaluated on the manifold,

    c1 = p . [s^2 t] g = p . (C(q, q, qbar) + B(qbar, h20) + 2 B(q, h11)) / 2

without any difference of real numbers (`taylor`). Equilibria move by y_E = -A^-1 g_E, so that likewise

    k = p . [s t] g(y0 + s q + t y_E, E0 + t) = p . (B(q, y_E) + g_yE q)

A has to be regular. With a conserved energy, the Jacobian in all variables is not, and A^-1 B(q, qbar) has no meaning;
here g is the field on a level set of energy, and A is singular only where the energy is extreme along the family.

References
----------
Yu. A. Kuznetsov: Elements of Applied Bifurcation Theory. 3rd edition, Springer, 2004.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .taylor import Estimate, choose_radius, expand_conjugate, expand_on_circle

Field = Callable[[np.ndarray, np.ndarray], np.ndarray]

_STEP = 1e-30  # complex step: first derivatives are exact to round-off
# Radii of the circles, in units of the largest component in which the eigenvector is scaled (`expand_hopf`): from a
# fifth of a radian, beyond which a bicycle's equations may have singularities, down to where eps / r^3 is 1e-7.
_RADII = tuple(0.2 / 2**k for k in range(8))


@dataclass(frozen=True, eq=False)
class NormalForm:
    """The normal form z' = (i frequency + growth (E - E0)) z + cubic z |z|^2 at a Hopf point.

    Attributes
    ----------
    jacobian : ndarray, shape (n, n)
        A.
    frequency : float
        omega > 0 [rad/s].
    vector : ndarray, shape (n,), complex
        q, of unit size in its largest scaled component.
    equilibrium_slope : ndarray, shape (n,)
        Derivative y_E of the equilibrium in E.
    second : ndarray, shape (n,), complex
        h20.
    mean : ndarray, shape (n,)
        h11.
    cubic, growth : Estimate
        c1, and k = d lambda / dE: complex numbers with errors.
    """

    jacobian: np.ndarray
    frequency: float
    vector: np.ndarray
    equilibrium_slope: np.ndarray
    second: np.ndarray
    mean: np.ndarray
    cubic: Estimate
    growth: Estimate

    def manifold(self, z: complex) -> np.ndarray:
        """Return y - y0 (n,) on the centre manifold at E0, to second order."""
        return np.real(2 * z * self.vector + z * z * self.second + abs(z) ** 2 * self.mean)


def linearise_field(field: Field, centre: np.ndarray, energy: float) -> tuple[np.ndarray, np.ndarray]:
    """Compute the derivatives of a field at an equilibrium, exact to round-off.

    Parameters
    ----------
    field : callable
        Maps variables (m, n) and the parameter (m,), complex, to rates (m, n).
    centre : ndarray, shape (n,)
    energy : float

    Returns
    -------
    jacobian : ndarray, shape (n, n)
    slope : ndarray, shape (n,)
        Derivative in the parameter.
    """
    size = len(centre)
    variables = centre + 1j * _STEP * np.eye(size + 1, size)
    energies = np.full(size + 1, complex(energy))
    energies[size] += 1j * _STEP
    rates = np.imag(field(variables, energies)) / _STEP
    return rates[:size].T, rates[size]


def critical_vectors(jacobian: np.ndarray, frequency: float) -> tuple[complex, np.ndarray, np.ndarray]:
    """Return the eigenvalue nearest to i frequency, its right vector q and its left vector p with p . q = 1."""
    values, right = np.linalg.eig(jacobian)
    k = int(np.abs(values - 1j * frequency).argmin())
    left = np.linalg.inv(right)[k]
    return complex(values[k]), right[:, k], left


def expand_hopf(field: Field, centre: np.ndarray, energy: float, frequency: float, scale: np.ndarray) -> NormalForm:
    """Compute the normal form at a Hopf point.

    Parameters
    ----------
    field : callable
        Maps variables (m, n) and the parameter (m,), complex, to rates (m, n); analytic.
    centre : ndarray, shape (n,)
        The equilibrium.
    energy : float
        The parameter.
    frequency : float
        Imaginary part of the eigenvalue on the axis [rad/s].
    scale : ndarray, shape (n,)
        Units of the variables, infinite for those that do not count: vectors are scaled by their largest component in
        these units. The results depend on it through round-off only.

    Returns
    -------
    NormalForm

    Raises
    ------
    ValueError
        If the field has no value near the equilibrium.
    numpy.linalg.LinAlgError
        If the Jacobian is singular.
    """
    jacobian, slope = linearise_field(field, centre, energy)
    eigenvalue, q, p = critical_vectors(jacobian, frequency)
    size = np.abs(q / scale).max()
    q, p = q / size, p * size
    # Its phase makes the vector the same whatever the library for eigenvectors chooses.
    largest = int(np.abs(q / scale).argmax())
    turn = np.exp(-1j * np.angle(q[largest]))
    q, p = q * turn, p / turn
    moved = -np.linalg.solve(jacobian, slope)
    omega, identity = eigenvalue.imag, np.eye(len(centre))

    def on_level(variables: np.ndarray) -> np.ndarray:
        return field(centre + variables, np.full(len(variables), complex(energy)))

    def manifold(radius: float) -> tuple[np.ndarray, np.ndarray]:
        terms = expand_conjugate(lambda s, t: on_level(np.outer(s, q) + np.outer(t, q.conj())), radius, 2)
        second = np.linalg.solve(2j * omega * identity - jacobian, 2 * terms[0])
        return second, -np.linalg.solve(jacobian, terms[1].real)

    def cubic(radius: float) -> complex:
        second, mean = manifold(radius)

        def on_manifold(s: np.ndarray, t: np.ndarray) -> np.ndarray:
            linear = np.outer(s, q) + np.outer(t, q.conj())
            return on_level(
                linear + np.outer(s * s, second / 2) + np.outer(t * t, second.conj() / 2) + np.outer(s * t, mean)
            )

        return complex(p @ expand_conjugate(on_manifold, radius, 3)[1])

    # The equilibrium moves by as much as the oscillation.
    unit = 1 / np.abs(moved / scale).max()
    # The terms of second order turn with -2 to 2 times the angle of s, that of s t with 1 times it.
    turns = np.exp(2j * np.pi * np.arange(5) / 5)

    def growth(radius: float) -> complex:
        def along_family(x: np.ndarray) -> np.ndarray:
            s, t = np.outer(x, turns).ravel(), np.repeat(unit * x, len(turns))
            conjugate = np.outer(x, turns.conj()).ravel()
            oscillating = np.outer(s, q) + np.outer(conjugate, q.conj())
            return field(centre + oscillating + np.outer(t, moved), energy + t).reshape(len(x), len(turns), -1)

        (quadratic,) = expand_on_circle(along_family, radius, [2])
        mixed = np.fft.fft(quadratic, axis=0)[1] / len(turns)
        return complex(p @ mixed / unit)

    third, change = choose_radius(cubic, _RADII), choose_radius(growth, _RADII)
    second, mean = manifold(third.radius)
    return NormalForm(
        jacobian=jacobian,
        frequency=omega,
        vector=q,
        equilibrium_slope=moved,
        second=second,
        mean=mean,
        cubic=third,
        growth=change,
    )
