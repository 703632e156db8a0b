"""The engine: Bullet's multibodies with thin wheels on the level plane."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np

from velodrome.engines.coordinates import BODIES, quaternions, start_on_turn
from velodrome.engines.engine import Problem, Progress, Trajectory, UnsuitableProblem
from velodrome.engines.problems import is_level, steps_per_output
from velodrome.engines.rolling import observe

from .settings import BulletSettings


class BulletEngine:
    """Bullet's tree of bodies and its velocity-level contacts."""

    name = "bullet"
    gives = ("contact_point", "contact_force", "gap", "slip")
    settings = BulletSettings
    takes_inputs = True
    settings_source = (
        "the package's own choice: without correction of depths (contactERP), with a friction of 2 and with wheels as "
        "thin as Bullet's margin, without which the rides fail"
    )

    @property
    def version(self) -> str:
        """Version of PyBullet."""
        return version("pybullet")

    def check(self, problem: Problem, settings: BulletSettings) -> None:
        """Refuse any ground but the level plane, output times between steps, and bodies without inertia."""
        if not is_level(problem.surface):
            raise UnsuitableProblem("Bullet's plane is flat; a scenario with [surface] kind = 'plane' would do")
        steps_per_output(problem.times, settings.step)
        bicycle = problem.bicycle
        for body in BODIES:
            # Bullet takes a mass of zero for a body that cannot move.
            if not (bicycle.body_mass(body) > 0 and np.linalg.eigvalsh(bicycle.inertia(body))[0] > 0):
                name = body.replace("_", " ")
                raise UnsuitableProblem(
                    f"Bullet needs masses and moments of inertia that are positive; the {name}'s are not"
                )

    def step_noise(self, settings: BulletSettings) -> float:
        """Return what the contact solver may leave in a step."""
        return settings.noise

    def simulate(self, problem: Problem, settings: BulletSettings, progress: Progress) -> Trajectory:
        """Run a problem; see `velodrome.engines.engine.Engine.simulate`."""
        from .ride import ride_bicycle

        seen = ride_bicycle(problem, settings, progress)
        q = start_on_turn(seen.q, problem.q)
        wheels = observe(problem.bicycle, problem.surface, q, seen.qd)
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(mode="json"),
            time=seen.time,
            q=q,
            qd=seen.qd,
            body_position=seen.position,
            body_quaternion=quaternions(seen.rotation),
            contact_point=wheels.point if wheels.found else None,
            contact_force=seen.force,
            gap=wheels.gap if wheels.found else None,
            slip=wheels.slip if wheels.found else None,
            steps=seen.steps,
            cpu_time=seen.cpu_time,
            ended=seen.ended,
            friction=settings.friction,
        )


ENGINE = BulletEngine()
