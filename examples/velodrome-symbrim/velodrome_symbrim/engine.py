"""The engine: symbrim's equations of the bicycle on the level plane, integrated by scipy's DOP853."""

from __future__ import annotations

import time
from importlib.metadata import version
from typing import Self

import numpy as np
from pydantic import Field
from scipy.integrate import DOP853

from velodrome.engines.coordinates import body_positions, body_quaternions
from velodrome.engines.engine import EngineError, Problem, Progress, Settings, Trajectory, UnsuitableProblem
from velodrome.engines.problems import is_level
from velodrome.engines.rolling import observe

from .coordinates import AXES, from_symbrim, to_symbrim
from .equations import Equations

ORDER = 8  # of DOP853: a step's error goes with this power of it


class SymbrimSettings(Settings):
    """Settings of the engine."""

    tolerance: float = Field(
        default=1e-10,
        ge=2.5e-14,
        le=1e-3,
        description="error of a step of dop853, relative to 1 + |state|",
        json_schema_extra={"unit": "1"},
    )

    def refined(self, factor: float) -> Self:
        """These settings with the tolerance that steps scaled by a factor would leave."""
        return self.model_validate(self.model_dump() | {"tolerance": self.tolerance * factor**ORDER})


class SymbrimEngine:
    """Kane's equations as symbrim derives them."""

    name = "symbrim"
    gives = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")
    settings = SymbrimSettings

    @property
    def version(self) -> str:
        """Version of symbrim."""
        return version("symbrim")

    def check(self, problem: Problem, settings: SymbrimSettings) -> None:
        """Refuse any ground but the level plane, the only one that symbrim has."""
        if not is_level(problem.surface):
            raise UnsuitableProblem("symbrim's ground is flat; a scenario with [surface] kind = 'plane' would do")

    def step_noise(self, settings: SymbrimSettings) -> float:
        """Relative error that a step may add beyond its method: the tolerance itself."""
        return settings.tolerance

    def simulate(self, problem: Problem, settings: SymbrimSettings, progress: Progress) -> Trajectory:
        """Run a problem; see `velodrome.engines.engine.Engine`."""
        equations = Equations(problem.bicycle)  # derived before the clock starts
        begin = time.process_time()
        x, steps, ended = _integrate(equations, problem, settings.tolerance, progress)
        cpu_time = time.process_time() - begin
        q, qd = from_symbrim(equations, x)
        kinetic, potential = equations.energies(x)
        # The suite's: poses of the bodies and what is measured at the wheels, from the coordinates alone.
        seen = observe(problem.bicycle, problem.surface, q, qd)
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(),
            time=problem.times[: len(x)],
            q=q,
            qd=qd,
            body_position=body_positions(problem.bicycle, q),
            body_quaternion=body_quaternions(problem.bicycle, q),
            contact_point=seen.point if seen.found else None,
            contact_force=AXES * equations.contact_forces(x),
            gap=seen.gap if seen.found else None,
            slip=seen.slip if seen.found else None,
            kinetic_energy=kinetic,
            potential_energy=potential,
            steps=steps,
            cpu_time=cpu_time,
            ended=ended,
        )


def _integrate(
    equations: Equations, problem: Problem, tolerance: float, progress: Progress
) -> tuple[np.ndarray, int, str | None]:
    """States (n, 16) at the problem's times, the number of steps, and why they end early if they do."""
    times, end = problem.times, float(problem.times[-1])
    rows = [to_symbrim(equations, problem.q, problem.qd)]
    steps, ended = 0, None
    try:
        solver = DOP853(equations.derivative, 0.0, rows[0], end, rtol=tolerance, atol=tolerance)
    except np.linalg.LinAlgError as error:
        raise EngineError("the equations of motion are singular at the start") from error
    while len(rows) < len(times) and ended is None:
        try:
            ended = solver.step()  # None, or why it failed
        except np.linalg.LinAlgError:
            ended = "the equations of motion become singular"
        if ended is None:
            steps += 1
            state = solver.dense_output()
            rows += [state(t) for t in times[len(rows) : np.searchsorted(times, solver.t, side="right")]]
            progress(solver.t)
    return np.array(rows), steps, None if ended is None else f"no solution beyond t = {solver.t:.6g} s: {ended}"


ENGINE = SymbrimEngine()
