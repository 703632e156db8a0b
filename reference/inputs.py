"""Generalised forces on the bicycle: a steer torque, a torque on the rear wheel and steer damping.

They enter the equations of motion M qdd + h = J^T F + Q (Xiong et al. 2020, Eq. 8, where Q = 0) as

    Q[steer] = steer_torque - steer_damping steer_rate,    Q[rear_angle] = rear_wheel_torque

Both act between two bodies, so that they do the work of the coordinate between them and no other:

    d(energy)/dt = steer_torque steer_rate + rear_wheel_torque rear_rate - steer_damping steer_rate^2
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from numbers import Real


@dataclass(frozen=True)
class Inputs:
    """Constant torques on the bicycle and the damping of its steering; by default there are none.

    Attributes
    ----------
    steer_torque : float
        Torque on the front frame against the rear frame about the steering axis, positive to the left [N m].
    rear_wheel_torque : float
        Torque on the rear wheel against the rear frame, positive forward [N m].
    steer_damping : float
        Coefficient c of the torque -c steer_rate on the front frame against the rear frame, at least 0 [N m s/rad].

    Raises
    ------
    ValueError
        If a value is not a finite number, or the damping is negative.
    """

    steer_torque: float = 0.0
    rear_wheel_torque: float = 0.0
    steer_damping: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            given = getattr(self, field.name)
            if not isinstance(given, Real) or isinstance(given, bool) or not math.isfinite(given):
                raise ValueError(f"{field.name} is {given!r}; it must be a finite number")
            # Adding 0 turns -0 into 0, which prints alike.
            object.__setattr__(self, field.name, float(given) + 0.0)
        if self.steer_damping < 0:
            raise ValueError(f"steer_damping is {self.steer_damping!r}; it must not be negative")

    def describe(self) -> str:
        """Return the inputs that are not zero as text, empty if there is none."""
        units = {"steer_torque": "N m", "rear_wheel_torque": "N m", "steer_damping": "N m s/rad"}
        given = ((name, getattr(self, name)) for name in units)
        return ", ".join(f"{name} {value!r} {units[name]}" for name, value in given if value != 0)


NO_INPUTS = Inputs()
