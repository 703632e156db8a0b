"""The engine: Jiminy's integrator and its wheel constraints, on the level plane."""

from __future__ import annotations

from importlib.metadata import version

from velodrome.engines.coordinates import quaternions, start_on_turn
from velodrome.engines.engine import Problem, Progress, Trajectory, UnsuitableProblem
from velodrome.engines.problems import is_level, steps_per_output
from velodrome.engines.rolling import observe

from .settings import JiminySettings


class JiminyEngine:
    """Jiminy's wheel constraint, which rolls without slip."""

    name = "jiminy"
    gives = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")
    settings = JiminySettings
    takes_inputs = True
    settings_source = (
        "the package's own choice: Runge-Kutta's method in fixed steps, constraints that are rigid, and the "
        "stabilisation of Jiminy's own contacts"
    )

    @property
    def version(self) -> str:
        """Version of Jiminy, whose package is named jiminy-py."""
        return version("jiminy-py")

    def check(self, problem: Problem, settings: JiminySettings) -> None:
        """Refuse any ground but the level plane, output times between steps, and a stabilisation that diverges."""
        if not is_level(problem.surface):
            raise UnsuitableProblem(
                "Jiminy's wheels roll on a plane; a scenario with [surface] kind = 'plane' would do"
            )
        steps_per_output(problem.times, settings.step)
        unstable = settings.find_unstable()
        if unstable is not None:
            raise ValueError(unstable)

    def step_noise(self, settings: JiminySettings) -> float:
        """Return the error of a step by which Jiminy softens the constraints."""
        return settings.noise

    def simulate(self, problem: Problem, settings: JiminySettings, progress: Progress) -> Trajectory:
        """Run a problem; see `velodrome.engines.engine.Engine.simulate`."""
        from .ride import ride_bicycle
        from .tree import from_jiminy

        seen = ride_bicycle(problem, settings, progress)
        motion = from_jiminy(problem.bicycle, seen.time, seen.configuration, seen.velocity)
        q = start_on_turn(motion.q, problem.q)
        wheels = observe(problem.bicycle, problem.surface, q, motion.qd)
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(mode="json"),
            time=seen.time,
            q=q,
            qd=motion.qd,
            body_position=motion.position,
            body_quaternion=quaternions(motion.rotation),
            contact_point=wheels.point if wheels.found else None,
            contact_force=seen.force,
            gap=wheels.gap if wheels.found else None,
            slip=wheels.slip if wheels.found else None,
            kinetic_energy=motion.energy[:, 0],
            potential_energy=motion.energy[:, 1],
            steps=seen.steps,
            cpu_time=seen.cpu_time,
            ended=seen.ended,
            unconverged_steps=0,  # without bounds on the forces nothing iterates
        )


ENGINE = JiminyEngine()
