"""Whether samples belong to their time stamps, and rates to the same times as coordinates.

What a check can detect depends on the engine's own error. Each check therefore also adds a lag of half a step to the
engine's ride and reports whether it would have detected that lag.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..measure import describe_mismatch
from .explain import explain_numbers, fit_lag, rate_names, size_of
from .report import ConformanceCheck, make_check
from .rides import Ride

_CONSTANT = 0.25  # relative difference that is allowed between the lag of the first samples and of the whole ride
_FIRST = 5  # number of first samples
_ROOM = 4.0  # factor between two errors of one computation, as in `velodrome.reports.measure.consistency`


def check_clock(ride: Ride) -> ConformanceCheck:
    """Check that every sample belongs to its time stamp.

    A ride with a wrong clock follows the right path at wrong times: its difference from the reference's ride is the
    velocity times a lag that is constant from the second sample on.
    """
    half, lag = ride.step / 2, _find_lag(ride)
    q = ride.q.copy()
    q[1:] -= half * ride.exact.qd[1:]
    detected = _find_lag(ride.altered(q=q)) is not None
    return make_check(
        f"clock on {ride.motion.name}",
        "every sample belongs to its time stamp",
        []
        if lag is None
        else [f"its samples look {_format_lag(lag)}, all by the same: its clock is not that of its state"],
        [_describe_sensitivity("samples", half, detected)],
        "a lag must explain nine tenths of the error and be the same in the first samples and over the ride",
    )


def check_rates(ride: Ride) -> ConformanceCheck:
    """Check that the rates are the derivatives of the coordinates."""
    half, wrong = ride.step / 2, [describe_mismatch(found.as_json()) for found in ride.mismatch(["qd"])]
    slope = np.gradient(ride.exact.qd, ride.trajectory.time, axis=0, edge_order=2)
    late = ride.trajectory.qd - half * slope
    late[0] = ride.trajectory.qd[0]
    detected = bool(ride.altered(qd=late).mismatch(["qd"]))
    return make_check(
        f"rates on {ride.motion.name}",
        "its rates are the derivatives of its coordinates",
        [*wrong, *_explain_rates(ride)] if wrong else [],
        [_describe_sensitivity("rates", half, detected)],
        "error of the start, step_noise and four times the error of the coordinates themselves, by quadrature",
    )


def _format_lag(lag: float) -> str:
    return f"{abs(lag):.3g} s {'late' if lag > 0 else 'early'}"


def _describe_sensitivity(what: str, lag: float, detected: bool) -> str:
    if detected:
        return f"{what} half a step late, by {lag:.3g} s, would have been detected"
    return f"{what} half a step late, by {lag:.3g} s, could not have been detected: its own error is not smaller"


def _find_lag(ride: Ride) -> float | None:
    given, expected, time = ride.q, ride.exact.q, ride.trajectory.time
    if size_of((given - expected)[1:]) <= _ROOM * ride.noise * size_of(expected[1:]):
        return None
    lag, first = fit_lag(given, expected, time), fit_lag(given[:_FIRST], expected[:_FIRST], time[:_FIRST])
    return lag if lag is not None and first is not None and abs(first - lag) <= _CONSTANT * abs(lag) else None


def _explain_rates(ride: Ride) -> Iterator[str]:
    given, expected = ride.trajectory.qd, ride.exact.qd
    lag = fit_lag(given, expected, ride.trajectory.time)
    if lag is not None:
        yield f"its rates look {_format_lag(lag)}"
        return
    apart = np.sqrt(np.mean((given - expected) ** 2, axis=0))
    # The motion spreads a fault to other rates, so only the worst one and those half as wrong or more are explained.
    off = [int(i) for i in np.flatnonzero(apart >= apart.max() / 2)]
    yield from explain_numbers(given, expected, off, rate_names())
