"""Settings of the engine in Pinocchio."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ..engine import Settings

ROUND_OFF = 2.0**-52


class ConstraintSettings(Settings):
    """How Pinocchio's accelerations are integrated, and how its solver finds them."""

    step: float = Field(
        default=0.005,
        ge=1e-6,
        le=0.02,
        description="time step [s], by default that of Pinocchio's example simulation-contact-dynamics.py; "
        "must divide the output interval",
        json_schema_extra={"unit": "s"},
    )
    integrator: Literal["rk4", "semi-implicit-euler"] = Field(
        default="rk4",
        description="Runge-Kutta's method of order 4, or the method of Pinocchio's examples, of order 1: velocities "
        "first, then pinocchio.integrate with the new ones",
    )
    accuracy: float = Field(
        default=1e-9,
        ge=1e-12,
        le=1,
        description="change of the contact forces between two proximal iterations at which they stop (the relative "
        "accuracy of Pinocchio's ProximalSettings); Pinocchio's example has 1e-12, which round-off may not reach",
        json_schema_extra={"unit": "N"},
    )
    regularisation: float = Field(
        default=1e-12,
        ge=0,
        le=1e-2,
        description="mu of the proximal iteration (ProximalSettings), by default that of Pinocchio's example; it "
        "changes the number of iterations and not their limit",
        json_schema_extra={"unit": "1/kg"},
    )
    iterations: int = Field(
        default=10,
        ge=2,
        le=1000,
        description="largest number of proximal iterations (ProximalSettings), by default that of Pinocchio's example",
        json_schema_extra={"unit": "1"},
    )
    baumgarte_kp: float = Field(
        default=0.0,
        ge=0,
        le=1e6,
        description="Kp of Pinocchio's Baumgarte corrector, on the gaps; 0 is Pinocchio's default, without correction",
        json_schema_extra={"unit": "1/s^2"},
    )
    baumgarte_kd: float = Field(
        default=0.0,
        ge=0,
        le=1e3,
        description="Kd of Pinocchio's Baumgarte corrector, on the velocities of the contacts; 0 is Pinocchio's "
        "default, without correction",
        json_schema_extra={"unit": "1/s"},
    )
