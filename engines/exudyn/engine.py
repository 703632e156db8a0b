"""Exudyn: rigid bodies and revolute joints of the library, and a knife-edge rolling joint on the surface."""

from __future__ import annotations

from functools import partial
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from engines.engine import EngineError, Problem, Progress, Settings, Trajectory
from reference.kinematics import quaternions
from reference.simulate import steps_per_output

if TYPE_CHECKING:
    from .joint import RollingJoint
    from .model import Model
    from .solve import Outcome


class ExudynSettings(Settings):
    """Settings of the generalized-alpha solver (Chung and Hulbert 1993; Arnold and Bruels 2007)."""

    step: float = Field(
        default=1e-3, ge=1e-6, le=0.05, description="Step size [s]; the output interval is a multiple of it."
    )
    spectral_radius: float = Field(
        default=0.8,
        ge=0,
        lt=1,
        description="Spectral radius at infinite frequency: below 1, or errors of the contact forces never die out.",
    )
    newton_relative_tolerance: float = Field(
        default=1e-10, gt=0, le=1e-4, description="Newton's method stops when its residual has fallen by this factor."
    )
    newton_absolute_tolerance: float = Field(
        default=1e-12, gt=0, le=1e-4, description="Newton's method stops below this residual."
    )


class _Exudyn:
    """The engine `exudyn`; the library is imported when a problem is run."""

    name = "exudyn"
    settings = ExudynSettings
    gives = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")

    @property
    def version(self) -> str:
        """Version of the library."""
        return version("exudyn")

    def check(self, problem: Problem, settings: ExudynSettings) -> None:
        """Refuse output times that the step does not meet; see `engines.engine.Engine`."""
        steps_per_output(problem.times, settings.step)

    def step_noise(self, settings: ExudynSettings) -> float:
        """What Newton's method may leave unconverged in a step; see `engines.engine.Engine`."""
        return settings.newton_relative_tolerance

    def simulate(self, problem: Problem, settings: ExudynSettings, progress: Progress) -> Trajectory:
        """Run a problem; see `engines.engine.Engine.simulate`.

        Raises
        ------
        ValueError
            If the output times are no uniform grid from 0, or the step does not divide its interval.
        EngineError
            If the engine does not even accept the initial state.
        """
        from .joint import add_rolling_joint, release_slip
        from .model import build_model
        from .solve import Integration, integrate, silent

        per_interval = steps_per_output(problem.times, settings.step)
        intervals = len(problem.times) - 1
        integration = Integration(
            end=float(problem.times[-1]),
            steps=intervals * per_interval,
            samples=intervals,
            **settings.model_dump(exclude={"step"}),
        )

        with silent():
            model = build_model(problem, partial(add_rolling_joint, surface=problem.surface))

            def release() -> None:
                for joint in model.joints:
                    release_slip(model.system, joint)

            outcome = integrate(model.system, integration, release, progress)
        return self._trajectory(problem, settings, model, outcome)

    def _trajectory(
        self, problem: Problem, settings: ExudynSettings, model: Model[RollingJoint], outcome: Outcome
    ) -> Trajectory:
        from .model import read_motion
        from .results import coordinates, energies, measure_contacts

        motion = read_motion(model)
        contacts = measure_contacts(problem, model, motion)
        if not np.all(np.isfinite(contacts.gap[0])):
            raise EngineError("exudyn could not start: a wheel has no contact point")
        q, qd = coordinates(problem, motion)
        kinetic, potential = energies(problem.bicycle, motion)
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(mode="json"),
            time=problem.times[: len(motion.time)].copy(),
            q=q,
            qd=qd,
            body_position=motion.position,
            body_quaternion=quaternions(motion.rotation),
            contact_point=contacts.point,
            contact_force=contacts.force,
            gap=contacts.gap,
            slip=contacts.slip,
            kinetic_energy=kinetic,
            potential_energy=potential,
            steps=outcome.steps,
            cpu_time=outcome.cpu_time,
            ended=outcome.ended,
        )


ENGINE = _Exudyn()
