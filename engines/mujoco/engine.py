"""The engine class that all MuJoCo models share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from ..contact_fields import observe_contact_fields
from ..engine import Problem, Progress, Trajectory
from ..releases import LibraryReach, refuse_releases
from ..single_precision import AdvanceStates, SinglePrecision
from ..threads import ride_in_threads
from .settings import StepSettings
from .state import from_mujoco

if TYPE_CHECKING:
    from .ride import RideState, Rig

S = TypeVar("S", bound=StepSettings)
GIVES = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")
# Output times and steps are both rounded decimals: a millionth of a step is far above their round-off.
STEP_ROUND_OFF = 1e-6


def step_counts(times: np.ndarray, step: float) -> list[int]:
    """Return the number of steps from the start to each of the output times (n,).

    Raises
    ------
    ValueError
        If an output time lies between two steps.
    """
    counts = np.round(times / step)
    if np.any(np.abs(times - counts * step) > STEP_ROUND_OFF * step) or np.any(np.diff(counts) < 1):
        interval = float(np.diff(times).min())
        right = interval / np.ceil(interval / step * (1 - STEP_ROUND_OFF))
        raise ValueError(
            f"step is {step!r}; it must divide the output interval of {interval:.9g} s, as {right:.9g} would"
        )
    return [int(count) for count in counts]


@dataclass(frozen=True)
class MujocoEngine(Generic[S]):
    """A MuJoCo model as an engine.

    Attributes
    ----------
    name : str
    settings : type
    builder : str
        Module and name of the function that makes a `Rig` of a problem and settings. It is imported when
        something runs, so that listing the engines does not load the library.
    description : str
        The engine in one line.
    settings_source : str
        Whose choice the defaults of the settings are.
    reach : LibraryReach
        The releases of MuJoCo with which it rides.
    gives : tuple of str
    single_precision : SinglePrecision or None
        How it rides in float32; None if it does not.
    """

    name: str
    settings: type[S]
    builder: str
    description: str
    settings_source: str
    reach: LibraryReach
    gives: tuple[str, ...] = GIVES
    single_precision: SinglePrecision | None = None
    takes_inputs = True
    packages = ("mujoco",)

    @property
    def version(self) -> str:
        """Version of MuJoCo."""
        return self.reach.version

    def check(self, problem: Problem, settings: Any) -> None:
        """Refuse releases of MuJoCo without what the model needs, and output times that are not multiples of the step.

        See `velodrome.engines.engine.Engine`.
        """
        refuse_releases(self.name, settings, self.reach)
        step_counts(problem.times, settings.step)

    def step_noise(self, settings: Any) -> float:
        """Return the larger of round-off and what the contact solver may leave unconverged in a step; see `Engine`."""
        return settings.noise

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        """Run a problem.

        Parameters
        ----------
        problem : Problem
            Its output times must be multiples of the step.
        settings : StepSettings
        progress : callable
            Called with the simulated time [s] at most every 50 ms of it.

        Returns
        -------
        Trajectory
            Gap and slip are those of the wheels' knife edges on the true surface.

        Raises
        ------
        UnsuitableProblem
            If this release of MuJoCo lacks what the model needs.
        ValueError
            If an output time lies between two steps.
        EngineError
            If MuJoCo refuses the model, or a wheel has no contact point at the start.
        """
        self.check(problem, settings)
        counts = step_counts(problem.times, settings.step)
        from .ride import ride_rig

        ridden = ride_rig(self._build(problem, settings), settings.step, counts, progress)
        return assemble_trajectory(self.name, self.version, problem, settings, ridden, self.reach.list_adaptations())

    def simulate_many(self, problems: Sequence[Problem], settings: Any, threads: int) -> list[Trajectory | Exception]:
        """Run problems in threads; MuJoCo steps without Python's lock. See `velodrome.engines.engine.Engine`.

        `mujoco.rollout` steps no faster, and it keeps neither what the contact solver left in each ride's steps nor its
        warm start at the output times, on which the last digits of the forces depend.
        """
        from .ride import no_report

        # The function that takes MuJoCo's warnings belongs to the process: it must not change while others ride.
        with no_report():
            return ride_in_threads(lambda problem, report: self.simulate(problem, settings, report), problems, threads)

    def make_advance(self, problem: Problem, settings: Any) -> AdvanceStates:
        """Return the function that moves states of a problem by a number of steps; see `advance.advance_states`."""
        from .advance import advance_states

        def advance(q: np.ndarray, qd: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
            return advance_states(self._build(replace(problem, q=q[0], qd=qd[0]), settings), q, qd, steps)

        return advance

    def _build(self, problem: Problem, settings: Any) -> Rig:
        module, name = self.builder.split(":")
        build: Callable[[Problem, Any], Rig] = getattr(import_module(module), name)
        return build(problem, settings)


def assemble_trajectory(
    name: str,
    version: str,
    problem: Problem,
    settings: StepSettings,
    ridden: RideState,
    adaptations: Mapping[str, Any] = MappingProxyType({}),
) -> Trajectory:
    """Return the trajectory of a ride in MuJoCo's coordinates.

    Parameters
    ----------
    name, version : str
        Those of the engine.
    problem : Problem
    settings : StepSettings
    ridden : RideState
    adaptations : mapping
        What was done otherwise for an older release, from `LibraryReach.list_adaptations`.

    Returns
    -------
    Trajectory
        Gap and slip are those of the wheels' knife edges on the true surface.
    """
    recording = ridden.recording
    q, qd = from_mujoco(recording.time, recording.qpos, recording.qvel, problem.q)
    return Trajectory(
        engine=name,
        version=version,
        settings=settings.model_dump(mode="json") | dict(adaptations),
        time=recording.time,
        q=q,
        qd=qd,
        body_position=recording.position,
        body_quaternion=recording.quaternion,
        contact_force=recording.force,
        **observe_contact_fields(problem, q, qd),
        kinetic_energy=recording.energy[:, 1],
        potential_energy=recording.energy[:, 0],
        steps=ridden.steps,
        cpu_time=ridden.cpu_time,
        ended=ridden.ended,
        fall=ridden.fall,
        friction=settings.least_friction,
        unconverged_steps=ridden.unconverged_steps,
        largest_residual=ridden.largest_residual,
    )
