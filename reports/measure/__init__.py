"""Measurements on rides: errors, drift, falls, friction, modes, orders, and what round-off allows them to differ by."""

from .consistency import LARGEST_NOISE, TURNING, Mismatch, describe, follow, mismatches
from .convergence import observed_orders
from .fall import as_shown, fell_at, until_fall
from .friction import normal_force, required_friction
from .identify import DISTURBANCES, LEVELS, STENCIL_WEIGHT, Identified, identify, interval_of, jacobian_at
from .inspection import relative_differences, rms_force_error, state_error
from .limits import ROUND_OFF, START_ERROR, Scale, eigenvalue_limits, noise, order_limit, ride_limits, step_force
from .metrics import metrics, number, position_errors
from .modes import Mode, Modes, modes_of
from .precision import SAME_BITS, Level, compared_time, comparison_horizon, eigenvalue_document, engine_document, match
from .steady import steady_trajectory

__all__ = [
    "DISTURBANCES",
    "LARGEST_NOISE",
    "LEVELS",
    "ROUND_OFF",
    "SAME_BITS",
    "START_ERROR",
    "STENCIL_WEIGHT",
    "TURNING",
    "Identified",
    "Level",
    "Mismatch",
    "Mode",
    "Modes",
    "Scale",
    "as_shown",
    "compared_time",
    "comparison_horizon",
    "describe",
    "eigenvalue_document",
    "eigenvalue_limits",
    "engine_document",
    "fell_at",
    "follow",
    "identify",
    "interval_of",
    "jacobian_at",
    "match",
    "metrics",
    "mismatches",
    "modes_of",
    "noise",
    "normal_force",
    "number",
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
    "until_fall",
]
