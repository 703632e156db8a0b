"""Work-precision: an engine's error as its step is halved, and its cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from .convergence import extrapolate, observed_orders
from .identify import Identified
from .limits import LARGEST_ORDER_LIMIT
from .metrics import position_errors, to_number

SMALL = 0.1  # of the motion's size: up to here the next powers of the step absorb what nonlinearity adds to an error

SAME_BITS = "its step changes nothing: rides of different steps are equal to the last bit"
UNSETTLED = (
    "no order: over parts of the ride the last three steps show {0:.2f} to {1:.2f}, which round-off or iterations "
    "leave where the method's own error is smaller, or steps that are too long"
)


@dataclass(frozen=True)
class Level:
    """One run of a study: its step [s] (the mean step of a method that adapts it), trajectory and metrics."""

    step: float
    trajectory: Trajectory
    metrics: Mapping[str, Any]


@dataclass(frozen=True)
class StepConvergence:
    """Convergence of a sequence of levels.

    Attributes
    ----------
    window : float
        Time up to which order and limit are taken [s]; up to it even the coarsest level's error is small.
    orders : list of float
        Observed in each three successive levels.
    limit_error : float
        Largest distance of the extrapolated path of D from the reference's [m].
    uncertainty : float
        Uncertainty of that path: largest change by the last extrapolation [m].
    """

    window: float
    orders: list[float]
    limit_error: float
    uncertainty: float


def comparison_horizon(levels: Sequence[Level]) -> float | None:
    """Return the time up to which the finest level's comparison is meaningful [s]; None where no error is amplified."""
    return levels[-1].metrics["horizon"] if levels else None


def compared_time(document: Mapping[str, Any]) -> float:
    """Return the time over which a document of `velodrome precision` takes its errors [s]."""
    horizon, duration = document["horizon"], document["duration"]
    return duration if horizon is None else min(horizon, duration)


def measure_convergence(levels: Sequence[Level], reference: Trajectory, size: float) -> StepConvergence | None:
    """Return order and limit of levels with halved steps.

    Parameters
    ----------
    levels : sequence of Level
        From the coarsest to the finest, sampled at the reference's times.
    reference : Trajectory
    size : float
        Size of the motion [m].

    Returns
    -------
    StepConvergence or None
        None with fewer than two levels, where two of them are equal to the last bit, or where not even the first
        samples agree.
    """
    if len(levels) < 2 or step_changes_nothing(levels):
        return None
    samples = _count_small_errors(levels, reference, size)
    if samples < 2:
        return None
    paths = [level.trajectory.q[:samples, :3] for level in levels]
    limit = extrapolate(paths)
    distance = np.linalg.norm(limit.value - reference.q[:samples, :3], axis=1)
    window = float(reference.time[samples - 1])
    return StepConvergence(window, observed_orders(paths), float(distance.max()), limit.uncertainty)


