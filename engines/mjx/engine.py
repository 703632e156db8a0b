"""MJX as an engine: the model of `mujoco-native` under its own contacts, and its tree under the forces of rolling.

JAX compiles a ride once for each ground, precision, solver and size of a batch, which takes some 8 to 18 s of CPU time
and no part of a trajectory's CPU time; later rides of a process share the code. JAX keeps compiled code on disk, for
other processes, in the folder that the environment variable JAX_COMPILATION_CACHE_DIR names.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..engine import Problem, Progress
from ..mujoco.native import COMPARED_AT
from ..mujoco.port_engine import PortEngine
from ..mujoco.state import to_mujoco
from ..single_precision import SinglePrecision, SinglePrecisionVariant
from .ground import choose_height
from .process import process_kept
from .releases import JACOBIAN_RATE, JAX, MJX
from .settings import MjxMultiplierSettings, MjxSettings

if TYPE_CHECKING:
    from ..mujoco.ride import RideState


def _ride(problem: Problem, settings: Any, counts: list[int], progress: Progress) -> RideState:
    with process_kept():
        from .ride import ride_in_mjx

    return ride_in_mjx(problem, settings, counts, progress)


def _refuse_unknown_ground(problem: Problem, settings: Any) -> None:
    choose_height(problem.surface)


ENGINE = PortEngine(
    "mjx",
    MjxSettings,
    MJX,
    JAX,
    _ride,
    _refuse_unknown_ground,
    description="MJX, MuJoCo's port to JAX, with the model of mujoco-native",
    settings_source="those of mujoco-native, whose model it rides: the suite's own choice within MuJoCo's limits",
    single_precision=SinglePrecision(
        counterpart="mujoco-native",
        variants=(SinglePrecisionVariant("float32", changes={"precision": "float32"}),),
        common=COMPARED_AT,
        store=to_mujoco,
    ),
)
MULTIPLIERS = PortEngine(
    "mjx-multipliers",
    MjxMultiplierSettings,
    JACOBIAN_RATE,
    JAX,
    _ride,
    _refuse_unknown_ground,
    description="MJX's tree under the exact forces of rolling, without its contacts and integrators",
    settings_source="those of mujoco-multipliers: the suite's own choice",
)
