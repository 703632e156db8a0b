"""Settings of the Drake engines: Drake's own choices, and what a bicycle needs beside them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ..engine import Settings

ROUND_OFF = 2.0**-52
# Relative tolerances at which Drake's solvers stop. That of SAP, which also solves lagged and similar, is one of the
# balance of momentum (SapSolverParameters), that of TAMSI one of slip (TamsiSolverParameters).
SAP_TOLERANCE = 1e-6
TAMSI_TOLERANCE = 1e-2


class DrakeMultiplierSettings(Settings):
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
    ] = Field(
        default="runge_kutta3", description="Drake's integrator with fixed steps; Drake's default is runge_kutta3"
    )
    stabilisation: float = Field(
        default=1.0,
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


class DrakeContactSettings(Settings):
    """Drake's own discrete contacts, with Drake's defaults where a description names them."""

    step: float = Field(
        default=0.001,
        ge=1e-6,
        le=0.02,
        description="time step [s]; must divide the output interval; Drake's default is 0.001",
        json_schema_extra={"unit": "s"},
    )
    solver: Literal["lagged", "similar", "sap", "tamsi"] = Field(
        default="lagged", description="Drake's discrete contact approximation; Drake's default is lagged"
    )
    friction: float = Field(
        default=2.0,
        gt=0,
        le=100,
        description="coefficient of friction; with Drake's default of 0.5 the wheels slide",
        json_schema_extra={"unit": "1"},
    )
    stiffness: float = Field(
        default=1e8,
        gt=0,
        le=1e15,
        description="stiffness of the wheels and the ground (point_stiffness) [N/m], half of it where they touch; with "
        "Drake's default of 1e6 the bicycle sinks in by 1 mm",
        json_schema_extra={"unit": "N/m"},
    )
    dissipation: float = Field(
        default=50.0,
        ge=0,
        le=1e6,
        description="Hunt-Crossley dissipation of lagged, similar and tamsi [s/m]; Drake's default is 50",
        json_schema_extra={"unit": "s/m"},
    )
    relaxation_time: float = Field(
        default=0.1,
        ge=0,
        le=100,
        description="relaxation time of the linear dissipation of sap [s]; Drake's default is 0.1",
        json_schema_extra={"unit": "s"},
    )
    stiction_tolerance: float = Field(
        default=1e-4,
        gt=0,
        le=1,
        description="slip at which friction of lagged, similar and tamsi is full [m/s]; Drake's default is 1e-4",
        json_schema_extra={"unit": "m/s"},
    )
    near_rigid_threshold: float = Field(
        default=1.0,
        ge=0,
        le=10,
        description="how far sap softens contacts that are stiff for its step (sap_near_rigid_threshold); Drake's "
        "default is 1",
        json_schema_extra={"unit": "1"},
    )

    @property
    def noise(self) -> float:
        """Relative error that a step may add beyond its method: what the contact solver may leave unconverged.

        TAMSI's tolerance is one of slip, relative to the stiction tolerance; it is taken against a speed of 1 m/s.
        """
        return TAMSI_TOLERANCE * self.stiction_tolerance if self.solver == "tamsi" else SAP_TOLERANCE

    @property
    def least_friction(self) -> float:
        """Coefficient of friction in every direction."""
        return self.friction
