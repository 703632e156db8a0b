"""Settings of the Drake engines: Drake's own choices, and what a bicycle needs beside them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ..engine import Settings

ROUND_OFF = 2.0**-52
# Relative tolerance of the optimality condition at which Drake's convex solver SAP stops.
SAP_TOLERANCE = 1e-6


class MultiplierSettings(Settings):
    """Drake's tree and integrators, without its contacts."""

    step: float = Field(
        default=0.005,
        ge=1e-6,
        le=0.02,
        description="time step [s]; must divide the output interval",
        json_schema_extra={"unit": "s"},
    )
    integrator: Literal[
        "explicit_euler", "semi_explicit_euler", "runge_kutta2", "runge_kutta3", "bogacki_shampine3", "runge_kutta5"
    ] = Field(default="runge_kutta3", description="Drake's integrator with fixed steps; Drake's default is runge_kutta3")
    stabilisation: float = Field(
        default=20.0,
        ge=0,
        le=1000,
        description="rate at which gaps and slip are brought back to zero [1/s]",
        json_schema_extra={"unit": "1/s"},
    )

    @property
    def noise(self) -> float:
        """Relative error that a step may add beyond its method."""
        return ROUND_OFF

    @property
    def least_friction(self) -> float | None:
        """None: the wheels are bound to roll."""
        return None
