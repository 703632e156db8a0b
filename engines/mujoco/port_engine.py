"""The engine class that MuJoCo's ports to other hardware share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..engine import Problem, Progress, Trajectory, package_version
from ..releases import LibraryReach, refuse_releases
from ..single_precision import SinglePrecision
from .engine import GIVES, assemble_trajectory, step_counts
from .ports import BatchSettings

if TYPE_CHECKING:
    from .ride import RideState

S = TypeVar("S", bound=BatchSettings)


@dataclass(frozen=True)
class PortEngine(Generic[S]):
    """A model in a port of MuJoCo as an engine.

    Attributes
    ----------
    name : str
    settings : type
    reach : LibraryReach
        The releases of the port with which it rides; the port's version is the engine's.
    compiler : LibraryReach
        The releases of the library that compiles the port.
    ride : callable
        Function of a problem, settings, numbers of steps up to the outputs and progress that rides. It imports the
        port when it is called, so that listing the engines does not load the library.
    refuse : callable
        Function of a problem and settings that raises `UnsuitableProblem` or ValueError for what the port cannot ride.
    description : str
        The engine in one line.
    settings_source : str
        Whose choice its default settings are.
    gives : tuple of str
    single_precision : SinglePrecision or None
        How it rides in float32 what another engine rides in float64; None if no engine does.
    """

    name: str
    settings: type[S]
    reach: LibraryReach
    compiler: LibraryReach
    ride: Callable[[Problem, Any, list[int], Progress], RideState]
    refuse: Callable[[Problem, Any], None]
    description: str
    settings_source: str
    gives: tuple[str, ...] = GIVES
    single_precision: SinglePrecision | None = None
    takes_inputs = True

    @property
    def bit_variants(self) -> dict[str, dict[str, Any]]:
        """Places in a batch at which a ride should be the same to the last bit; see `Engine`."""
        return {"last place of a batch of 4": {"batch_size": 4, "batch_place": 3}}

    @property
    def version(self) -> str:
        """Version of the port, with those of the library that compiles it and of MuJoCo, which builds its model."""
        compiler = f"{self.compiler.library.lower()} {self.compiler.version}"
        return f"{self.reach.version} ({compiler}, mujoco {package_version('mujoco')})"

    def check(self, problem: Problem, settings: Any) -> None:
        """Refuse untried releases, what the port cannot ride, and output times between two steps; see `Engine`."""
        refuse_releases(self.name, settings, self.reach, self.compiler)
        self.refuse(problem, settings)
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
        settings : BatchSettings
        progress : callable
            Called with the simulated time [s] from time to time.

        Returns
        -------
        Trajectory
            Gap and slip are those of the wheels' knife edges on the true surface.

        Raises
        ------
        UnsuitableProblem
            If a release is out of reach, or the port does not know the ground.
        ValueError
            If an output time lies between two steps, or the port cannot ride with these settings here.
        EngineError
            If the model is refused, a wheel has no contact point at the start, or the contact solver fails there.
        """
        self.check(problem, settings)
        counts = step_counts(problem.times, settings.step)
        ridden = self.ride(problem, settings, counts, progress)
        return assemble_trajectory(self.name, self.version, problem, settings, ridden)
