"""Measure how strongly each mode of a motion is excited along a ride.

On a circular motion the independent variables v (`velodrome.reference.stability.VARIABLES`) are constant, and a small
deviation d from them obeys d' = J d. With left and right eigenvectors w, r of J, w r = 1, the amplitude of a mode
is

    a = w d,    d = sum of a r,    |a| ~ exp(Re(lambda) t)

A pair of complex modes rotates in its plane and counts as one mode of twice the size. r is scaled so that a is the
mode's own contribution to an angle, the larger of lean and steer. For the zero mode, which leads along the family of
circles, it is the contribution to the rear wheel's rate. On the level plane J does not depend on the position of the
bicycle; there position is left out, and with it the modes that shift a circle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.inputs import NO_INPUTS, Inputs
from ...reference.kinematics import YAW
from ...reference.stability import are_zero, eigenvalue_order, independent, linearise
from ...reference.surface import Surface, is_level

_POSITION = 2  # number of position variables, x and y, which come first among the independent variables
_LEAN_AND_STEER = slice(2, 4)
_REAR_RATE = 6
# Largest imaginary part of real eigenvalues, which differ from real numbers by round-off alone [1/s].
_LARGEST_IMAGINARY = 1e-9


@dataclass(frozen=True)
class Mode:
    """A mode, or a pair of conjugate modes.

    Attributes
    ----------
    name : str
        The field's term for it if it can be identified.
    eigenvalue : complex
        That of the pair with the positive imaginary part [1/s].
    left : ndarray, shape (7,), complex
        Row vector that gives the amplitude of a deviation.
    unit : str
        Unit of the amplitude: ``rad``, or ``rad/s`` of the rear wheel.
    """

    name: str
    eigenvalue: complex
    left: np.ndarray
    unit: str

    @property
    def title(self) -> str:
        """Name and eigenvalue as text."""
        real, imaginary = _format_signed(self.eigenvalue.real), abs(self.eigenvalue.imag)
        turning = f" ± {imaginary:.3g}i" if imaginary else ""
        return f"{self.name} {real}{turning} 1/s"


@dataclass(frozen=True)
class Modes:
    """Modes of the motion on which a ride started.

    Attributes
    ----------
    motion : ndarray, shape (7,)
        Independent variables of the motion.
    modes : tuple of Mode
        Sorted from the fastest decay to the fastest growth.
    """

    motion: np.ndarray
    modes: tuple[Mode, ...]

    def amplitude(self, mode: Mode, ride: Trajectory) -> np.ndarray:
        """Return the amplitude of a mode along a ride, in the mode's unit, shape (n,)."""
        return np.abs((independent(ride.q, ride.qd) - self.motion) @ mode.left)


def find_modes(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray, inputs: Inputs = NO_INPUTS) -> Modes:
    """Return the modes of a circular motion, or of a straight upright one.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
        A surface of revolution about z, or a plane.
    q, qd : ndarray, shape (9,)
        The undisturbed motion.
    inputs : Inputs
        Held constant.

    Returns
    -------
    Modes
        Modes whose eigenvalues are too close to be told apart are left out.
    """
    jacobian = linearise(bicycle, surface, q, qd, inputs).jacobian
    first = _POSITION if is_level(surface) else 0
    values, right = np.linalg.eig(jacobian[first:, first:])
    left = np.zeros((len(values), 7), complex)
    left[:, first:] = np.linalg.inv(right)
    right = np.concatenate([np.zeros((first, len(values)), complex), right])
    real = are_zero(values) | (np.abs(np.imag(values)) <= _LARGEST_IMAGINARY)
    values = np.where(real, np.real(values), values)
    upper = [k for k in eigenvalue_order(values) if np.imag(values[k]) >= 0]
    zero = min(upper, key=lambda k: abs(values[k]))
    names = _name_modes(values[upper], upper.index(zero), 0.0 if first else abs(float(qd[YAW])))
    modes = []
    for k, name in zip(upper, names, strict=True):
        share = right[_REAR_RATE, k] if k == zero else max(right[_LEAN_AND_STEER, k], key=abs)
        pair = 2 if np.imag(values[k]) else 1
        value = 0j if k == zero else complex(values[k])
        modes.append(Mode(name, value, pair * left[k] * share, "rad/s" if k == zero else "rad"))
    return Modes(independent(q, qd), tuple(modes))


def _name_modes(values: np.ndarray, zero: int, yaw_rate: float) -> list[str]:
    """Return names of modes (n,), pairs given by their upper eigenvalue.

    The names continue those on the plane, where they are unambiguous, along a family of motions. The pair nearest to i
    times the yaw rate is the orbital one, by which a bowl returns the circle's centre; the remaining pair is the
    weave. Of two real modes the faster is castering, the other capsize. Modes in other numbers get no names.
    """
    names = ["family" if k == zero else "pair" if value.imag else "real" for k, value in enumerate(values)]
    pairs = sorted((k for k, name in enumerate(names) if name == "pair"), key=lambda k: abs(values[k] - 1j * yaw_rate))
    real = sorted((k for k, name in enumerate(names) if name == "real"), key=lambda k: values[k].real)
    if len(real) == 2 and len(pairs) == (2 if yaw_rate else 1):
        for k, name in zip([*real, *reversed(pairs)], ("castering", "capsize", "weave", "orbital"), strict=False):
            names[k] = name
    return names


def _format_signed(value: float) -> str:
    return "0" if value == 0 else f"{value:.3g}".replace("-", "−")
