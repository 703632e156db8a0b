"""The reference as an engine: the paper's equations, integrated to round-off or with the paper's own method."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Literal, Self

import numpy as np
from pydantic import Field

from ..reference.contact import observe
from ..reference.kinematics import body_positions, body_quaternions
from ..reference.simulate import (
    PreciseMotion,
    RideStart,
    kernels_are_loaded,
    simulate,
    simulate_many,
    simulate_modified_euler,
    steps_per_output,
)
from .engine import REFERENCE, EngineError, Problem, Progress, Settings, Trajectory, package_version

ORDER = 8  # order of dop853: the tolerance is scaled by this power of the factor on the step


class LagrangeSettings(Settings):
    """Settings of the reference."""

    integrator: Literal["dop853", "modified-euler"] = Field(
        default="dop853", description="adaptive order 8 with projection, or the paper's own method"
    )
    tolerance: float = Field(
        default=1e-13,
        ge=1e-15,
        le=1e-3,
        description="error of a step of dop853, relative to 1 + |state|",
        json_schema_extra={"unit": "1"},
    )
    step: float = Field(
        default=1e-3, ge=1e-6, le=0.1, description="step of modified-euler [s]", json_schema_extra={"unit": "s"}
    )

    def refined(self, factor: float) -> Self:
        """Return these settings with another step; for dop853 with the tolerance that corresponds to it."""
        if self.integrator == "modified-euler":
            return super().refined(factor)
        return self.model_validate(self.model_dump() | {"tolerance": self.tolerance * factor**ORDER})


class LagrangeEngine:
    """Lagrange's equations of the first kind with six multipliers."""

    name = REFERENCE
    description = "Lagrange's equations of the first kind with exact rolling, integrated to round-off: the reference"
    gives = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")
    settings = LagrangeSettings
    takes_inputs = True
    settings_source = "the suite's own choice: a tolerance near round-off, since the others are measured by this engine"

    @property
    def version(self) -> str:
        """Version of this suite."""
        return package_version("velodrome")

    def check(self, problem: Problem, settings: LagrangeSettings) -> None:
        """Refuse output times that are not multiples of the fixed step; see `velodrome.engines.engine.Engine`."""
        if settings.integrator == "modified-euler":
            steps_per_output(problem.times, settings.step)

    def step_noise(self, settings: LagrangeSettings) -> float:
        """Return the relative error that a step may add beyond its method: the tolerance, or round-off."""
        return settings.tolerance if settings.integrator == "dop853" else 2.0**-52

    def simulate(self, problem: Problem, settings: LagrangeSettings, progress: Progress) -> Trajectory:
        """Run a problem; see `velodrome.engines.engine.Engine`."""
        where = (problem.bicycle, problem.surface)
        state = (problem.q, problem.qd, problem.times)
        _load_kernels(problem)
        begin = time.process_time()
        if settings.integrator == "dop853":
            motion = simulate(*where, *state, settings.tolerance, progress, problem.inputs, not problem.beyond_fall)
            clock = motion.time
        else:
            motion = simulate_modified_euler(*where, *state, settings.step, problem.inputs, not problem.beyond_fall)
            stride = steps_per_output(problem.times, settings.step)
            clock = settings.step * (stride * np.arange(len(motion.time)))
        return self._make_trajectory(problem, settings, motion, clock, time.process_time() - begin)

    def simulate_many(
        self, problems: Sequence[Problem], settings: LagrangeSettings, threads: int = 1
    ) -> list[Trajectory | Exception]:
        """Run problems with the same output times; see `velodrome.reference.simulate.simulate_many`.

        Parameters
        ----------
        problems : sequence of Problem
        settings : LagrangeSettings
            With the integrator dop853.
        threads : int
            Number of threads that share the problems.

        Returns
        -------
        list of Trajectory or Exception
            What `simulate` returns or raises for each problem, to the bit, except for the CPU time: that of all
            problems is divided in proportion to their steps.
        """
        starts = [
            RideStart(each.bicycle, each.surface, each.q, each.qd, each.inputs, not each.beyond_fall)
            for each in problems
        ]
        _load_kernels(problems[0])
        begin = time.process_time()
        motions = simulate_many(starts, problems[0].times, settings.tolerance, threads)
        elapsed = time.process_time() - begin
        steps = sum(motion.steps for motion in motions if isinstance(motion, PreciseMotion))
        found: list[Trajectory | Exception] = []
        for problem, motion in zip(problems, motions, strict=True):
            if isinstance(motion, Exception):
                found.append(motion)
                continue
            cpu_time = elapsed * motion.steps / max(steps, 1)
            try:
                found.append(self._make_trajectory(problem, settings, motion, motion.time, cpu_time))
            except EngineError as error:
                found.append(error)
        return found

    def _make_trajectory(
        self,
        problem: Problem,
        settings: LagrangeSettings,
        motion: PreciseMotion,
        clock: np.ndarray,
        cpu_time: float,
    ) -> Trajectory:
        if len(motion.time) == 0:
            raise EngineError(motion.ended)
        contact = observe(problem.bicycle, problem.surface, motion.q, motion.qd, motion.contact)
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(),
            time=clock,
            q=motion.q,
            qd=motion.qd,
            body_position=body_positions(problem.bicycle, motion.q),
            body_quaternion=body_quaternions(problem.bicycle, motion.q),
            contact_point=contact.point,
            contact_force=motion.force,
            gap=contact.gap,
            slip=contact.slip,
            kinetic_energy=contact.kinetic_energy,
            potential_energy=contact.potential_energy,
            steps=motion.steps,
            cpu_time=cpu_time,
            ended=motion.ended,
            fall=motion.fall,
            # A step that cannot be projected back onto the contact constraints ends the ride.
            unconverged_steps=0,
        )


def _load_kernels(problem: Problem) -> None:
    """Compile the kernels of a ride, or load them from the cache, before the clock starts."""
    if not kernels_are_loaded():
        simulate(problem.bicycle, problem.surface, problem.q, problem.qd, problem.times[:1])
    _ = problem.surface.function.real  # compiled when first used


ENGINE = LagrangeEngine()
