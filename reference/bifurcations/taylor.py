"""Taylor coefficients of analytic functions by Cauchy's integrals.

On the circle |x| = r the trapezoidal rule with n points gives the coefficients of a function of a complex variable,

    c_k = 1/n sum_a f(r w^a) w^(-ka) / r^k,    w = exp(2 pi i / n)

up to the term c_(k + n) r^n and round-off eps / r^k. There is no cancellation as in differences of real numbers, so
that third derivatives have eleven digits. A function that is real for real x needs the upper half of the circle only.

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
# and falls by 2^-16 with each halving of the radius, while the round-off of third derivatives grows by 2^3. An
# oscillation of amplitude r along its vector and the conjugate is as wide as 2 r.
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


def expand_on_circle(
    function: Callable[[np.ndarray], np.ndarray], radius: float, orders: Sequence[int]
) -> list[np.ndarray]:
    """Compute the Taylor coefficients of some orders of functions of a complex variable, about zero.

    Parameters
    ----------
    function : callable
        Maps complex numbers (m,) to values (m, ...), real for real numbers.
    radius : float
        Of the circle.
    orders : sequence of int
        Well below `SAMPLES`.

    Returns
    -------
    list of ndarray, shape (...)
        One for each order.
    """
    turns = np.exp(2j * np.pi * np.arange(SAMPLES // 2 + 1) / SAMPLES)
    values = function(radius * turns)
    counts = np.full(len(turns), 2.0)  # those of the lower half are conjugate
    counts[[0, -1]] = 1
    return [
        np.real(np.tensordot(counts * turns**-order, values, axes=1)) / (SAMPLES * radius**order) for order in orders
    ]


def expand_conjugate(function: Callable[[np.ndarray, np.ndarray], np.ndarray], radius: float, order: int) -> np.ndarray:
    """Compute the Taylor coefficients of an order of a function of two complex variables that is real on conjugates.

    Along s = x exp(i phi), t = x exp(-i phi) the coefficient of x^n is the sum of c_jk exp(i (j - k) phi) over
    j + k = n: n + 1 angles phi give all of them.

    Parameters
    ----------
    function : callable
        Maps s and t, complex arrays of shape (m,), to values (m, d), real where t is the conjugate of s.
    radius : float
        Of the circles on which s and t lie.
    order : int
        n.

    Returns
    -------
    ndarray, shape (n + 1, d), complex
        Entry k is the coefficient of s^(n - k) t^k.
    """
    turns = np.exp(1j * np.pi * np.arange(order + 1) / (order + 1))

    def evaluate_rays(x: np.ndarray) -> np.ndarray:
        s, t = np.outer(x, turns), np.outer(x, turns.conj())
        return function(s.ravel(), t.ravel()).reshape(*s.shape, -1)

    (rays,) = expand_on_circle(evaluate_rays, radius, [order])
    return np.fft.ifft(rays * (turns**-order)[:, None], axis=0)


def choose_radius(compute: Callable[[float], complex], radii: Sequence[float]) -> Estimate:
    """Compute a number at several radii and choose the one that differs least from its neighbours.

    Parameters
    ----------
    compute : callable
        Maps a radius to a number, which is not finite where the radius is too large.
    radii : sequence of float
        Falling; those far beyond the best one are not tried.

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
    values: list[complex] = []
    errors = np.empty(0)
    for radius in radii:
        values.append(compute(radius))
        changes = np.abs(np.diff(values))
        errors = np.maximum(changes[:-1], changes[1:])
        # Beyond the best radius round-off of derivatives grows by a power of the ratio of radii.
        if np.isfinite(errors).any() and np.all(errors[-2:] > 2 * np.nanmin(errors)):
            break
    if not np.isfinite(errors).any():
        raise ValueError("the function has no value on circles of any radius")
    best = int(np.nanargmin(errors))
    return Estimate(complex(values[best + 1]), float(errors[best]), radii[best + 1])


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
