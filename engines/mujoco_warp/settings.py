"""Settings of the model in MuJoCo Warp."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ..mujoco.ports import LEAST_SINGLE_STEP, BatchSettings, PortSolverSettings
from ..mujoco.settings import ContactSettings

SINGLE = 2.0**-23  # distance of 1 from the next larger number in single precision
# MuJoCo Warp raises smaller tolerances to this value without a message.
LEAST_TOLERANCE = 1e-6


class WarpSettings(BatchSettings, PortSolverSettings, ContactSettings):
    """The choices of `mujoco-native` in single precision, with MuJoCo's default limits of the solver's iterations."""

    integrator: Literal["Euler", "implicit", "implicitfast", "RK4"] = Field(  # pyright: ignore[reportIncompatibleVariableOverride]
        default="implicitfast",
        description="MuJoCo Warp's integrator; all are of order 1 with contacts, and on a curved surface RK4's "
        "stages see the ground as at the start of the step",
    )
    step: float = Field(
        default=0.002,
        ge=LEAST_SINGLE_STEP,
        le=0.02,
        description="time step [s]; must divide the output interval; of shorter ones single precision leaves nothing",
        json_schema_extra={"unit": "s"},
    )
    tolerance: float = Field(
        default=LEAST_TOLERANCE,
        ge=LEAST_TOLERANCE,
        le=1e-2,
        description="relative tolerance at which the contact solver stops; MuJoCo Warp knows none below 1e-6",
        json_schema_extra={"unit": "1"},
    )
    device: str = Field(
        default="cpu",
        pattern=r"^(cpu|cuda(:[0-9]{1,3})?)$",
        description="Warp's name of the processor that computes: cpu, cuda, or cuda:0 and so on",
    )

    @property
    def round_off(self) -> float:
        """Relative round-off of the numbers that it computes with: MuJoCo Warp knows single precision alone."""
        return SINGLE
