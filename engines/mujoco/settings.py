"""Settings of the MuJoCo models: MuJoCo's own choices, with defaults of increasing care."""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ..engine import Settings

Impedance = Annotated[float, Field(gt=0, lt=1)]
Impedances = tuple[
    Impedance,
    Impedance,
    Annotated[float, Field(gt=0)],
    Annotated[float, Field(ge=0, le=1)],
    Annotated[float, Field(ge=1)],
]
# MuJoCo's default: least and largest impedance, and width, midpoint and power of the transition between them.
IMPEDANCES = (0.9, 0.95, 0.001, 0.5, 2.0)
# MuJoCo reduces larger impedances to this value without a message.
LARGEST_IMPEDANCE = 0.9999
SOLVER_ROUND_OFF = 2.0**-52
FORCE_NOISE = 0.01  # largest share of a contact force that round-off may make up
# Contact forces with a larger relative error than this are unusable.
WRONG = 0.01
# Slope at which a line search stops, relative to the mean inertia and to forces of about that size: a few roundings.
SLOPE = 1e-14


# "discrete" solves for the contact forces in the effective inertia of the whole step; MuJoCo 3.13 is the first with it.
Integrator = Literal["Euler", "implicit", "implicitfast", "RK4", "discrete"]
# Exact contacts are corrected for the inertia of the tree itself; without contacts "discrete" is "implicitfast".
TreeIntegrator = Literal["Euler", "implicit", "implicitfast", "RK4"]
_OF_ORDER = "MuJoCo's integrator; RK4 is of order 4, the others are of order 1"


class StepSettings(Settings):
    """How MuJoCo steps through time."""

    step: float = Field(
        default=0.002,
        ge=1e-6,
        le=0.02,
        description="time step [s]; must divide the output interval",
        json_schema_extra={"unit": "s"},
    )
    integrator: Integrator = Field(default="RK4", description=_OF_ORDER)

    @property
    def round_off(self) -> float:
        """Relative round-off of the numbers that it computes with."""
        return SOLVER_ROUND_OFF

    @property
    def noise(self) -> float:
        """Relative error that a step may add beyond its method."""
        return self.round_off

    @property
    def least_friction(self) -> float | None:
        """Coefficient of friction that there is in every direction; None where wheels are bound to roll."""
        return None


class SoftContactSettings(StepSettings):
    """How MuJoCo softens its contacts and solves for their forces, in C and in its ports."""

    time_constant: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="time constant of the contacts (solref) [s], at least twice the step; twice the step if not given",
        json_schema_extra={"unit": "s"},
    )
    damping_ratio: float = Field(
        default=1.0, gt=0, le=100, description="damping ratio of the contacts (solref)", json_schema_extra={"unit": "1"}
    )
    impedance: Impedances = Field(
        default=IMPEDANCES,
        description="impedance of the contacts (solimp): least, largest, width of the way between [m], midpoint, power",
        json_schema_extra={"unit": "1, 1, m, 1, 1"},
    )
    impratio: float = Field(
        default=10.0,
        gt=0,
        le=1e6,
        description="how much harder friction is than the normal direction; from 10 on it hardly matters",
        json_schema_extra={"unit": "1"},
    )
    cone: Literal["elliptic", "pyramidal"] = Field(default="elliptic", description="friction cone")
    friction: float = Field(
        default=2.0,
        gt=0,
        le=100,
        description="coefficient of sliding friction, the same in all directions",
        json_schema_extra={"unit": "1"},
    )
    tolerance: float = Field(
        default=1e-8,
        gt=0,
        le=1e-2,
        description="relative tolerance at which MuJoCo's contact solver stops",
        json_schema_extra={"unit": "1"},
    )

    @property
    def noise(self) -> float:
        """Relative error that a step may add beyond its method: what the contact solver leaves unconverged."""
        return max(self.tolerance, self.round_off)

    @property
    def condition(self) -> float:
        """How much stiffer the contact rows are than the bicycle, the condition of the solver's matrix M + J^T D J."""
        largest = max(self.impedance[:2])
        return max(self.impratio, 1.0) * largest / (1 - largest)

    @property
    def converged_below(self) -> float:
        """Largest relative residual (`convergence`) that a solver may leave which has met its tolerance.

        MuJoCo's tolerance is one of its cost, a square of accelerations in which stiff rows count by their
        stiffness: a residual r of the forces costs r^2 / condition. Round-off leaves some of that of an
        acceleration, times the condition.
        """
        return min(sqrt(self.tolerance * self.condition) + 10 * self.round_off * self.condition, WRONG)

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
    def solver_options(self) -> dict[str, float | str]:
        """Options of MuJoCo's contact solver beside its tolerance; none: MuJoCo's own."""
        return {}

    @model_validator(mode="after")
    def _contacts_are_resolved(self) -> Self:
        # MuJoCo would raise a smaller one without a message.
        if self.contact_time < 2 * self.step:
            raise ValueError(
                f"time_constant is {self.time_constant!r}; it must be at least twice the step, {2 * self.step!r}"
            )
        if max(self.impedance[:2]) > LARGEST_IMPEDANCE:
            raise ValueError(f"impedance is {self.impedance!r}; no impedance may exceed {LARGEST_IMPEDANCE!r}")
        return self


