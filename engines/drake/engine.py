"""The engines that use Drake's multibody plant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ...reference.kinematics import WHEELS
from ...reference.simulate import steps_per_output
from ..contact_fields import observe_contact_fields
from ..coordinates import quaternions
from ..engine import Problem, Progress, Settings, Trajectory, UnsuitableProblem
from ..releases import LibraryReach, refuse_releases
from .releases import DRAKE
from .settings import DrakeContactSettings, DrakeMultiplierSettings

if TYPE_CHECKING:
    from .ride import DrakeRig

S = TypeVar("S", bound=Settings)


@dataclass(frozen=True)
class DrakeEngine(Generic[S]):
    """A model of Drake as an engine.

    Attributes
    ----------
    name : str
    settings : type
    builder : str
        Module and name of the function that makes a `DrakeRig` of a problem and settings. It is imported when something
        runs, so that listing the engines does not load the library.
    description : str
        The engine in one line.
    settings_source : str
        Whose choice its default settings are.
    gives : tuple of str
    reach : LibraryReach
        The releases of Drake with which it rides.
    """

    name: str
    settings: type[S]
    builder: str
    description: str
    settings_source: str
    gives: tuple[str, ...] = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")
    reach: LibraryReach = DRAKE
    takes_inputs = True

    @property
    def version(self) -> str:
        """Version of Drake."""
        return self.reach.version

    def check(self, problem: Problem, settings: Any) -> None:
        """Refuse untried releases, output times between two steps, and wheels without inertia about their axles.

        See `velodrome.engines.engine.Engine`.
        """
        refuse_releases(self.name, settings, self.reach)
        steps_per_output(problem.times, settings.step)
        for wheel in WHEELS:
            if not getattr(problem.bicycle, f"{wheel}_wheel_Iyy") > 0:
                raise UnsuitableProblem(
                    f"Drake needs the inverse of the mass matrix, which is singular where {wheel}_wheel_Iyy is 0; any "
                    "positive moment of inertia would do"
                )

    def step_noise(self, settings: Any) -> float:
        """Return round-off, or what the contact solver may leave unconverged in a step; see `Engine`."""
        return settings.noise

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        """Run a problem.

        Parameters
        ----------
        problem : Problem
            Its output times must be multiples of the step.
        settings : DrakeMultiplierSettings or DrakeContactSettings
        progress : callable
            Called with the simulated time [s] at most every 50 ms of it.

        Returns
        -------
        Trajectory
            Gap and slip are those of the wheels' knife edges on the true surface.

        Raises
        ------
        ValueError
            If this release of Drake is too old, an output time lies between two steps, or a wheel has no inertia about
            its axle.
        EngineError
            If Drake refuses the bicycle, or a wheel has no contact point at the start.
        """
        self.check(problem, settings)
        from .ride import convert_motions, ride_simulation

        module, name = self.builder.split(":")
        build: Callable[[Problem, Any], DrakeRig] = getattr(import_module(module), name)
        stride = steps_per_output(problem.times, settings.step)
        counts = [stride * k for k in range(len(problem.times))]
        ride = ride_simulation(build(problem, settings), problem, settings.step, counts, progress)
        recording = ride.recording
        motion = recording.motion
        q, qd = convert_motions(problem, recording.time, motion)
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(mode="json"),
            time=recording.time,
            q=q,
            qd=qd,
            body_position=motion.position,
            body_quaternion=quaternions(motion.rotation),
            contact_force=recording.force,
            **observe_contact_fields(problem, q, qd),
            kinetic_energy=recording.kinetic_energy,
            potential_energy=recording.potential_energy,
            steps=ride.steps,
            cpu_time=ride.cpu_time,
            ended=ride.ended,
            fall=ride.fall,
            friction=settings.least_friction,
            # Drake ends a ride with an error where its contact solver does not converge.
            unconverged_steps=0,
        )


MULTIPLIERS = DrakeEngine(
    "drake-multipliers",
    DrakeMultiplierSettings,
    "velodrome.engines.drake.multipliers:build_rolling_plant",
    description="Drake's tree and integrators under the exact forces of rolling, without its contacts",
    settings_source="the suite's own choice: Drake's default integrator at a fixed step, gaps and slip brought back to "
    "zero at 1 /s",
)
NATIVE = DrakeEngine(
    "drake-native",
    DrakeContactSettings,
    "velodrome.engines.drake.planes:build_contact_plant",
    description="Drake's tree and discrete contact solvers, thin wheels on tangent planes",
    settings_source="Drake's defaults of MultibodyPlantConfig, but for the suite's own choice of friction 2, which the "
    "rides need, and of a stiffness of 1e8 N/m, at which wheels hardly sink",
)
