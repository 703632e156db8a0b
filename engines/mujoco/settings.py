"""Settings of MuJoCo's models: the choices that a user of MuJoCo has, and their defaults as ladders of care."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from engines.engine import Settings

Impedance = Annotated[float, Field(gt=0, lt=1)]
Impedances = tuple[
    Impedance,
    Impedance,
    Annotated[float, Field(gt=0)],
    Annotated[float, Field(ge=0, le=1)],
    Annotated[float, Field(ge=1)],
]
# MuJoCo's own: least and largest impedance, width, midpoint and power of the way between them.
IMPEDANCES = (0.9, 0.95, 0.001, 0.5, 2.0)
# MuJoCo moves a larger impedance here without a word.
LARGEST_IMPEDANCE = 0.9999
ROUND_OFF = 2.0**-52
FORCE_NOISE = 0.01  # the largest share of round-off that a contact force may have


Integrator = Literal["Euler", "implicit", "implicitfast", "RK4"]


class StepSettings(Settings):
    """How MuJoCo steps through time."""

    step: float = Field(default=0.002, ge=1e-6, le=0.02, description="time step [s]; must divide the output interval")
    integrator: Integrator = Field(
        default="RK4", description="MuJoCo's integrator; RK4 is of order 4, the others are of order 1"
    )

    @property
    def noise(self) -> float:
        """Relative error that a step may add beyond its method."""
        return ROUND_OFF

    @property
    def least_friction(self) -> float | None:
        """Coefficient of friction that there is in every direction; None where wheels are bound to roll."""
        return None


class ContactSettings(StepSettings):
    """How MuJoCo softens its contacts and solves for their forces."""

    time_constant: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="time constant of the contacts (solref) [s], at least twice the step; twice the step if not given",
    )
    damping_ratio: float = Field(default=1.0, gt=0, le=100, description="damping ratio of the contacts (solref)")
    impedance: Impedances = Field(
        default=IMPEDANCES,
        description="impedance of the contacts (solimp): least, largest, width of the way between [m], midpoint, power",
    )
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
    noslip_iterations: int = Field(
        default=0, ge=0, le=1000, description="iterations of the pass that makes friction hard after the solver"
    )
    tolerance: float = Field(
        default=1e-8, gt=0, le=1e-2, description="relative tolerance at which MuJoCo's contact solver stops"
    )

    @property
    def noise(self) -> float:
        """Relative error that a step may add beyond its method: what the contact solver leaves unconverged."""
        return max(self.tolerance, ROUND_OFF)

    @property
    def least_friction(self) -> float:
        """Coefficient of friction that there is in every direction: half-way between a pyramid's edges it is less."""
        return self.friction / (2**0.5 if self.cone == "pyramidal" else 1)

    @property
    def contact_time(self) -> float:
        """Time constant of the contacts [s], whether given or not."""
        return 2 * self.step if self.time_constant is None else self.time_constant

    @property
    def damping(self) -> float:
        """Rate b at which a contact row brings its velocity to zero, 2 / (largest impedance * time constant) [1/s]."""
        return 2 / (self.impedance[1] * self.contact_time)

    @property
    def line_search(self) -> int:
        """Iterations that MuJoCo's contact solver may spend on one line search; 50 are its own default."""
        return 50

    @model_validator(mode="after")
    def _contacts_are_resolved(self) -> Self:
        # MuJoCo would raise a smaller one without a word.
        if self.contact_time < 2 * self.step:
            raise ValueError(
                f"time_constant is {self.time_constant!r}; it must be at least twice the step, {2 * self.step!r}"
            )
        if max(self.impedance[:2]) > LARGEST_IMPEDANCE:
            raise ValueError(f"impedance is {self.impedance!r}; no impedance may exceed {LARGEST_IMPEDANCE!r}")
        return self


_ON_PLANES = "MuJoCo's integrator; on a curved surface RK4's stages see the ground as at the start of the step"


class NativeSettings(ContactSettings):
    """A careful user's: stiff contacts, hard friction, the elliptic cone."""

    integrator: Integrator = Field(default="implicitfast", description=_ON_PLANES)


class DefaultSettings(ContactSettings):
    """MuJoCo's own defaults, all of them."""

    integrator: Integrator = Field(default="Euler", description=_ON_PLANES)
    time_constant: float | None = Field(
        default=0.02, gt=0, le=1, description="time constant of the contacts (solref) [s], at least twice the step"
    )
    impratio: float = Field(
        default=1.0, gt=0, le=1e6, description="how much harder friction is than the normal direction"
    )
    cone: Literal["elliptic", "pyramidal"] = Field(default="pyramidal", description="friction cone")
    friction: float = Field(
        default=1.0, gt=0, le=100, description="coefficient of sliding friction, the same in all directions"
    )


class ExactContactSettings(ContactSettings):
    """MuJoCo's solver on exact contacts: its rows keep their form, and are nearly rigid."""

    # A row's error decays at 2 / time_constant, which the integrator must resolve; it adds no creep any more.
    time_constant: float | None = Field(
        default=0.05, gt=0, le=1, description="time constant of the contacts (solref) [s], at least twice the step"
    )
    impedance: Impedances = Field(
        default=(LARGEST_IMPEDANCE, LARGEST_IMPEDANCE, 0.001, 0.5, 2.0),
        description="impedance of the contacts (solimp): least, largest, width of the way between [m], midpoint, power",
    )
    impratio: float = Field(
        default=1.0,
        gt=0,
        le=1e6,
        description="how much harder friction is than the normal direction; softness does as much for both",
    )
    softness: float = Field(
        default=1e-5,
        ge=1e-9,
        le=1,
        description="factor on the softness that MuJoCo gives a contact row; what is left of it makes wheels slip",
    )
    tolerance: float = Field(
        default=1e-14, gt=0, le=1e-2, description="relative tolerance at which MuJoCo's contact solver stops"
    )

    @property
    def condition(self) -> float:
        """Condition of the solver's matrix M + J^T D J, by which round-off grows in a contact force."""
        return max(self.impratio, 1.0) / ((1 - self.impedance[1]) * self.softness)

    @property
    def noise(self) -> float:
        """Relative error that a step may add beyond its method: round-off in an acceleration, times the step."""
        return max(self.tolerance, ROUND_OFF, ROUND_OFF * self.condition * self.step)

    @property
    def line_search(self) -> int:
        """Iterations of a line search, more where friction is much harder than the normal direction.

        Between sliding and sticking the cone's cost then bends within so short a stretch that 50 iterations can
        end before its bottom. What is missing there, divided by the softness, is a force up to thousands of times too
        large. 200 find what 500 find.
        """
        return 200 if self.cone == "elliptic" and self.impratio > 10 else super().line_search

    @model_validator(mode="after")
    def _forces_have_digits(self) -> Self:
        if ROUND_OFF * self.condition > FORCE_NOISE:
            least = self.softness * ROUND_OFF * self.condition / FORCE_NOISE
            raise ValueError(
                f"softness is {self.softness!r}; with impratio {self.impratio!r} it must be at least {least:.2g}, "
                "or contact forces drown in round-off"
            )
        return self


class MultiplierSettings(StepSettings):
    """MuJoCo's tree and integrator, without its contacts."""

    stabilisation: float = Field(
        default=20.0, ge=0, le=1000, description="rate at which gaps and slip are brought back to zero [1/s]"
    )