def measure_order_range(levels: Sequence[Level], reference: Trajectory, size: float) -> tuple[float, float] | None:
    """Return the least and the largest order that the three finest levels show over parts of the ride.

    The parts are the first quarter, half and three quarters of the window of `measure_convergence`, and the whole. A
    method in its asymptotic range shows nearly the same order in all of them; a wide range says that the observed order
    is not settled.

    Parameters
    ----------
    levels, reference, size
        As in `measure_convergence`.

    Returns
    -------
    tuple of float or None
        None with fewer than three levels, where levels are equal to the last bit, or where errors are not small.
    """
    if len(levels) < 3 or step_changes_nothing(levels):
        return None
    samples = _count_small_errors(levels, reference, size)
    # A part needs two samples: in the first one all rides are at the start.
    parts = [part for quarters in range(1, 5) for part in [samples * quarters // 4] if part > 1]
    paths = [level.trajectory.q[:, :3] for level in levels[-3:]]
    found = [
        order for part in parts for order in observed_orders([path[:part] for path in paths]) if np.isfinite(order)
    ]
    return (min(found), max(found)) if found else None


def _count_small_errors(levels: Sequence[Level], reference: Trajectory, size: float) -> int:
    """Return the number of first samples in which the error of every level is small."""
    errors = np.array([position_errors(level.trajectory, reference) for level in levels]).max(axis=0)
    beyond = np.flatnonzero(errors > SMALL * size)
    return int(beyond[0]) if len(beyond) else len(errors)


def step_changes_nothing(levels: Sequence[Level]) -> bool:
    """Return whether two successive levels are equal to the last bit, so that they show neither order nor limit."""
    return any(np.array_equal(a.trajectory.q, b.trajectory.q) for a, b in pairwise(levels))


def engine_document(
    levels: Sequence[Level],
    failures: Sequence[Mapping[str, Any]],
    reference: Trajectory,
    size: float,
    horizon: float | None,
) -> dict[str, Any]:
    """Return one engine's part of the JSON document of `velodrome precision`.

    An order that differs by one or more between parts of the ride (`measure_order_range`) is none.

    Parameters
    ----------
    levels : sequence of Level
    failures : sequence of mapping
        ``step`` and ``reason`` of the runs that did not finish.
    reference : Trajectory
    size : float
        Size of the motion [m].
    horizon : float or None
        Time up to which errors are taken [s]; None for the whole run.
    """
    convergence = measure_convergence(levels, reference, size)
    orders = [] if convergence is None else convergence.orders
    order_range = measure_order_range(levels, reference, size)
    settled = order_range is None or order_range[1] - order_range[0] < 2 * LARGEST_ORDER_LIMIT
    reasons = [SAME_BITS] if step_changes_nothing(levels) else []
    if order_range is not None and not settled:
        reasons.append(UNSETTLED.format(*order_range))
    return {
        "points": [_level_document(level, reference, horizon) for level in levels],
        "failures": [*failures, *({"step": None, "reason": reason} for reason in reasons)],
        "observed_order": to_number(orders[-1]) if orders and settled else None,
        "order_range": None if order_range is None else list(order_range),
        "orders": [to_number(order) for order in orders],
        "richardson_error": None if convergence is None else convergence.limit_error,
        "richardson_uncertainty": None if convergence is None else convergence.uncertainty,
        "window": None if convergence is None else convergence.window,
    }


def _level_document(level: Level, reference: Trajectory, horizon: float | None) -> dict[str, Any]:
    errors = position_errors(level.trajectory, reference)
    if horizon is not None:
        errors = errors[: max(1, int(np.searchsorted(reference.time[: len(errors)], horizon, side="right")))]
    measured = level.metrics
    return {
        "step": level.step,
        "position_error": float(errors.max()),
        "energy_drift": measured["energy_drift"],
        "max_slip": measured["max_slip"],
        "contact_force_error": measured["contact_force_error"],
        "cpu_time": level.trajectory.cpu_time,
        "horizon": measured["horizon"],
    }


def eigenvalue_document(identified: Identified, reference: np.ndarray) -> dict[str, Any]:
    """Return an engine's own eigenvalues beside the reference's, as JSON values.

    Parameters
    ----------
    identified : Identified
    reference : ndarray, shape (7,), complex
        [1/s].

    Returns
    -------
    dict
        ``values`` and ``reference`` in the same order, ``errors`` per pair, the largest ``error``,
        ``order`` in the step, ``uncertainty`` of the Jacobian's extrapolation.
    """
    matched = eigenvalue_pairs(reference, identified.eigenvalues)
    errors = np.abs(matched - reference)
    return {
        "values": [[value.real, value.imag] for value in matched],
        "reference": [[value.real, value.imag] for value in reference],
        "errors": errors.tolist(),
        "error": float(errors.max()),
        "order": to_number(identified.order),
        "uncertainty": identified.uncertainty,
    }


def eigenvalue_pairs(reference: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Reorder values so that as a whole they lie nearest to the reference's."""
    # Imported here because importing scipy's optimisers takes a third of a second and only this function needs them.
    from scipy.optimize import linear_sum_assignment

    return values[linear_sum_assignment(np.abs(reference[:, None] - values[None, :]))[1]]
