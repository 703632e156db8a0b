"""Upright straight motion on the level plane: the linearised equations of lean and steer.

With lean to the right phi, steer to the right delta and forward speed v they read

    M q'' + (v C1 + diag(0, c)) q' + (g K0 + v^2 K2) q = f,    q = (phi, delta),

with the canonical matrices of Meijaard, Papadopoulos, Ruina and Schwab (2007), "Linearized dynamics equations for the
balance and steer of a bicycle: a benchmark and review", Eq. (5.3) and Appendix A, and steer damping c.

The characteristic polynomial a4 s^4 + a3 s^3 + a2 s^2 + a1 s + a0 has coefficients that are polynomials of the speed.
A real eigenvalue is zero where a0 = 0, and a pair lies on the imaginary axis where
a1 a2 a3 - a4 a1^2 - a0 a3^2 = 0 with a1 / a3 > 0. Both are polynomial equations in v, so the speeds at which
stability changes are solved and not sampled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import pairwise, permutations
from typing import Any

import numpy as np

from .bicycle import Bicycle

# A mass matrix whose condition number is larger cannot be told from a singular one in double precision.
_LARGEST_CONDITION = 1e14
# Imaginary parts below this share of a root's size are round-off: a double root splits by the root of 1e-16.
_REAL = 1e-7
# Names are followed down from a speed at which eigenvalues are proportional to the speed, in steps of this ratio.
_FAST, _RATIO = 1e4, 1.02
_COMPLEX_STEP = 1e-30


@dataclass(frozen=True)
class CanonicalMatrices:
    """Matrices of the linearised equations, lean and steer positive to the right (Meijaard et al. 2007, Appendix A).

    Attributes
    ----------
    M : ndarray, shape (2, 2)
        Mass matrix [kg m^2].
    C1 : ndarray, shape (2, 2)
        Damping matrix divided by the speed [kg m].
    K0 : ndarray, shape (2, 2)
        Stiffness matrix divided by gravity, its part without speed [kg m].
    K2 : ndarray, shape (2, 2)
        Stiffness matrix divided by the squared speed [kg].
    gravity : float
        [m/s^2].
    steer_damping : float
        Coefficient c of the torque -c times the steer rate [N m s/rad]; no part of the published matrices.
    """

    M: np.ndarray
    C1: np.ndarray
    K0: np.ndarray
    K2: np.ndarray
    gravity: float
    steer_damping: float = 0.0

    def eigenvalues(self, speeds: Any) -> np.ndarray:
        """Return the four eigenvalues at forward speeds.

        Parameters
        ----------
        speeds : array_like, shape (n,)
            [m/s].

        Returns
        -------
        ndarray, shape (n, 4), complex
            Sorted by real part, then imaginary part [1/s].

        Raises
        ------
        ValueError
            If the mass matrix is singular.
        """
        if np.linalg.cond(self.M) > _LARGEST_CONDITION:
            raise ValueError("the mass matrix of lean and steer is singular: a combination of them has no inertia")
        speeds = np.atleast_1d(np.asarray(speeds, float))[:, None, None]
        blocks = np.zeros((speeds.shape[0], 4, 4))
        blocks[:, :2, 2:] = np.eye(2)
        blocks[:, 2:, :2] = -np.linalg.solve(self.M, self.gravity * self.K0 + speeds**2 * self.K2)
        blocks[:, 2:, 2:] = -np.linalg.solve(self.M, speeds * self.C1 + np.diag([0.0, self.steer_damping]))
        values = np.linalg.eigvals(blocks).astype(complex)
        return np.take_along_axis(values, np.lexsort((np.imag(values), np.real(values)), axis=-1), axis=-1)


@dataclass(frozen=True)
class StabilityChange:
    """A speed at which a mode of upright straight motion becomes stable or unstable.

    Attributes
    ----------
    mode : str
        ``weave`` for a pair of eigenvalues on the imaginary axis, ``capsize`` for a zero one.
    speed : float
        [m/s].
    stabilises : bool
        Whether the mode is stable above the speed and unstable below.
    """

    mode: str
    speed: float
    stabilises: bool


def canonical_matrices(bicycle: Bicycle, steer_damping: float = 0.0) -> CanonicalMatrices:
    """Compute the canonical matrices of a bicycle (Meijaard et al. 2007, Eqs. A1-A20).

    Parameters
    ----------
    bicycle : Bicycle
    steer_damping : float
        [N m s/rad].

    Returns
    -------
    CanonicalMatrices
    """
    return CanonicalMatrices(*_matrices(_values(bicycle)), gravity=bicycle.gravity, steer_damping=steer_damping)


def stability_changes(matrices: CanonicalMatrices) -> list[StabilityChange]:
    """Solve for the speeds at which a mode of upright straight motion becomes stable or unstable.

    Parameters
    ----------
    matrices : CanonicalMatrices

    Returns
    -------
    list of StabilityChange
        By rising speed; speeds at which a mode only touches the limit of stability are left out.
    """
    changes = []
    for polynomial, mode in zip(_boundary_polynomials(matrices), ("capsize", "weave"), strict=True):
        for speed in _crossings(polynomial):
            slope = _growth_slope(matrices, mode, speed)
            if slope is not None:
                changes.append(StabilityChange(mode, speed, slope < 0))
    return sorted(changes, key=lambda change: change.speed)


def stable_speeds(matrices: CanonicalMatrices) -> list[tuple[float, float]]:
    """Find the ranges of forward speed in which upright straight motion is asymptotically stable.

    Parameters
    ----------
    matrices : CanonicalMatrices

    Returns
    -------
    list of (float, float)
        By rising speed [m/s]; the last may end at infinity.
    """
    ends = [0.0, *(change.speed for change in stability_changes(matrices)), np.inf]
    ranges: list[tuple[float, float]] = []
    for start, end in pairwise(ends):
        middle = 2 * start + 1 if end == np.inf else (start + end) / 2
        if matrices.eigenvalues(middle)[0, -1].real < 0:
            ranges.append((start, end))
    return ranges


def weave_speed(matrices: CanonicalMatrices) -> float | None:
    """Return the lowest speed above which weave is stable and below which it is not, or None [m/s]."""
    return _first(matrices, "weave", stabilises=True)


def capsize_speed(matrices: CanonicalMatrices) -> float | None:
    """Return the lowest speed above which capsize is unstable and below which it is not, or None [m/s]."""
    return _first(matrices, "capsize", stabilises=False)


def _first(matrices: CanonicalMatrices, mode: str, stabilises: bool) -> float | None:
    speeds = [c.speed for c in stability_changes(matrices) if c.mode == mode and c.stabilises == stabilises]
    return speeds[0] if speeds else None


def speed_deviations(
    bicycle: Bicycle, uncertainties: Mapping[str, float], steer_damping: float = 0.0
) -> dict[str, float | None]:
    """Compute the standard deviations of weave and capsize speed from those of the parameters, to first order.

    Parameters
    ----------
    bicycle : Bicycle
    uncertainties : mapping
        Name of a parameter to its standard deviation; parameters are taken as independent.
    steer_damping : float
        [N m s/rad].

    Returns
    -------
    dict
        ``weave`` and ``capsize`` to the deviation [m/s], None where there is no such speed.
    """
    values, matrices = _values(bicycle), canonical_matrices(bicycle, steer_damping)
    found: dict[str, float | None] = {}
    for mode, place, speed in (("capsize", 0, capsize_speed(matrices)), ("weave", 1, weave_speed(matrices))):
        if speed is None:
            found[mode] = None
            continue
        variance = 0.0
        for name, deviation in uncertainties.items():
            moved = values | {name: values[name] + 1j * _COMPLEX_STEP}
            perturbed = CanonicalMatrices(*_matrices(moved), moved["gravity"], steer_damping)
            polynomial = _boundary_polynomials(perturbed)[place]
            # dv = -(dP/dp) / (dP/dv), at the root.
            change = np.polyval(polynomial, speed).imag / _COMPLEX_STEP
            slope = -change / np.polyval(np.polyder(np.real(polynomial)), speed)
            variance += float(slope * deviation) ** 2
        found[mode] = variance**0.5
    return found


def name_modes(matrices: CanonicalMatrices, speeds: Any) -> tuple[np.ndarray, np.ndarray]:
    """Compute eigenvalues over speed with the modes that they belong to.

    At a large speed v eigenvalues are proportional to it, but for one that falls off as 1/v: that is capsize. Of the
    three others a pair is weave and the remaining one castering; if all three are real, castering is the fastest to
    decay. From there they are followed down by continuity. Below the speed at which weave begins to oscillate, the two
    real eigenvalues that it splits into both are weave. A pair is one mode or the two others: where a root of weave and
    that of capsize meet and begin to oscillate, the names change places so that the pair is not divided.

    Parameters
    ----------
    matrices : CanonicalMatrices
    speeds : array_like, shape (n,)
        Not negative [m/s].

    Returns
    -------
    eigenvalues : ndarray, shape (n, 4), complex
        Columns belong to the modes: weave, weave, capsize, castering [1/s].
    modes : ndarray of str, shape (4,)
        Names of the columns.
    """
    wanted = np.atleast_1d(np.asarray(speeds, float))
    largest = _FAST * max(1.0, float(wanted.max(initial=0.0)))
    steps = int(np.ceil(np.log(largest / 1e-3) / np.log(_RATIO)))
    path = np.unique(np.concatenate([[0.0], np.geomspace(1e-3, largest, steps), wanted]))[::-1]
    followed = np.empty((path.size, 4), complex)
    values = matrices.eigenvalues(path)
    followed[0] = _by_mode(values[0])
    orders = np.array(list(permutations(range(4))))
    for k in range(1, path.size):
        # Weave's two columns are one mode: conjugates may change places.
        here = values[k][orders]
        kept = here[~_divides_pair(here)]
        followed[k] = kept[np.abs(kept - followed[k - 1]).sum(axis=1).argmin()]
    places = {speed: k for k, speed in enumerate(path)}
    return followed[[places[speed] for speed in wanted]], np.array(["weave", "weave", "capsize", "castering"])


def _divides_pair(values: np.ndarray) -> np.ndarray:
    """Return which rows (n, 4) have one of a pair among the first two columns and the other among the last two."""
    oscillates = (np.abs(np.imag(values)) > _REAL * np.abs(values))[:, :2].any(axis=1)
    return oscillates & (values[:, 1] != np.conj(values[:, 0]))


def _by_mode(values: np.ndarray) -> np.ndarray:
    """Order the four eigenvalues of a large speed: weave, weave, capsize, castering."""
    rest = list(values[np.argsort(np.abs(values))])
    capsize = rest.pop(0)
    oscillating = [value for value in rest if abs(value.imag) > _REAL * abs(value)]
    if len(oscillating) == 2:
        weave = sorted(oscillating, key=lambda value: value.imag)
        castering = next(value for value in rest if value not in oscillating)
    else:
        castering, *weave = sorted(rest, key=lambda value: value.real)
    return np.array([*weave, capsize, castering])


def _values(bicycle: Bicycle) -> dict[str, Any]:
    return {field.name: getattr(bicycle, field.name) for field in fields(bicycle)}


def _matrices(p: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Evaluate M, C1, K0 and K2 (Meijaard et al. 2007, Appendix A) from parameters that may be complex.

    Symbols are the paper's, with its axis z down; ours point up.
    """
    w, c, tilt = p["wheelbase"], p["trail"], p["steer_axis_tilt"]
    r_rear, r_front = p["rear_wheel_radius"], p["front_wheel_radius"]
    m_r, m_b, m_h, m_f = (p[f"{name}_mass"] for name in ("rear_wheel", "rear_frame", "front_frame", "front_wheel"))
    x_b, z_b, x_h, z_h = p["rear_frame_x"], -p["rear_frame_z"], p["front_frame_x"], -p["front_frame_z"]
    i_r, i_f = p["rear_wheel_Ixx"], p["front_wheel_Ixx"]
    b_xx, b_zz, b_xz = p["rear_frame_Ixx"], p["rear_frame_Izz"], -p["rear_frame_Ixz"]
    h_xx, h_zz, h_xz = p["front_frame_Ixx"], p["front_frame_Izz"], -p["front_frame_Ixz"]
    sine, cosine = np.sin(tilt), np.cos(tilt)
    # The whole bicycle (A1-A6). Its sums are mass times distance, so that nothing is divided by a mass of zero.
    mx_t = m_b * x_b + m_h * x_h + m_f * w
    mz_t = -m_r * r_rear + m_b * z_b + m_h * z_h - m_f * r_front
    t_xx = i_r + b_xx + h_xx + i_f + m_r * r_rear**2 + m_b * z_b**2 + m_h * z_h**2 + m_f * r_front**2
    t_xz = b_xz + h_xz - m_b * x_b * z_b - m_h * x_h * z_h + m_f * w * r_front
    t_zz = i_r + b_zz + h_zz + i_f + m_b * x_b**2 + m_h * x_h**2 + m_f * w**2
    # The front assembly about the steering axis (A7-A14): distances from the axis of both of its bodies.
    u_h = (x_h - w - c) * cosine - z_h * sine
    u_f = -c * cosine + r_front * sine
    mu_a = m_h * u_h + m_f * u_f
    a_xx, a_zz, a_xz = h_xx + i_f, h_zz + i_f, h_xz
    a_ll = m_h * u_h**2 + m_f * u_f**2 + a_xx * sine**2 + 2 * a_xz * sine * cosine + a_zz * cosine**2
    a_lx = -m_h * u_h * z_h + m_f * u_f * r_front + a_xx * sine + a_xz * cosine
    a_lz = m_h * u_h * x_h + m_f * u_f * w + a_xz * sine + a_zz * cosine
    # Mechanical trail over wheelbase, gyrostatic coefficients, static moment (A15-A17).
    mu = c / w * cosine
    s_f = p["front_wheel_Iyy"] / r_front
    s_t = p["rear_wheel_Iyy"] / r_rear + s_f
    s_a = mu_a + mu * mx_t
    # A18-A20.
    m_pd = a_lx + mu * t_xz
    mass = [[t_xx, m_pd], [m_pd, a_ll + 2 * mu * a_lz + mu**2 * t_zz]]
    k0 = [[mz_t, -s_a], [-s_a, -s_a * sine]]
    k2 = [[0.0, (s_t - mz_t) / w * cosine], [0.0, (s_a + s_f * sine) / w * cosine]]
    gyro = mu * s_t + s_f * cosine
    c1 = [
        [0.0, gyro + t_xz / w * cosine - mu * mz_t],
        [-gyro, a_lz / w * cosine + mu * (s_a + t_zz / w * cosine)],
    ]
    return np.array(mass), np.array(c1), np.array(k0), np.array(k2)


