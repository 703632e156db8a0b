"""MuJoCo as its users build a bicycle: thin wheels on planes, MuJoCo's own soft contacts and solver.

MuJoCo's contact rows prescribe J q'' = -b J q' (- k times the depth, in the normal direction) and leave
out J' q', the acceleration of the contact at zero slip, so a wheel that rolls along a curve must creep
until b J q' balances it:

    slip = J' q' / b,    b = 2 / (d_max time_constant)

with d_max = 0.95 the largest impedance. With a time constant of two steps this is (v^2 / R) d_max step:
first order in the step, as is the energy error of the one-step integrators. Both are MuJoCo's own; the
engine shows them and corrects nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from engines.engine import Problem, Progress, Trajectory
from engines.mujoco.settings import NativeSettings
from engines.mujoco.state import from_mujoco
from reference.contact import observe

# Output times and steps are both rounded decimals: a millionth of a step is far above their round-off.
ROUND_OFF = 1e-6


def step_counts(times: np.ndarray, step: float) -> list[int]:
    """Whole numbers of steps from the start to each of the output times (n,).

    Raises
    ------
    ValueError
        If an output time lies between two steps.
    """
    counts = np.round(times / step)
    if np.any(np.abs(times - counts * step) > ROUND_OFF * step) or np.any(np.diff(counts) < 1):
        interval = float(np.diff(times).min())
        right = interval / np.ceil(interval / step * (1 - ROUND_OFF))
        raise ValueError(
            f"step is {step!r}; it must divide the output interval of {interval:.9g} s, as {right:.9g} would"
        )
    return [int(count) for count in counts]


@dataclass(frozen=True)
class MujocoNative:
    """MuJoCo's native model as an engine."""

    name: str = "mujoco-native"
    gives: tuple[str, ...] = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")
    settings: type[NativeSettings] = NativeSettings

    @property
    def version(self) -> str:
        """Version of MuJoCo."""
        return version("mujoco")

    def check(self, problem: Problem, settings: Any) -> None:
        """Refuse output times that the step does not meet; see `engines.engine.Engine`."""
        step_counts(problem.times, settings.step)

    def step_noise(self, settings: Any) -> float:
        """What the contact solver may leave unconverged in a step; see `engines.engine.Engine`."""
        return settings.tolerance

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        """Run a problem.

        Parameters
        ----------
        problem : Problem
            Its output times must be multiples of the step.
        settings : NativeSettings
        progress : callable
            Called with the simulated time [s] at most every 50 ms of it.

        Returns
        -------
        Trajectory
            Gap and slip are those of the wheels' knife edges on the true surface. MuJoCo's wheels sink
            in by a fraction of a millimetre and creep. At an exact start they do not slip yet, so the
            first contact forces lack the part that slip brings; it comes within a few time constants.

        Raises
        ------
        ValueError
            If an output time lies between two steps.
        EngineError
            If MuJoCo refuses the model, or a wheel stands nowhere at the start.
        """
        counts = step_counts(problem.times, settings.step)
        # Here, so that listing the engines does not load the library.
        from engines.mujoco.ride import ride

        recording, steps, cpu_time, ended = ride(problem, settings, counts, progress)
        time = problem.times[: len(recording.qpos)]
        q, qd = from_mujoco(time, recording.qpos, recording.qvel, problem.q)
        seen = observe(problem.bicycle, problem.surface, q, qd)
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(mode="json"),
            time=time,
            q=q,
            qd=qd,
            body_position=recording.position,
            body_quaternion=recording.quaternion,
            contact_point=seen.point if seen.found else None,
            contact_force=recording.force,
            gap=seen.gap if seen.found else None,
            slip=seen.slip if seen.found else None,
            kinetic_energy=recording.energy[:, 1],
            potential_energy=recording.energy[:, 0],
            steps=steps,
            cpu_time=cpu_time,
            ended=ended,
        )


ENGINE = MujocoNative()
