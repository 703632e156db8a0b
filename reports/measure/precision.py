"""Work-precision: what an engine's error does as its step is halved, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from .convergence import extrapolate, observed_orders
from .identify import Identified
from .metrics import position_errors, to_number

SMALL = 0.1  # of the motion's size: what nonlinearity adds to an error up to here, the next powers of the step take

SAME_BITS = "its step changes nothing: rides of different steps are equal to the last bit"


@dataclass(frozen=True)
class Level:
    """One run of a study: its step [s] (the mean one of a method that chooses its own), trajectory and metrics."""

    step: float
    trajectory: Trajectory
    metrics: Mapping[str, Any]


@dataclass(frozen=True)
class StepConvergence:
    """How a sequence of levels converges.

    Attributes
    ----------
    window : float
        Time up to which order and limit are taken [s]: there even the coarsest level's error is small.
    orders : list of float
        Seen by each three successive levels.
    limit_error : float
        Largest distance of the extrapolated path of D from the reference's [m].
    uncertainty : float
        Of that path: largest change by the last extrapolation [m].
    """

    window: float
    orders: list[float]
    limit_error: float
    uncertainty: float


def comparison_horizon(levels: Sequence[Level]) -> float | None:
    """Time up to which the finest level's comparison means anything [s]; None where no error is amplified."""
    return levels[-1].metrics["horizon"] if levels else None


def compared_time(document: Mapping[str, Any]) -> float:
    """Time over which a document of `velodrome precision` takes its errors [s]."""
    horizon, duration = document["horizon"], document["duration"]
    return duration if horizon is None else min(horizon, duration)


def measure_convergence(levels: Sequence[Level], reference: Trajectory, size: float) -> StepConvergence | None:
    """Order and limit of levels with halved steps.

    Parameters
    ----------
    levels : sequence of Level
        From the coarsest to the finest, sampled at the reference's times.
    reference : Trajectory
    size : float
        Of the motion [m].

    Returns
    -------
    Convergence or None
        None with fewer than two levels, where two of them are equal to the last bit, or where not even the first
        samples agree.
    """
    if len(levels) < 2 or step_changes_nothing(levels):
        return None
    errors = np.array([position_errors(level.trajectory, reference) for level in levels]).max(axis=0)
    beyond = np.flatnonzero(errors > SMALL * size)
    samples = int(beyond[0]) if len(beyond) else len(errors)
    if samples < 2:
        return None
    paths = [level.trajectory.q[:samples, :3] for level in levels]
    limit = extrapolate(paths)
    distance = np.linalg.norm(limit.value - reference.q[:samples, :3], axis=1)
    window = float(reference.time[samples - 1])
    return StepConvergence(window, observed_orders(paths), float(distance.max()), limit.uncertainty)


def step_changes_nothing(levels: Sequence[Level]) -> bool:
    """Whether two successive levels are equal to the last bit, so that neither order nor limit can be seen."""
    return any(np.array_equal(a.trajectory.q, b.trajectory.q) for a, b in pairwise(levels))


def engine_document(
    levels: Sequence[Level],
    failures: Sequence[Mapping[str, Any]],
    reference: Trajectory,
    size: float,
    horizon: float | None,
) -> dict[str, Any]:
    """One engine's part of the JSON document of `velodrome precision`.

    Parameters
    ----------
    levels : sequence of Level
    failures : sequence of mapping
        ``step`` and ``reason`` of the runs that did not come to their end.
    reference : Trajectory
    size : float
        Of the motion [m].
    horizon : float or None
        Errors are taken up to here [s]; None for the whole run.
    """
    found = measure_convergence(levels, reference, size)
    orders = [] if found is None else found.orders
    unseen = [{"step": None, "reason": SAME_BITS}] if step_changes_nothing(levels) else []
    return {
        "points": [_point(level, reference, horizon) for level in levels],
        "failures": [*failures, *unseen],
        "observed_order": to_number(orders[-1]) if orders else None,
        "orders": [to_number(order) for order in orders],
        "richardson_error": None if found is None else found.limit_error,
        "richardson_uncertainty": None if found is None else found.uncertainty,
        "window": None if found is None else found.window,
    }


def _point(level: Level, reference: Trajectory, horizon: float | None) -> dict[str, Any]:
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
    """Eigenvalues that an engine itself has, beside the reference's, as JSON values.

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
    """Order values so that as a whole they lie nearest to the reference's."""
    # Imported here: scipy's optimisers take a third of a second, and only this needs one of them.
    from scipy.optimize import linear_sum_assignment

    return values[linear_sum_assignment(np.abs(reference[:, None] - values[None, :]))[1]]
