"""MuJoCo Warp as an engine: the model of `mujoco-native` under its own contacts, in single precision.

Warp compiles its kernels before a ride, which takes some 35 s of CPU time and no part of a trajectory's CPU time, and
keeps them on disk, in the folder that the environment variable WARP_CACHE_PATH names or in the user's cache.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..engine import Problem, Progress
from ..mujoco.port_engine import PortEngine
from ..mujoco.state import to_mujoco
from ..single_precision import SinglePrecision, SinglePrecisionVariant
from .releases import MUJOCO_WARP, WARP
from .settings import WarpSettings

if TYPE_CHECKING:
    from ..mujoco.ride import RideState


def _ride(problem: Problem, settings: Any, counts: list[int], progress: Progress) -> RideState:
    from .process import quiet_warp

    with quiet_warp():
        from .ride import ride_in_warp

        return ride_in_warp(problem, settings, counts, progress)


def _refuse_missing_device(problem: Problem, settings: Any) -> None:
    if settings.device != "cpu":
        from .process import list_devices

        known = list_devices()
        if settings.device not in known:
            raise ValueError(f"device is {settings.device!r}; Warp finds {', '.join(known)} here")


ENGINE = PortEngine(
    "mujoco-warp",
    WarpSettings,
    MUJOCO_WARP,
    WARP,
    _ride,
    _refuse_missing_device,
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
