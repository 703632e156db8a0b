"""The benchmark bicycle: 25 parameters of four rigid bodies, and gravity."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

BODIES = ("rear_frame", "front_frame", "rear_wheel", "front_wheel")

# Moments of inertia are measured to one or two percent (Moore 2012), so three of them may miss the triangle inequality
# by some percent.
LARGEST_EXCESS = 0.05
_ROUND_OFF = 1e-12


@dataclass(frozen=True)
class Bicycle:
    """Geometry and mass distribution of the Whipple bicycle.

    The 25 parameters of Meijaard et al. (2007), Table 1, written for axes x forward, y left and
    **z up** with the origin at the rear contact point of the upright bicycle: heights and products
    of inertia have the opposite sign to the table. The defaults are the table's values.

    Parameters
    ----------
    wheelbase, trail : float
        Wheelbase (distance between the contact points) and trail [m].
    steer_axis_tilt : float
        Tilt of the steering axis from the vertical, backwards [rad].
    gravity : float
        Gravitational acceleration [m/s^2].
    rear_wheel_radius, front_wheel_radius : float
        Radii of the knife edges [m].
    rear_wheel_mass, rear_frame_mass, front_frame_mass, front_wheel_mass : float
        Masses [kg].
    rear_wheel_Ixx, rear_wheel_Iyy, front_wheel_Ixx, front_wheel_Iyy : float
        Moments of inertia about a diameter and about the axle [kg m^2].
    rear_frame_x, rear_frame_z, front_frame_x, front_frame_z : float
        Centres of mass [m].
    rear_frame_Ixx, ..., front_frame_Ixz : float
        Entries of the inertia tensors about the centres of mass [kg m^2].

    Raises
    ------
    ValueError
        If a parameter is not finite, a length is not positive, or a mass or a principal moment is negative. The
        triangle inequality of principal moments is not asked for here, see `require_rigid_bodies`.
    """

    wheelbase: float = 1.02
    trail: float = 0.08
    steer_axis_tilt: float = math.pi / 10
    gravity: float = 9.81
    rear_wheel_radius: float = 0.3
    rear_wheel_mass: float = 2.0
    rear_wheel_Ixx: float = 0.0603
    rear_wheel_Iyy: float = 0.12
    rear_frame_x: float = 0.3
    rear_frame_z: float = 0.9
    rear_frame_mass: float = 85.0
    rear_frame_Ixx: float = 9.2
    rear_frame_Iyy: float = 11.0
    rear_frame_Izz: float = 2.8
    rear_frame_Ixz: float = -2.4
    front_frame_x: float = 0.9
    front_frame_z: float = 0.7
    front_frame_mass: float = 4.0
    front_frame_Ixx: float = 0.05892
    front_frame_Iyy: float = 0.06
    front_frame_Izz: float = 0.00708
    front_frame_Ixz: float = 0.00756
    front_wheel_radius: float = 0.35
    front_wheel_mass: float = 3.0
    front_wheel_Ixx: float = 0.1405
    front_wheel_Iyy: float = 0.28

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise ValueError(f"bicycle parameter {field.name} is {value!r}; it must be a finite number")
        for name in ("wheelbase", "gravity", "rear_wheel_radius", "front_wheel_radius"):
            if getattr(self, name) <= 0:
                raise ValueError(f"bicycle parameter {name} is {getattr(self, name)!r}; it must be positive")
        for body in BODIES:
            if self.body_mass(body) < 0:
                raise ValueError(f"bicycle parameter {body}_mass is {self.body_mass(body)!r}; it must not be negative")
        if self.mass == 0:
            raise ValueError("bicycle parameters *_mass are all zero; at least one body must have mass")
        if abs(self.steer_axis_tilt) >= math.pi / 2:
            raise ValueError(f"bicycle parameter steer_axis_tilt is {self.steer_axis_tilt!r}; it must be within +-pi/2")
        for body in BODIES:
            principal = np.linalg.eigvalsh(self.inertia(body))
            if principal[0] < -_ROUND_OFF * principal[2]:
                raise ValueError(
                    f"bicycle parameters {body}_I*: principal moments {principal.tolist()} are not those of a rigid "
                    "body; none may be negative"
                )
            if principal[2] > 0 and self.body_mass(body) == 0:
                raise ValueError(f"bicycle parameters {body}_I*: a rigid body without mass has no moment of inertia")

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return self.rear_wheel_mass + self.rear_frame_mass + self.front_frame_mass + self.front_wheel_mass

    @property
    def reference_point(self) -> np.ndarray:
        """Point D at rest, shape (3,) [m]: on the steering axis at the height of the front wheel's centre."""
        height = self.front_wheel_radius
        return np.array([self.wheelbase + self.trail - height * math.tan(self.steer_axis_tilt), 0.0, height])

    @property
    def steer_axis(self) -> np.ndarray:
        """Unit vector along the steering axis at rest, upwards, shape (3,)."""
        return np.array([-math.sin(self.steer_axis_tilt), 0.0, math.cos(self.steer_axis_tilt)])

    def triangle_excess(self, body: str) -> float:
        """Return by what share the largest principal moment of a body exceeds the sum of the other two.

        Zero for every distribution of mass. Moments that were measured one by one may exceed it by their scatter.
        """
        small, middle, large = np.linalg.eigvalsh(self.inertia(body))
        # A thin ring has no excess; what its moments have is round-off.
        if large <= (small + middle) * (1 + _ROUND_OFF):
            return 0.0
        return float(large / (small + middle) - 1) if small + middle > 0 else np.inf

    def warnings(self) -> tuple[str, ...]:
        """Return a line for each body whose principal moments no rigid body can have."""
        return tuple(
            f"{body}: the largest principal moment exceeds the sum of the other two by {100 * excess:.3g} %; "
            "no rigid body has such moments, measured ones may"
            for body in BODIES
            if (excess := self.triangle_excess(body)) > 0
        )

    def body_mass(self, body: str) -> float:
        """Mass of a body named in `BODIES` [kg]."""
        return getattr(self, f"{body}_mass")

    def centre(self, body: str) -> np.ndarray:
        """Centre of mass of a body at rest, shape (3,) [m], with the origin at the rear contact point."""
        if body == "rear_wheel":
            return np.array([0.0, 0.0, self.rear_wheel_radius])
        if body == "front_wheel":
            return np.array([self.wheelbase, 0.0, self.front_wheel_radius])
        return np.array([getattr(self, f"{body}_x"), 0.0, getattr(self, f"{body}_z")])

    def inertia(self, body: str) -> np.ndarray:
        """Inertia tensor of a body about its centre of mass at rest, shape (3, 3) [kg m^2]."""
        ixx, iyy = getattr(self, f"{body}_Ixx"), getattr(self, f"{body}_Iyy")
        izz, ixz = ixx, 0.0
        if body.endswith("frame"):
            izz, ixz = getattr(self, f"{body}_Izz"), getattr(self, f"{body}_Ixz")
        return np.array([[ixx, 0.0, ixz], [0.0, iyy, 0.0], [ixz, 0.0, izz]])


def require_rigid_bodies(bicycle: Bicycle) -> None:
    """Refuse principal moments that break the triangle inequality by more than the scatter of a measurement.

    Raises
    ------
    ValueError
        With the body and by how much.
    """
    for body in BODIES:
        excess = bicycle.triangle_excess(body)
        if excess > LARGEST_EXCESS:
            raise ValueError(
                f"bicycle parameters {body}_I*: principal moments {np.linalg.eigvalsh(bicycle.inertia(body)).tolist()} "
                f"are not those of a rigid body; the largest exceeds the sum of the other two by {100 * excess:.3g} %, "
                f"and the scatter of a measurement explains {100 * LARGEST_EXCESS:g} % at the most"
            )