class ContactSettings(SoftContactSettings):
    """Settings of MuJoCo's contacts in C, with a pass that its ports lack."""

    noslip_iterations: int = Field(
        default=0,
        ge=0,
        le=1000,
        description="iterations of the pass that makes friction hard after the solver",
        json_schema_extra={"unit": "1"},
    )

    @property
    def solver_options(self) -> dict[str, float | str]:
        """Options of MuJoCo's contact solver beside its tolerance."""
        return {"noslip_iterations": self.noslip_iterations}


_ON_PLANES = "MuJoCo's integrator; on a curved surface RK4's stages see the ground as at the start of the step"


class NativeSettings(ContactSettings):
    """Settings of a careful user: stiff contacts, hard friction, the elliptic cone."""

    integrator: Integrator = Field(default="implicitfast", description=_ON_PLANES)


class RoundedSettings(NativeSettings):
    """Settings of `rounding`: those of a careful user, with a state in float32."""

    rounded: Literal["state", "positions", "velocities"] = Field(
        default="state", description="what of the state is rounded to float32 after every step"
    )

    @property
    def noise(self) -> float:
        """Relative error that a step may add beyond its method: half of float32's last digit, or the solver's."""
        return max(super().noise, 2.0**-24)


class DefaultSettings(ContactSettings):
    """MuJoCo's own defaults."""

    integrator: Integrator = Field(default="Euler", description=_ON_PLANES)
    time_constant: float | None = Field(
        default=0.02,
        gt=0,
        le=1,
        description="time constant of the contacts (solref) [s], at least twice the step",
        json_schema_extra={"unit": "s"},
    )
    impratio: float = Field(
        default=1.0,
        gt=0,
        le=1e6,
        description="how much harder friction is than the normal direction",
        json_schema_extra={"unit": "1"},
    )
    cone: Literal["elliptic", "pyramidal"] = Field(default="pyramidal", description="friction cone")
    friction: float = Field(
        default=1.0,
        gt=0,
        le=100,
        description="coefficient of sliding friction, the same in all directions",
        json_schema_extra={"unit": "1"},
    )


class ExactContactSettings(ContactSettings):
    """Settings of MuJoCo's solver on exact contacts, whose rows keep MuJoCo's form and are nearly rigid."""

    integrator: TreeIntegrator = Field(  # pyright: ignore[reportIncompatibleVariableOverride]
        default="RK4", description=_OF_ORDER
    )

    # A row's error decays at 2 / time_constant, which the integrator must resolve; it adds no creep any more.
    time_constant: float | None = Field(
        default=0.05,
        gt=0,
        le=1,
        description="time constant of the contacts (solref) [s], at least twice the step",
        json_schema_extra={"unit": "s"},
    )
    impedance: Impedances = Field(
        default=(LARGEST_IMPEDANCE, LARGEST_IMPEDANCE, 0.001, 0.5, 2.0),
        description="impedance of the contacts (solimp): least, largest, width of the way between [m], midpoint, power",
        json_schema_extra={"unit": "1, 1, m, 1, 1"},
    )
    impratio: float = Field(
        default=1.0,
        gt=0,
        le=1e6,
        description="how much harder friction is than the normal direction; softness does as much for both",
        json_schema_extra={"unit": "1"},
    )
    softness: float = Field(
        default=1e-5,
        ge=1e-9,
        le=1,
        description="factor on the softness that MuJoCo gives a contact row; what is left of it makes wheels slip",
        json_schema_extra={"unit": "1"},
    )
    tolerance: float = Field(
        default=1e-22,
        gt=0,
        le=1e-2,
        description="relative tolerance at which MuJoCo's contact solver stops",
        json_schema_extra={"unit": "1"},
    )

    @property
    def condition(self) -> float:
        """How much stiffer the contact rows are than the bicycle, the condition of the solver's matrix M + J^T D J."""
        return super().condition / self.softness

    @property
    def solver_options(self) -> dict[str, float | str]:
        """Options of MuJoCo's contact solver beside its tolerance, for rows as stiff as these.

        Wheels that roll need one iteration from the start that `compiled.correct_reference` gives. The solution for a
        wheel that slides is found along the curved edge of the cone, on which steps become shorter the stiffer the
        rows are: this takes some hundred iterations, where MuJoCo's own limit is 100. Between sliding and sticking the
        cost bends within so short an interval that a line search must bisect down to the last digit, 52 times with up
        to three evaluations each, where MuJoCo's own limit is 50 evaluations. A line search that ends earlier makes no
        progress, and the solver stops at arbitrary forces. A line search stops at a slope of the order of the forces'
        round-off.
        """
        limits = {"iterations": 10_000, "ls_iterations": 200, "ls_tolerance": max(0.01, SLOPE / self.tolerance)}
        return super().solver_options | limits

    @model_validator(mode="after")
    def _forces_have_digits(self) -> Self:
        if SOLVER_ROUND_OFF * self.condition > FORCE_NOISE:
            least = self.softness * SOLVER_ROUND_OFF * self.condition / FORCE_NOISE
            raise ValueError(
                f"softness is {self.softness!r}; with impratio {self.impratio!r} it must be at least {least:.2g}, "
                "or contact forces drown in round-off"
            )
        return self


class MultiplierSettings(StepSettings):
    """MuJoCo's tree and integrator, without its contacts."""

    integrator: TreeIntegrator = Field(  # pyright: ignore[reportIncompatibleVariableOverride]
        default="RK4", description=_OF_ORDER
    )

    stabilisation: float = Field(
        default=20.0,
        ge=0,
        le=1000,
        description="rate at which gaps and slip are brought back to zero [1/s]",
        json_schema_extra={"unit": "1/s"},
    )
