"""MuJoCo Warp as an engine: the model of `mujoco-native` under its own contacts, in single precision.

Warp compiles its kernels before a ride, which takes some 35 s of CPU time and no part of a trajectory's CPU time, and
keeps them on disk, in the folder that the environment variable WARP_CACHE_PATH names or in the user's cache.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..engine import Problem, Progress, Trajectory, package_version
from ..mujoco.engine import GIVES, assemble_trajectory, step_counts
from ..mujoco.state import to_mujoco
from ..releases import refuse_releases
from ..single_precision import SinglePrecision, SinglePrecisionVariant
from .releases import MUJOCO_WARP, WARP
from .settings import WarpSettings


@dataclass(frozen=True)
class WarpEngine:
    """A model in MuJoCo Warp as an engine.

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
        What it rides in float32 of another engine's rides in float64.
    """

    name: str
    settings: type[WarpSettings]
    description: str
    settings_source: str
    gives: tuple[str, ...] = GIVES
    single_precision: SinglePrecision | None = None
    reach = MUJOCO_WARP
    takes_inputs = True

    @property
    def bit_variants(self) -> dict[str, dict[str, Any]]:
        """Places in a batch at which a ride should be the same to the last bit; see `Engine`."""
        return {"last place of a batch of 4": {"batch_size": 4, "batch_place": 3}}

    @property
    def version(self) -> str:
        """Version of MuJoCo Warp, with those of Warp, which compiles it, and of MuJoCo, which builds its model."""
        warp, mujoco = package_version("warp-lang"), package_version("mujoco")
        return f"{package_version('mujoco-warp')} (warp {warp}, mujoco {mujoco})"

    def check(self, problem: Problem, settings: Any) -> None:
        """Refuse untried releases, output times between two steps, and a processor that is not there; see `Engine`."""
        refuse_releases(self.name, settings, MUJOCO_WARP, WARP)
        step_counts(problem.times, settings.step)
        if settings.device != "cpu":
            from .process import list_devices

            known = list_devices()
            if settings.device not in known:
                raise ValueError(f"device is {settings.device!r}; Warp finds {', '.join(known)} here")

    def step_noise(self, settings: Any) -> float:
        """Return the larger of round-off and what the contact solver may leave unconverged in a step; see `Engine`."""
        return settings.noise

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        """Run a problem.

        Parameters
        ----------
        problem : Problem
            Its output times must be multiples of the step.
        settings : WarpSettings
        progress : callable
            Called with the simulated time [s] at most every 50 ms of it.

        Returns
        -------
        Trajectory
            Gap and slip are those of the wheels' knife edges on the true surface.

        Raises
        ------
        ValueError
            If an output time lies between two steps.
        EngineError
            If the model is refused, a wheel has no contact point at the start, or the contact solver fails there.
        """
        refuse_releases(self.name, settings, MUJOCO_WARP, WARP)
        counts = step_counts(problem.times, settings.step)
        from .process import quiet_warp

        with quiet_warp():
            from .ride import ride_in_warp

            ridden = ride_in_warp(problem, settings, counts, progress)
        return assemble_trajectory(self.name, self.version, problem, settings, ridden)


ENGINE = WarpEngine(
    "mujoco-warp",
    WarpSettings,
    description="MuJoCo Warp, MuJoCo's port to Warp in single precision, with the model of mujoco-native",
    settings_source="those of mujoco-native, whose model it rides: the suite's own choice within MuJoCo's limits; the "
    "tolerance is MuJoCo Warp's least",
    single_precision=SinglePrecision(
        counterpart="mujoco-native",
        variants=(SinglePrecisionVariant("float32"),),
        # A tolerance tighter than its own it does not know; Newton's method stops far below it in double precision too.
        common={},
        store=to_mujoco,
    ),
)
