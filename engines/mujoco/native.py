"""MuJoCo as a careful user models a bicycle: thin wheels on planes with MuJoCo's own soft contacts and solver.

MuJoCo's contact rows prescribe J q'' = -b J q' (- k times the depth, in the normal direction) and omit
J' q', the acceleration of the contact at zero slip. A wheel that rolls along a curve therefore creeps
until b J q' balances it:

    slip = J' q' / b,    b = 2 / (d_max time_constant)

with d_max = 0.95 the largest impedance. With a time constant of two steps the slip is (v^2 / R) d_max step,
first order in the step, as is the energy error of the one-step integrators. Both errors are MuJoCo's own and are not
corrected here. The wheels sink in by a fraction of a millimetre. At an exact start they do not slip yet, so the
first contact forces lack the part that slip brings; it builds up within a few time constants.
"""

from __future__ import annotations

from ..single_precision import SinglePrecision, SinglePrecisionVariant
from .engine import MujocoEngine
from .releases import PLANES
from .settings import NativeSettings, RoundedSettings
from .state import to_mujoco

# Its settings are compared at a tolerance at which the solver leaves less than float32's last digit.
COMPARED_AT = {"tolerance": 1e-14}
_ROUNDED = MujocoEngine(
    "mujoco-native",
    RoundedSettings,
    "velodrome.engines.mujoco.rounding:build_rounded_planes",
    description="mujoco-native with a state that is rounded to float32 after every step",
    settings_source="those of mujoco-native",
    reach=PLANES,
)
ENGINE = MujocoEngine(
    "mujoco-native",
    NativeSettings,
    "velodrome.engines.mujoco.planes:build_planes",
    description="MuJoCo as a careful user sets it: stiff contacts on tangent planes, hard friction",
    settings_source="the suite's own choice within MuJoCo's documented limits: contacts as stiff as two steps allow, "
    "implicitfast, elliptic cone, impratio 10, and friction 2, which is more than the library's rides need",
    reach=PLANES,
    single_precision=SinglePrecision(
        counterpart="mujoco-native",
        variants=(
            SinglePrecisionVariant("state rounded", changes={"rounded": "state"}, engine=_ROUNDED),
            SinglePrecisionVariant("positions rounded", ("positions",), {"rounded": "positions"}, _ROUNDED),
            SinglePrecisionVariant("velocities rounded", ("velocities",), {"rounded": "velocities"}, _ROUNDED),
        ),
        common=COMPARED_AT,
        store=to_mujoco,
    ),
)
