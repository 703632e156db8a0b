"""Measure rides: errors, drift, falls, friction, modes, orders, and the differences that round-off allows."""

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
    "Quantity",
    "Scale",
    "Sensitivity",
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
    "identify",
    "interval_of",
    "jacobian_at",
    "measure_creep",
    "measure_sensitivity",
    "measure_step_errors",
    "measure_work",
    "noise",
    "normal_force",
    "observed_orders",
    "order_limit",
    "position_errors",
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
