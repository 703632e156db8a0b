"""Measure rides: errors, drift, falls, friction, modes, orders, and the differences that round-off allows.

What needs the room of bifurcations is imported when it is first used: rides are measured without.
"""

from typing import TYPE_CHECKING

from ...engines.lazy import import_when_used as _import_when_used
from .balance import InputWork, conserved_energy, measure_work
from .consistency import (
    LARGEST_NOISE,
    TURNING,
    Mismatch,
    coordinate_differences,
    describe_mismatch,
    evaluate_ride,
    find_mismatches,
)
from .convergence import extrapolate, observed_orders
from .creep import Creep, contact_acceleration, measure_creep
from .fall import cut_at_fall, fell_at, until_fall
from .float32 import (
    LastDigits,
    Sensitivity,
    carry_errors,
    disturb_states,
    find_deviations,
    measure_sensitivity,
    measure_step_errors,
)
from .friction import normal_force, required_friction
from .identify import DISTURBANCES, IDENTIFY_LEVELS, STENCIL_WEIGHT, Identified, identify, interval_of, jacobian_at
from .inspection import relative_differences, rms_force_error, state_error
from .limits import ROUND_OFF, START_ERROR, Scale, eigenvalue_limits, noise, order_limit, ride_limits, step_force
from .metrics import compute_metrics, flatten_metrics, position_errors, to_number
from .modes import Mode, Modes, find_modes
from .precision import (
    SAME_BITS,
    Level,
    compared_time,
    comparison_horizon,
    eigenvalue_document,
    eigenvalue_pairs,
    engine_document,
)
from .quantities import QUANTITIES, Quantity
from .steady import steady_trajectory

if TYPE_CHECKING:
    from .orbit_following import follow_orbit as follow_orbit
    from .orbit_following import predict_differences as predict_differences
    from .own_circle import OwnCircle as OwnCircle
    from .own_circle import measure_at_start as measure_at_start
    from .own_circle import measure_own_circle as measure_own_circle
    from .stability_boundary import StabilityBoundary as StabilityBoundary
    from .stability_boundary import locate_boundary as locate_boundary
    from .step_laws import StepLaw as StepLaw
    from .step_laws import predict_shift as predict_shift

__all__ = [
    "DISTURBANCES",
    "IDENTIFY_LEVELS",
    "LARGEST_NOISE",
    "QUANTITIES",
    "ROUND_OFF",
    "SAME_BITS",
    "START_ERROR",
    "STENCIL_WEIGHT",
    "TURNING",
    "Creep",
    "Identified",
    "InputWork",
    "LastDigits",
    "Level",
    "Mismatch",
    "Mode",
    "Modes",
    "OwnCircle",
    "Quantity",
    "Scale",
    "Sensitivity",
    "StabilityBoundary",
    "StepLaw",
    "carry_errors",
    "compared_time",
    "comparison_horizon",
    "compute_metrics",
    "conserved_energy",
    "contact_acceleration",
    "coordinate_differences",
    "cut_at_fall",
    "describe_mismatch",
    "disturb_states",
    "eigenvalue_document",
    "eigenvalue_limits",
    "eigenvalue_pairs",
    "engine_document",
    "evaluate_ride",
    "extrapolate",
    "fell_at",
    "find_deviations",
    "find_mismatches",
    "find_modes",
    "flatten_metrics",
    "follow_orbit",
    "identify",
    "interval_of",
    "jacobian_at",
    "locate_boundary",
    "measure_at_start",
    "measure_creep",
    "measure_own_circle",
    "measure_sensitivity",
    "measure_step_errors",
    "measure_work",
    "noise",
    "normal_force",
    "observed_orders",
    "order_limit",
    "position_errors",
    "predict_differences",
    "predict_shift",
    "relative_differences",
    "required_friction",
    "ride_limits",
    "rms_force_error",
    "state_error",
    "steady_trajectory",
    "step_force",
    "to_number",
    "until_fall",
]

if not TYPE_CHECKING:  # with __getattr__, type checkers would accept any name
    __getattr__ = _import_when_used(
        __name__,
        {
            ".orbit_following": ("follow_orbit", "predict_differences"),
            ".own_circle": ("OwnCircle", "measure_at_start", "measure_own_circle"),
            ".stability_boundary": ("StabilityBoundary", "locate_boundary"),
            ".step_laws": ("StepLaw", "predict_shift"),
        },
    )
