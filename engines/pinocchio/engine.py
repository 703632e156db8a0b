"""The engine in Pinocchio: its tree of bodies and its constraint solver, with contacts that roll on any ground."""

from __future__ import annotations

import numpy as np

from ...reference.dae import mass_matrix
from ...reference.kinematics import quaternions
from ...reference.simulate import steps_per_output
from ..contact_fields import observe_contact_fields
from ..engine import Problem, Progress, Trajectory, UnsuitableProblem
from ..releases import refuse_releases
from .releases import PINOCCHIO
from .settings import ROUND_OFF, ConstraintSettings

# Least eigenvalue of a mass matrix with a unit diagonal. The benchmark's is 1e-2, that of a bicycle with wheels of 1 mg
# is 1e-7, and round-off leaves 1e-16 of a singular one.
LEAST_EIGENVALUE = 1e-10


def require_mass_matrix(problem: Problem) -> None:
    """Refuse a bicycle with a singular mass matrix, which Pinocchio factorises before it adds the contacts.

    Raises
    ------
    UnsuitableProblem
        If the tree of bodies without contacts can move without inertia.
    """
    mass = mass_matrix(problem.bicycle, problem.q)
    size = np.sqrt(np.diag(mass).clip(0))
    if np.any(size == 0) or np.linalg.eigvalsh(mass / np.outer(size, size))[0] < LEAST_EIGENVALUE:
        raise UnsuitableProblem(
            "Pinocchio factorises the mass matrix, and this bicycle's is singular; wheels and frames need masses and "
            "moments of inertia that are not zero"
        )


class PinocchioEngine:
    """Pinocchio's own solver of constraints, given the acceleration of a rolling wheel's contact.

    The library is imported when a problem is run.
    """

    name = "pinocchio-constraint"
    description = "Pinocchio's tree and constraint solver, with the acceleration of the rolling contacts given to it"
    settings_source = (
        "those of Pinocchio's example simulation-contact-dynamics.py, but for Runge-Kutta's method instead of one of "
        "order 1, and an accuracy of 1e-9 N, above the round-off of the forces"
    )
    gives = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")
    settings = ConstraintSettings
    reach = PINOCCHIO
    takes_inputs = True

    @property
    def version(self) -> str:
        """Version of Pinocchio, whose package is named pin."""
        return self.reach.version

    def check(self, problem: Problem, settings: ConstraintSettings) -> None:
        """Refuse untried releases, bicycles without inertia, and output times between two steps; see `Engine.check`."""
        refuse_releases(self.name, settings, PINOCCHIO)
        require_mass_matrix(problem)
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
        refuse_releases(self.name, settings, PINOCCHIO)
        from .ride import convert_recording, ride_bicycle

        result = ride_bicycle(problem, settings, progress)
        seen = result.recording
        q, qd = convert_recording(problem, seen, seen.time)
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(mode="json"),
            time=seen.time,
            q=q,
            qd=qd,
            body_position=seen.position,
            body_quaternion=quaternions(seen.rotation),
            contact_force=seen.force,
            **observe_contact_fields(problem, q, qd),
            kinetic_energy=seen.energy[:, 0],
            potential_energy=seen.energy[:, 1],
            steps=result.steps,
            cpu_time=result.cpu_time,
            ended=result.ended,
            fall=result.fall,
            unconverged_steps=result.unconverged_steps,
            largest_residual=result.largest_residual,
        )


CONSTRAINT = PinocchioEngine()
