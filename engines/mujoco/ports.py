"""Settings that MuJoCo's ports to other hardware share: rides in batches, and limits of the contact solver."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from .settings import SoftContactSettings, StepSettings

# Shortest step in single precision [s]. At 5 m/s and some 10 m from the origin a bicycle moves by 5e-4 m, of which the
# rounding of its position, 5e-7 m, is a thousandth; a straight ride repeats it in every step.
LEAST_SINGLE_STEP = 1e-4


class BatchSettings(StepSettings):
    """How many rides a port computes at once."""

    batch_size: int = Field(
        default=1,
        ge=1,
        le=65536,
        description="number of equal rides that are computed at once",
        json_schema_extra={"unit": "1"},
    )
    batch_place: int = Field(
        default=0,
        ge=0,
        description="place of the ride in the batch whose results are given, from 0",
        json_schema_extra={"unit": "1"},
    )

    @model_validator(mode="after")
    def _place_is_in_batch(self) -> Self:
        if self.batch_place >= self.batch_size:
            raise ValueError(
                f"batch_place is {self.batch_place!r}; in a batch of {self.batch_size!r} it must be at most "
                f"{self.batch_size - 1!r}"
            )
        return self

    @property
    def noise(self) -> float:
        """Relative error that a step may add beyond its method: a pose is the result of some eight roundings."""
        return max(super().noise, 4 * self.round_off)


class PortSolverSettings(SoftContactSettings):
    """The contact solver of a port, with MuJoCo's default limits of its iterations."""

    solver: Literal["Newton", "CG"] = Field(default="Newton", description="contact solver; MuJoCo's default")
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
        """Options of the contact solver beside its tolerance."""
        return super().solver_options | {
            "solver": self.solver,
            "iterations": self.iterations,
            "ls_iterations": self.line_search_iterations,
        }
