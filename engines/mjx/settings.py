"""Settings of the MJX models."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from ..mujoco.ports import LEAST_SINGLE_STEP, BatchSettings, PortSolverSettings
from ..mujoco.settings import MultiplierSettings

Precision = Literal["float64", "float32"]
# Distance of 1 from the next larger number.
_ROUND_OFF = {"float64": 2.0**-52, "float32": 2.0**-23}


class ArraySettings(BatchSettings):
    """How JAX computes: the type of its numbers, and how many rides it computes at once."""

    precision: Precision = Field(
        default="float64", description="type of all numbers; JAX's own default, and what is fast on GPUs, is float32"
    )
    batch_size: int = Field(
        default=1,
        ge=1,
        le=65536,
        description="number of equal rides that are computed at once; the last bits depend on it",
        json_schema_extra={"unit": "1"},
    )

    @model_validator(mode="after")
    def _step_suits_precision(self) -> Self:
        if self.precision == "float32" and self.step < LEAST_SINGLE_STEP:
            raise ValueError(
                f"step is {self.step!r}; with precision float32 it must be at least {LEAST_SINGLE_STEP!r} s, since "
                "rounded positions leave nothing of shorter ones"
            )
        return self

    @property
    def round_off(self) -> float:
        """Relative round-off of the numbers that it computes with."""
        return _ROUND_OFF[self.precision]


class MjxSettings(ArraySettings, PortSolverSettings):
    """The choices of `mujoco-native`, with MuJoCo's default limits of the solver's iterations."""

    integrator: Literal["Euler", "implicitfast", "RK4"] = Field(  # pyright: ignore[reportIncompatibleVariableOverride]
        default="implicitfast",
        description="MJX's integrator; all are of order 1 with contacts, and on a curved surface RK4's stages see the "
        "ground as at the start of the step",
    )


class MjxMultiplierSettings(ArraySettings, MultiplierSettings):
    """MJX's tree under the exact forces of rolling, with an integrator of the suite's."""

    integrator: Literal["RK4"] = Field(  # pyright: ignore[reportIncompatibleVariableOverride]
        default="RK4", description="the suite's own, of order 4; MJX's RK4 is of order 2 with a free joint"
    )
