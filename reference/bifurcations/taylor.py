"""Taylor coefficients of analytic functions by Cauchy's integrals.

On circles |s| = |t| = r the trapezoidal rule gives the coefficients of a function of two complex variables,

    c_jk = 1/n^2 sum_ab f(r w^a, r w^b) w^(-ja - kb) / r^(j + k),    w = exp(2 pi i / n)

up to terms of c_(j + n)k r^n and c_j(k + n) r^n, and round-off eps / r^(j + k). There is no cancellation as in
differences of real numbers, so that third derivatives have eleven digits.

References
----------
J. N. Lyness, C. B. Moler: Numerical differentiation of analytic functions. SIAM Journal on Numerical Analysis 4 (1967)
202-210.
B. Fornberg: Numerical differentiation of analytic functions. ACM Transactions on Mathematical Software 7 (1981)
512-526.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

# Points on a circle. At a quarter of the radius of convergence the first term left out is 4^-16 = 2e-10 of the function
# and falls by 2^-16 with each halving of the radius, while the round-off of third derivatives grows by 2^3.
SAMPLES = 16


@dataclass(frozen=True)
class Estimate:
    """A number that was computed at several radii.

    Attributes
    ----------
    value : complex
    error : float
        Estimate of its absolute error.
    radius : float
        The radius at which it was computed.
    """

    value: complex
    error: float
    radius: float


def expand_on_torus(function: Callable[[np.ndarray, np.ndarray], np.ndarray], radius: float) -> np.ndarray:
    """Compute Taylor coefficients of a function of two complex variables about zero.

    Parameters
    ----------
    function : callable
        Maps s and t, complex arrays of shape (m,), to values (m, d).
    radius : float
        Of the circles on which s and t lie.

    Returns
    -------
    ndarray, shape (n, n, d), complex
        Entry [j, k] is the coefficient of s^j t^k, useful for orders j + k well below n = `SAMPLES`.
    """
    circle = radius * np.exp(2j * np.pi * np.arange(SAMPLES) / SAMPLES)
    s, t = np.meshgrid(circle, circle, indexing="ij")
    values = function(s.ravel(), t.ravel()).reshape(SAMPLES, SAMPLES, -1)
    orders = radius ** -np.arange(float(SAMPLES))
    return np.fft.fft2(values, axes=(0, 1)) / SAMPLES**2 * (orders[:, None] * orders)[..., None]


def choose_radius(compute: Callable[[float], complex], radii: Sequence[float]) -> Estimate:
    """Compute a number at several radii and choose the one that differs least from its neighbours.

    Parameters
    ----------
    compute : callable
        Maps a radius to a number, which is not finite where the radius is too large.
    radii : sequence of float
        Monotonic.

    Returns
    -------
    Estimate
        Its error is the larger difference from the values at the next smaller and the next larger radius: terms left
        out differ on one side, round-off on the other.

    Raises
    ------
    ValueError
        If no three neighbouring radii give finite values.
    """
    values = np.array([compute(radius) for radius in radii])
    changes = np.abs(np.diff(values))
    errors = np.maximum(changes[:-1], changes[1:])
    if not np.isfinite(errors).any():
        raise ValueError("the function has no value on circles of any radius")
    best = int(np.nanargmin(errors))
    return Estimate(complex(values[best + 1]), float(errors[best]), radii[best + 1])


def expand_on_circle(function: Callable[[np.ndarray], np.ndarray], radius: float) -> np.ndarray:
    """Compute Taylor coefficients of a function of one complex variable about zero.

    Parameters
    ----------
    function : callable
        Maps complex arguments (n,) to values (n, d), n = `SAMPLES`.
    radius : float
        Of the circle on which the arguments lie.

    Returns
    -------
    ndarray, shape (n, d), complex
        The coefficients of ascending orders, useful well below n.
    """
    values = function(radius * np.exp(2j * np.pi * np.arange(SAMPLES) / SAMPLES))
    return np.fft.fft(values, axis=0) / SAMPLES * (radius ** -np.arange(float(SAMPLES)))[:, None]


def differentiate(function: Callable[[float], np.ndarray], size: float) -> np.ndarray:
    """Return the derivative at zero of a function of a real variable by the central stencil of sixth order.

    Parameters
    ----------
    function : callable
        Maps a number to an array.
    size : float
        Distance of the stencil's points; the error is size^6 / 140 times the seventh derivative.
    """
    near, middle, far = (function(k * size) - function(-k * size) for k in (1, 2, 3))
    return (45 * near - 9 * middle + far) / (60 * size)
