"""Settings of the MJX models."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from ..mujoco.settings import MultiplierSettings, SoftContactSettings, StepSettings

Precision = Literal["float64", "float32"]
# Distance of 1 from the next larger number.
_ROUND_OFF = {"float64": 2.0**-52, "float32": 2.0**-23}


class ArraySettings(StepSettings):
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
    batch_place: int = Field(
        default=0,
        ge=0,
        description="place of the ride in the batch whose results are given, from 0",
        json_schema_extra={"unit": "1"},
    )

    @property
    def round_off(self) -> float:
        """Relative round-off of the numbers that it computes with."""
        return _ROUND_OFF[self.precision]

    @property
    def noise(self) -> float:
        """Relative error that a step may add beyond its method: a pose is the result of some eight roundings."""
        return max(super().noise, 4 * self.round_off)

    @model_validator(mode="after")
    def _place_is_in_batch(self) -> Self:
        if self.batch_place >= self.batch_size:
            raise ValueError(
                f"batch_place is {self.batch_place!r}; in a batch of {self.batch_size!r} it must be at most "
                f"{self.batch_size - 1!r}"
            )
        return self


class MjxSettings(ArraySettings, SoftContactSettings):
    """The choices of `mujoco-native`, with MuJoCo's default limits of the solver's iterations."""

    integrator: Literal["Euler", "implicitfast", "RK4"] = Field(  # pyright: ignore[reportIncompatibleVariableOverride]
        default="implicitfast",
        description="MJX's integrator; all are of order 1 with contacts, and on a curved surface RK4's stages see the "
        "ground as at the start of the step",
    )
    solver: Literal["Newton", "CG"] = Field(default="Newton", description="MJX's contact solver; MuJoCo's default")
    iterations: int = Field(
        default=100,
        ge=1,
        le=10_000,
        description="largest number of iterations of the contact solver; default of MuJoCo",
        json_schema_extra={"unit": "1"},
    )
    line_search_iterations: int = Field(
        default=50,
        ge=1,
        le=10_000,
        description="largest number of iterations of its line search (ls_iterations); default of MuJoCo",
        json_schema_extra={"unit": "1"},
    )

    @property
    def solver_options(self) -> dict[str, float | str]:
        """Options of MJX's contact solver beside its tolerance."""
        return {
            "solver": self.solver,
            "iterations": self.iterations,
            "ls_iterations": self.line_search_iterations,
        }


class MjxMultiplierSettings(ArraySettings, MultiplierSettings):
    """MJX's tree under the exact forces of rolling, with an integrator of the suite's."""

    integrator: Literal["RK4"] = Field(  # pyright: ignore[reportIncompatibleVariableOverride]
        default="RK4", description="the suite's own, of order 4; MJX's RK4 is of order 2 with a free joint"
    )
