"""Whether circular motions can be ridden, and why not, see `velodrome.reference.kernels.rideability`.

The equations of circular motions contain each wheel's contact only, as a constraint in both directions. A solution may
need the ground to pull a wheel; in a bowl about as tight as a wheel, its rim may lie inside the ground elsewhere; and
on a short bicycle the wheels may overlap. Frames have no known shape, so nothing is said of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .bicycle import Bicycle
from .circular import CONTACT, FORCE, LEAN, PITCH, STEER, CircularMotion
from .kernels import rideability as kernel
from .kernels.steady import UNKNOWNS
from .kinematics import WHEELS, constants
from .rim import bicycle_rim_search, describe_rim_depth, require_clear_rims
from .surface import Surface
from .wheel_overlap import describe_overlap

# What makes a motion impossible to ride, in the order of the kernel's margins.
OBSTACLES = (
    "rear wheel not pushed",
    "front wheel not pushed",
    "rear rim touches twice",
    "front rim touches twice",
    "wheels overlap",
)
_RIMS = slice(2, 4)


@dataclass(frozen=True)
class Rideability:
    """Whether n motions can be ridden.

    Attributes
    ----------
    margins : ndarray, shape (n, 5)
        Margins in the order of `OBSTACLES`: normal forces in weights, clearances of the rims, distance of the wheels
        [m]. A motion can be ridden where all are positive.
    friction : ndarray, shape (n, 2)
        Coefficient of friction that the rear and the front wheel need to roll; inf where the ground does not push.
    """

    margins: np.ndarray
    friction: np.ndarray

    @property
    def physical(self) -> np.ndarray:
        """Whether each motion can be ridden, shape (n,)."""
        return np.all(self.margins > 0, axis=1)

    @property
    def rims_clear(self) -> np.ndarray:
        """Whether both rims touch the ground at their contacts only, shape (n,)."""
        return np.all(self.margins[:, _RIMS] > 0, axis=1)

    @property
    def codes(self) -> np.ndarray:
        """Sum over the obstacles of each motion of 2 to the power of their index in `OBSTACLES`, shape (n,), uint8."""
        return np.packbits(~(self.margins > 0), axis=1, bitorder="little")[:, 0]

    def list_obstacles(self) -> list[list[str]]:
        """Return those of the `OBSTACLES` that each motion meets, n lists."""
        return [[name for name, margin in zip(OBSTACLES, row, strict=True) if not margin > 0] for row in self.margins]


def assess_motions(bicycle: Bicycle, surface: Surface, unknowns: np.ndarray) -> Rideability:
    """Assess whether motions can be ridden.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    unknowns : ndarray, shape (n, 22)
        Solutions, see `velodrome.reference.kernels.steady`.

    Returns
    -------
    Rideability
    """
    rows = np.ascontiguousarray(unknowns, float)
    margins, friction = np.empty((len(rows), kernel.MARGINS)), np.empty((len(rows), len(WHEELS)))
    search, function = bicycle_rim_search(bicycle, surface), surface.function.real
    kernel.fill_margins(rows, search, function, surface.parameters, constants(bicycle), margins, friction)
    return Rideability(margins, friction)


def assess_state(
    bicycle: Bicycle, surface: Surface, q: np.ndarray, contact: np.ndarray, force: np.ndarray
) -> Rideability:
    """Assess whether one steady motion can be ridden.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q : ndarray, shape (9,)
        Coordinates, at a yaw of 0.
    contact, force : ndarray, shape (2, 3)
        Contact parameters (xi, eta, rim angle) and contact forces [N].

    Returns
    -------
    Rideability
        Of n = 1 motion.
    """
    unknowns = np.zeros((1, UNKNOWNS))
    unknowns[0, :3], unknowns[0, [LEAN, PITCH, STEER]] = q[:3], q[[4, 5, 6]]
    unknowns[0, CONTACT] = contact.ravel()
    unknowns[0, FORCE] = force.ravel() / (bicycle.mass * bicycle.gravity)
    return assess_motions(bicycle, surface, unknowns)


def explain_obstacles(
    bicycle: Bicycle, surface: Surface, q: np.ndarray, contact: np.ndarray, force: np.ndarray
) -> tuple[str, ...]:
    """Explain why one steady motion cannot be ridden: one text for each obstacle, none if it can.

    Parameters
    ----------
    bicycle, surface, q, contact, force
        As in `assess_state`.
    """
    margins = assess_state(bicycle, surface, q, contact, force).margins[0]
    weight, reasons = bicycle.mass * bicycle.gravity, []
    for wheel, margin in zip(WHEELS, margins, strict=False):
        normal = weight * (margin + kernel.PUSHED)
        if not margin > 0:
            verb = "would have to pull" if margin < -2 * kernel.PUSHED else "does not push"
            reasons.append(f"the ground {verb} the {wheel} wheel: {normal:.3g} N")
    for k, (wheel, margin) in enumerate(zip(WHEELS, margins[_RIMS], strict=True)):
        if not margin > 0:
            reasons.append(
                f"the {wheel} rim touches the ground at a second place{describe_rim_depth(bicycle, surface, q, k)}"
            )
    if not margins[-1] > 0:
        reasons.append(describe_overlap(kernel.TOUCHING - margins[-1]))
    return tuple(reasons)


def explain_motion(bicycle: Bicycle, surface: Surface, motion: CircularMotion) -> tuple[str, ...]:
    """Explain why a circular motion cannot be ridden: one text for each obstacle, none if it can."""
    return explain_obstacles(bicycle, surface, motion.state()[0], motion.contact, motion.force)


def require_standing(bicycle: Bicycle, surface: Surface, motion: CircularMotion) -> None:
    """Refuse a motion with a rim inside the ground.

    Raises
    ------
    ValueError
        If a rim is not clear, with the motion, the wheel, the depth and the place.
    """
    try:
        require_clear_rims(bicycle, surface, motion.state()[0], motion.contact.ravel())
    except ValueError as error:
        angles = f"lean {motion.lean:.6g}, steer {motion.steer:.6g}"
        raise ValueError(f"no bicycle can ride the solution at {angles} on {surface}: {error}") from error
