"""MJX as an engine: the model of `mujoco-native` under its own contacts, and its tree under the forces of rolling.

JAX compiles a ride once for each ground, precision, solver and size of a batch, which takes some 8 to 18 s of CPU time
and no part of a trajectory's CPU time; later rides of a process share the code. JAX keeps compiled code on disk, for
other processes, in the folder that the environment variable JAX_COMPILATION_CACHE_DIR names.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from ..engine import Problem, Progress, Trajectory, package_version
from ..mujoco.engine import GIVES, assemble_trajectory, step_counts
from ..mujoco.native import COMPARED_AT
from ..mujoco.state import to_mujoco
from ..releases import LibraryReach, refuse_releases
from ..single_precision import SinglePrecision, SinglePrecisionVariant
from .ground import choose_height
from .process import process_kept
from .releases import JACOBIAN_RATE, JAX, MJX
from .settings import ArraySettings, MjxMultiplierSettings, MjxSettings

S = TypeVar("S", bound=ArraySettings)


@dataclass(frozen=True)
class MjxEngine(Generic[S]):
    """A model in MJX as an engine.

    Attributes
    ----------
    name : str
    settings : type
    description : str
        The engine in one line.
    settings_source : str
        Whose choice its default settings are.
    gives : tuple of str
    single_precision : SinglePrecision or None
        How it rides in float32 what another engine rides in float64; None if no engine does.
    reach : LibraryReach
        The releases of MJX with which it rides.
    """

    name: str
    settings: type[S]
    description: str
    settings_source: str
    gives: tuple[str, ...] = GIVES
    single_precision: SinglePrecision | None = None
    reach: LibraryReach = MJX
    takes_inputs = True

    @property
    def bit_variants(self) -> dict[str, dict[str, Any]]:
        """Places in a batch at which a ride should be the same to the last bit; see `Engine`."""
        return {"last place of a batch of 4": {"batch_size": 4, "batch_place": 3}}

    @property
    def version(self) -> str:
        """Version of MJX, with those of JAX, which compiles it, and of MuJoCo, which builds its model."""
        return f"{package_version('mujoco-mjx')} (jax {package_version('jax')}, mujoco {package_version('mujoco')})"

    def check(self, problem: Problem, settings: Any) -> None:
        """Refuse untried releases, ground without a closed form, and output times between two steps; see `Engine`."""
        refuse_releases(self.name, settings, self.reach, JAX)
        choose_height(problem.surface)
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
        settings : ArraySettings
        progress : callable
            Called with the simulated time [s] after every 32 outputs.

        Returns
        -------
        Trajectory
            Gap and slip are those of the wheels' knife edges on the true surface.

        Raises
        ------
        ValueError
            If an output time lies between two steps, or the ground has no closed form.
        EngineError
            If the model is refused, a wheel has no contact point at the start, or the contact solver fails there.
        """
        refuse_releases(self.name, settings, self.reach, JAX)
        counts = step_counts(problem.times, settings.step)
        with process_kept():
            from .ride import ride_in_mjx

        ridden = ride_in_mjx(problem, settings, counts, progress)
        return assemble_trajectory(self.name, self.version, problem, settings, ridden)


ENGINE = MjxEngine(
    "mjx",
    MjxSettings,
    description="MJX, MuJoCo's port to JAX, with the model of mujoco-native",
    settings_source="those of mujoco-native, whose model it rides: the suite's own choice within MuJoCo's limits",
    single_precision=SinglePrecision(
        counterpart="mujoco-native",
        variants=(SinglePrecisionVariant("float32", changes={"precision": "float32"}),),
        common=COMPARED_AT,
        store=to_mujoco,
    ),
)
MULTIPLIERS = MjxEngine(
    "mjx-multipliers",
    MjxMultiplierSettings,
    description="MJX's tree under the exact forces of rolling, without its contacts and integrators",
    settings_source="those of mujoco-multipliers: the suite's own choice",
    reach=JACOBIAN_RATE,
)
