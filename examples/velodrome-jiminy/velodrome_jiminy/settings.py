"""Settings of the engine in Jiminy."""

from __future__ import annotations

from math import tau
from typing import Literal

from pydantic import Field

from velodrome.engines.engine import Settings

# Largest h k for which the method is stable on x' = -k x.
STABLE = {"runge_kutta_4": 2.785, "euler_explicit": 2.0}
# Jiminy adds at least 1e-11 1/kg to the diagonal of J M^-1 J'. Its entries are the inverse masses that the contacts
# move, which are larger than the inverse of the bicycle's mass: relative to them it is 1e-9 for bicycles of 100 kg.
LEAST_REGULARISATION = 1e-9
FASTEST = 100.0  # rate of the motions for which `JiminySettings.noise` is meant [1/s]; wheels turn by some 20


class JiminySettings(Settings):
    """How Jiminy integrates, and how it keeps the wheels on the ground."""

    step: float = Field(
        default=1e-3,
        ge=1e-5,
        le=0.02,
        description="time step [s], dtMax of Jiminy's stepper, whose default and upper bound is 0.02; it must divide "
        "the output interval",
        json_schema_extra={"unit": "s"},
    )
    integrator: Literal["runge_kutta_4", "euler_explicit"] = Field(
        default="runge_kutta_4",
        description="odeSolver of Jiminy's stepper, of those with fixed steps; the order of its Runge-Kutta method is "
        "2, not 4, for a body that turns freely",
    )
    stabilisation: float = Field(
        default=20.0,
        ge=0,
        le=1000,
        description="frequency with which gaps and slip are brought back to zero (baumgarte_freq of the wheel "
        "constraints), by default that of Jiminy's own contacts; 0 is without",
        json_schema_extra={"unit": "Hz"},
    )
    regularisation: float = Field(
        default=0.0,
        ge=0,
        le=0.1,
        description="part of the diagonal of the contacts' inverse mass matrix that is added to it; Jiminy's default "
        "is 1e-3, with which wheels sink",
        json_schema_extra={"unit": "1"},
    )

    @property
    def noise(self) -> float:
        """Relative change of the velocities in a step by which the constraints' softness makes it wrong.

        Accelerations are wrong by the regularisation, and change the velocities in a step by the step times the
        motion's rate.
        """
        return max(self.regularisation, LEAST_REGULARISATION) * min(1.0, FASTEST * self.step)

    def find_unstable(self) -> str | None:
        """Return why the stabilisation diverges at this step; None if it does not."""
        # Gap and slip obey x'' + 2 k x' + k^2 x = 0 with k = 2 pi f.
        if tau * self.stabilisation * self.step <= STABLE[self.integrator]:
            return None
        largest = STABLE[self.integrator] / (tau * self.step)
        return (
            f"stabilisation {self.stabilisation:g} Hz diverges in steps of {self.step:g} s; at most {largest:.3g} Hz, "
            "or a smaller step, would do"
        )
