"""The engine in Pinocchio: its tree of bodies and its constraint solver, with contacts that roll on any ground."""

from __future__ import annotations

from ...reference.contact import observe
from ...reference.kinematics import quaternions
from ...reference.simulate import steps_per_output
from ..coordinates import start_on_turn
from ..engine import Problem, Progress, Trajectory, package_version
from .settings import ROUND_OFF, ConstraintSettings


class PinocchioEngine:
    """Pinocchio's own solver of constraints, given the acceleration of a rolling wheel's contact.

    The library is imported when a problem is run.
    """

    name = "pinocchio-constraint"
    description = "Pinocchio's tree and constraint solver, with the acceleration of the rolling contacts given to it"
    gives = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")
    settings = ConstraintSettings
    takes_inputs = True

    @property
    def version(self) -> str:
        """Version of Pinocchio, whose package is named pin."""
        return package_version("pin")

    def check(self, problem: Problem, settings: ConstraintSettings) -> None:
        """Refuse output times that are not multiples of the step; see `velodrome.engines.engine.Engine`."""
        steps_per_output(problem.times, settings.step)

    def step_noise(self, settings: ConstraintSettings) -> float:
        """Return the larger of round-off and what the solver may leave in a step; see `Engine`.

        The solver stops at a change of the contact forces, which are those of a bicycle's weight: more than 100 N.
        """
        return max(settings.accuracy / 100, ROUND_OFF)

    def simulate(self, problem: Problem, settings: ConstraintSettings, progress: Progress) -> Trajectory:
        """Run a problem; see `velodrome.engines.engine.Engine.simulate`.

        Raises
        ------
        ValueError
            If the output times are not a uniform grid from 0, or the step does not divide its interval.
        EngineError
            If a wheel has no contact at the start, or the solver fails there.
        """
        from .ride import ride_bicycle
        from .tree import from_pinocchio

        result = ride_bicycle(problem, settings, progress)
        seen = result.recording
        q, qd = from_pinocchio(
            problem.bicycle,
            seen.time,
            seen.configuration,
            seen.velocity,
            seen.position[:, 0],
            seen.rotation,
            seen.spin,
        )
        q = start_on_turn(q, problem.q)
        observed = observe(problem.bicycle, problem.surface, q, qd)
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(mode="json"),
            time=seen.time,
            q=q,
            qd=qd,
            body_position=seen.position,
            body_quaternion=quaternions(seen.rotation),
            contact_point=observed.point if observed.found else None,
            contact_force=seen.force,
            gap=observed.gap if observed.found else None,
            slip=observed.slip if observed.found else None,
            kinetic_energy=seen.energy[:, 0],
            potential_energy=seen.energy[:, 1],
            steps=result.steps,
            cpu_time=result.cpu_time,
            ended=result.ended,
            unconverged_steps=result.unconverged_steps,
            largest_residual=result.largest_residual,
        )


CONSTRAINT = PinocchioEngine()
