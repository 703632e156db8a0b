"""How strongly each mode of a motion is excited along a ride.

On a circular motion the independent variables v (`velodrome.reference.stability.VARIABLES`) are constant, and a small
deviation d from them obeys d' = J d. With left and right eigenvectors w, r of J, w r = 1, the amplitude of a mode
is

    a = w d,    d = sum of a r,    |a| ~ exp(Re(lambda) t)

A pair of complex modes turns in its plane and counts as one, twice the size. r is scaled so that a is the mode's
own share of an angle, the larger of lean and steer; the zero mode, which leads along the family of circles, has
the rear wheel's rate instead. On the level plane J does not depend on where the bicycle is: place is left out, and
with it the modes that shift a circle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.kinematics import YAW
from ...reference.stability import are_zero, eigenvalue_order, independent, linearise
from ...reference.surface import Surface, is_level

_PLACE = 2  # x and y stand first among the independent variables
_ANGLES = slice(2, 4)
_RATE = 6
# Eigenvalues of modes that are one pair differ from conjugates by round-off alone.
_REAL = 1e-9


@dataclass(frozen=True)
class Mode:
    """A mode, or a pair of conjugate modes.

    Attributes
    ----------
    name : str
        The field's word for it where it can be told.
    eigenvalue : complex
        The one of the pair with the positive imaginary part [1/s].
    left : ndarray, shape (7,), complex
        Row that gives the amplitude of a deviation.
    unit : str
        Of the amplitude: ``rad``, or ``rad/s`` of the rear wheel.
    """

    name: str
    eigenvalue: complex
    left: np.ndarray
    unit: str

    @property
    def title(self) -> str:
        """Name and eigenvalue in words."""
        real, imaginary = _signed(self.eigenvalue.real), abs(self.eigenvalue.imag)
        turning = f" ± {imaginary:.3g}i" if imaginary else ""
        return f"{self.name} {real}{turning} 1/s"


@dataclass(frozen=True)
class Modes:
    """Modes of the motion that a ride started from.

    Attributes
    ----------
    motion : ndarray, shape (7,)
        Independent variables of the motion.
    modes : tuple of Mode
        From the fastest decay to the fastest growth.
    """

    motion: np.ndarray
    modes: tuple[Mode, ...]

    def amplitude(self, mode: Mode, ride: Trajectory) -> np.ndarray:
        """Amplitude of a mode along a ride, in the mode's unit, shape (n,)."""
        return np.abs((independent(ride.q, ride.qd) - self.motion) @ mode.left)


def find_modes(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray) -> Modes:
    """Modes of a circular motion, or of a straight upright one.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
        A surface of revolution about z, or a plane.
    q, qd : ndarray, shape (9,)
        The undisturbed motion.

    Returns
    -------
    Modes
        Without those that decay or grow so alike that they cannot be told apart.
    """
    jacobian = linearise(bicycle, surface, q, qd).jacobian
    first = _PLACE if is_level(surface) else 0
    values, right = np.linalg.eig(jacobian[first:, first:])
    left = np.zeros((len(values), 7), complex)
    left[:, first:] = np.linalg.inv(right)
    right = np.concatenate([np.zeros((first, len(values)), complex), right])
    real = are_zero(values) | (np.abs(np.imag(values)) <= _REAL)
    values = np.where(real, np.real(values), values)
    upper = [k for k in eigenvalue_order(values) if np.imag(values[k]) >= 0]
    zero = min(upper, key=lambda k: abs(values[k]))
    names = _names(values[upper], upper.index(zero), 0.0 if first else abs(float(qd[YAW])))
    modes = []
    for k, name in zip(upper, names, strict=True):
        share = right[_RATE, k] if k == zero else max(right[_ANGLES, k], key=abs)
        pair = 2 if np.imag(values[k]) else 1
        value = 0j if k == zero else complex(values[k])
        modes.append(Mode(name, value, pair * left[k] * share, "rad/s" if k == zero else "rad"))
    return Modes(independent(q, qd), tuple(modes))


def _names(values: np.ndarray, zero: int, yaw_rate: float) -> list[str]:
    """Names of modes (n,), pairs by their upper eigenvalue.

    As along a family from the plane, where they are plain: a pair near i times the yaw rate is the orbital one, a
    bowl's hold on the circle's centre; then one pair is left, the weave, and of two real ones the faster is
    castering, the other capsize. Where anything else is found they have no names.
    """
    names = ["family" if k == zero else "pair" if value.imag else "real" for k, value in enumerate(values)]
    pairs = sorted((k for k, name in enumerate(names) if name == "pair"), key=lambda k: abs(values[k] - 1j * yaw_rate))
    real = sorted((k for k, name in enumerate(names) if name == "real"), key=lambda k: values[k].real)
    if len(real) == 2 and len(pairs) == (2 if yaw_rate else 1):
        for k, name in zip([*real, *reversed(pairs)], ("castering", "capsize", "weave", "orbital"), strict=False):
            names[k] = name
    return names


def _signed(value: float) -> str:
    return "0" if value == 0 else f"{value:.3g}".replace("-", "−")