def _mixed(a: np.ndarray, b: np.ndarray) -> Any:
    """Return the part of det(a + b) that is linear in both 2 x 2 matrices."""
    return a[0, 0] * b[1, 1] + a[1, 1] * b[0, 0] - a[0, 1] * b[1, 0] - a[1, 0] * b[0, 1]


def _coefficients(m: CanonicalMatrices) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a4, a3, a2, a1 and a0 of the characteristic polynomial; arrays are polynomials of the speed.

    Their highest power comes first.
    """
    stiff, damped = m.gravity * m.K0, np.diag([0.0, m.steer_damping])
    a3 = np.array([_mixed(m.M, m.C1), _mixed(m.M, damped)])
    a2 = np.array([_mixed(m.M, m.K2) + _mixed(m.C1, m.C1) / 2, _mixed(m.C1, damped), _mixed(m.M, stiff)])
    a1 = np.array([_mixed(m.C1, m.K2), _mixed(damped, m.K2), _mixed(m.C1, stiff), _mixed(damped, stiff)])
    zero = 0 * a3[0]
    a0 = np.array([_mixed(m.K2, m.K2) / 2, zero, _mixed(m.K2, stiff), zero, _mixed(stiff, stiff) / 2])
    return _mixed(m.M, m.M) / 2, a3, a2, a1, a0


def _boundary_polynomials(m: CanonicalMatrices) -> tuple[np.ndarray, np.ndarray]:
    """Return the polynomials of the speed that vanish with an eigenvalue and with the sum of a pair of eigenvalues.

    They are a0 and a1 a2 a3 - a4 a1^2 - a0 a3^2.
    """
    a4, a3, a2, a1, a0 = _coefficients(m)
    sum_of_pair = np.polysub(np.polymul(a3, np.polymul(a2, a1)), a4 * np.polymul(a1, a1))
    return a0, np.polysub(sum_of_pair, np.polymul(np.polymul(a3, a3), a0))


def _crossings(polynomial: np.ndarray) -> list[float]:
    """Return the positive speeds at which a polynomial of the speed changes its sign."""
    found = []
    for root in np.roots(polynomial):
        speed = float(root.real)
        if speed <= 0 or abs(root.imag) > _REAL * abs(root):
            continue
        # At a double root the sign does not change: the slope is round-off of its terms.
        slope = np.polyval(np.polyder(polynomial), speed)
        if abs(slope) * speed > _REAL * np.polyval(np.abs(polynomial), speed):
            found.append(speed)
    return found


def _growth_slope(m: CanonicalMatrices, mode: str, speed: float) -> float | None:
    """Return the derivative by speed of the real part of the eigenvalues that are on the imaginary axis there.

    None if the pair whose sum vanishes is not on the imaginary axis but real, of opposite signs.
    """
    a4, *lower = _coefficients(m)
    a3, a2, a1, _ = (float(np.polyval(a, speed)) for a in lower)
    root: complex = 0.0
    if mode == "weave":
        squared_frequency = a1 / a3
        if squared_frequency <= 0:
            return None
        root = 1j * squared_frequency**0.5
    # Of p(s, v) = a4 s^4 + a3 s^3 + a2 s^2 + a1 s + a0: ds/dv = -(dp/dv) / (dp/ds).
    by_root = 4 * a4 * root**3 + 3 * a3 * root**2 + 2 * a2 * root + a1
    by_speed = sum(np.polyval(np.polyder(a), speed) * root**k for a, k in zip(lower, (3, 2, 1, 0), strict=True))
    return float((-by_speed / by_root).real)
