"""Settings of the engine in DART."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from velodrome.engines.engine import Settings

ROUND_OFF = 2.0**-52
# The matrix that Dantzig's method factorises has a condition of some 1e3, as that of the bicycle's masses.
CONDITION = 1e3


class DartSettings(Settings):
    """How DART steps, and what touches the ground."""

    step: float = Field(
        default=1e-3,
        ge=1e-5,
        le=0.01,
        description="time step [s], by default that of DART's world; it must divide the output interval",
        json_schema_extra={"unit": "s"},
    )
    solver: Literal["boxed-lcp", "nsgs"] = Field(
        default="boxed-lcp",
        description="DART's contact solver: boxed-lcp is its default, Dantzig's method, whose friction is bounded by "
        "what the normal force would be without friction; nsgs is its NsgsFrictionSolver with Coulomb's law, which "
        "iterates",
    )
    friction: float = Field(
        default=10.0,
        ge=0,
        le=100,
        description="coefficient of friction; boxed-lcp needs 6.6 on plane-circle, where the forces need 0.996, and "
        "nsgs rides with 1.1 (DART's default is 1)",
        json_schema_extra={"unit": "1"},
    )
    half_thickness: float = Field(
        default=1e-6,
        ge=1e-8,
        le=0.05,
        description="half the width of the wheels, which are cylinders; an upright bicycle stands on either edge, so "
        "that a width of 0.2 mm leads it astray by metres in 20 s",
        json_schema_extra={"unit": "m"},
    )
    detector: Literal["bullet", "ode"] = Field(
        default="bullet",
        description="DART's collision detector; fcl, its default, and dart have contacts of a thin cylinder that are "
        "off by up to millimetres",
    )
    accuracy: float = Field(
        default=1e-8,
        ge=1e-12,
        le=1e-2,
        description="tolerance of nsgs; DART's default is 1e-5",
        json_schema_extra={"unit": "1"},
    )
    iterations: int = Field(
        default=10_000,
        ge=1,
        le=1_000_000,
        description="largest number of sweeps of nsgs in a step; DART's default is 100",
        json_schema_extra={"unit": "1"},
    )

    @property
    def noise(self) -> float:
        """Relative error that the contact solver may leave in a step."""
        return CONDITION * ROUND_OFF if self.solver == "boxed-lcp" else self.accuracy
