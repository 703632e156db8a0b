"""Settings of the native MuJoCo model."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from engines.engine import Settings


class NativeSettings(Settings):
    """How MuJoCo integrates the bicycle and softens its contacts."""

    step: float = Field(default=0.002, ge=1e-6, le=0.02, description="time step [s]; must divide the output interval")
    integrator: Literal["Euler", "implicit", "implicitfast", "RK4"] = Field(
        default="implicitfast",
        description="MuJoCo's integrator; on a curved surface RK4's stages see the ground as at the start of the step",
    )
    time_constant: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="time constant of the contacts (solref) [s], at least twice the step; twice the step if not given",
    )
    damping_ratio: float = Field(default=1.0, gt=0, le=100, description="damping ratio of the contacts (solref)")
    impratio: float = Field(
        default=10.0,
        gt=0,
        le=1e6,
        description="how much harder friction is than the normal direction; from 10 on it hardly matters",
    )
    cone: Literal["elliptic", "pyramidal"] = Field(default="elliptic", description="friction cone")
    friction: float = Field(
        default=2.0, gt=0, le=100, description="coefficient of sliding friction, the same in all directions"
    )

    tolerance: float = Field(
        default=1e-8, gt=0, le=1e-2, description="relative tolerance at which MuJoCo's contact solver stops"
    )

    @property
    def contact_time(self) -> float:
        """Time constant of the contacts [s], whether given or not."""
        return 2 * self.step if self.time_constant is None else self.time_constant

    @model_validator(mode="after")
    def _contacts_are_resolved(self) -> NativeSettings:
        # MuJoCo would raise a smaller one without a word.
        if self.contact_time < 2 * self.step:
            raise ValueError(
                f"time_constant is {self.time_constant!r}; it must be at least twice the step, {2 * self.step!r}"
            )
        return self
