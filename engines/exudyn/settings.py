"""Settings of the engine's implicit solvers."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ..engine import Settings


class SolverSettings(Settings):
    """Settings common to all engines in Exudyn."""

    step: float = Field(
        default=1e-3,
        ge=1e-6,
        le=0.05,
        description="Step size [s]; the output interval is a multiple of it.",
        json_schema_extra={"unit": "s"},
    )
    solver: Literal["generalized-alpha", "trapezoidal-index2"] = Field(
        default="generalized-alpha",
        description="Generalized alpha (Chung and Hulbert 1993; Arnold and Bruels 2007) with positions constrained, "
        "or the trapezoidal rule with velocities constrained (index 2), whose gaps and joints may drift.",
    )
    spectral_radius: float = Field(
        default=0.8,
        ge=0,
        lt=1,
        description="Generalized alpha's spectral radius at infinite frequency; it must be below 1, or errors of the "
        "contact forces do not decay. The trapezoidal rule does not have one.",
        json_schema_extra={"unit": "1"},
    )
    jacobian: Literal["iteration", "step", "reuse"] = Field(
        default="step",
        description="When Newton's method renews its Jacobian: at every iteration, once a step, or when it converges "
        "too slowly.",
    )
    newton_relative_tolerance: float = Field(
        default=1e-11,
        gt=0,
        le=1e-4,
        description="Newton's method stops when its residual has decreased by this factor. The residual is a norm of "
        "both the imbalance of forces [kN] and the violation of constraints [m; of slip, m in a step]. The library "
        "starts every step without constraint forces, so the residual decreases from the bodies' weights, 0.84 kN for "
        "the benchmark bicycle: 1e-11 leaves 8e-12 m, and a slip of about 2e-8 m/s at a step of 1 ms.",
        json_schema_extra={"unit": "1"},
    )
    newton_absolute_tolerance: float = Field(
        default=1e-12,
        gt=0,
        le=1e-4,
        description="Newton's method stops below this residual [kN and m, one norm].",
        json_schema_extra={"unit": "kN, m"},
    )


class ExudynSettings(SolverSettings):
    """Settings of the engine with true constraints."""

    start: Literal["second-order", "engine"] = Field(
        default="second-order",
        description="How generalized alpha starts: corrected, so that contact forces are of second order from the "
        "first step (Arnold, Bruels and Cardona 2015), or as in the engine, of first order until that decays.",
    )
