"""Whether samples are of the times that they carry, and rates of the same times as coordinates.

What a check can tell depends on the engine's own error. So half a step of lag is planted in the engine's own ride, and
the check says whether it would have been told.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..measure import describe_mismatch
from .explain import explain_numbers, fit_lag, rate_names, size_of
from .report import ConformanceCheck, make_check
from .rides import Ride

_CONSTANT = 0.25  # a lag in the first samples is that of the whole ride up to this share
_FIRST = 5  # samples
_ROOM = 4.0  # of two errors of one computation, as in `velodrome.reports.measure.consistency`


def check_clock(ride: Ride) -> ConformanceCheck:
    """Check that every sample is of the time that it carries.

    A ride whose clock is wrong runs the right course at wrong times: its difference from the reference's is the
    velocity times one lag, the same from the second sample on.
    """
    half, lag = ride.step / 2, _lag(ride)
    q = ride.q.copy()
    q[1:] -= half * ride.exact.qd[1:]
    told = _lag(ride.altered(q=q)) is not None
    return make_check(
        f"clock on {ride.motion.name}",
        "every sample is of the time that it carries",
        [] if lag is None else [f"its samples look {_late(lag)}, all by the same: its clock is not that of its state"],
        [_sensitivity("samples", half, told)],
        "a lag is one if it explains nine tenths of the error, the same in the first samples and over the ride",
    )


def check_rates(ride: Ride) -> ConformanceCheck:
    """Check that the rates are the derivatives of the coordinates."""
    half, wrong = ride.step / 2, [describe_mismatch(one.as_json()) for one in ride.mismatch(["qd"])]
    slope = np.gradient(ride.exact.qd, ride.trajectory.time, axis=0, edge_order=2)
    late = ride.trajectory.qd - half * slope
    late[0] = ride.trajectory.qd[0]
    told = bool(ride.altered(qd=late).mismatch(["qd"]))
    return make_check(
        f"rates on {ride.motion.name}",
        "its rates are the derivatives of its coordinates",
        [*wrong, *_explain_rates(ride)] if wrong else [],
        [_sensitivity("rates", half, told)],
        "error of the start, step_noise and four times the error of the coordinates themselves, by quadrature",
    )


def _late(lag: float) -> str:
    return f"{abs(lag):.3g} s {'late' if lag > 0 else 'early'}"


def _sensitivity(what: str, lag: float, told: bool) -> str:
    if told:
        return f"{what} half a step late, by {lag:.3g} s, would have been told"
    return f"{what} half a step late, by {lag:.3g} s, could not have been told: its own error is not smaller"


def _lag(ride: Ride) -> float | None:
    given, expected, time = ride.q, ride.exact.q, ride.trajectory.time
    if size_of((given - expected)[1:]) <= _ROOM * ride.noise * size_of(expected[1:]):
        return None
    lag, first = fit_lag(given, expected, time), fit_lag(given[:_FIRST], expected[:_FIRST], time[:_FIRST])
    return lag if lag is not None and first is not None and abs(first - lag) <= _CONSTANT * abs(lag) else None


def _explain_rates(ride: Ride) -> Iterator[str]:
    given, expected = ride.trajectory.qd, ride.exact.qd
    lag = fit_lag(given, expected, ride.trajectory.time)
    if lag is not None:
        yield f"its rates look {_late(lag)}"
        return
    apart = np.sqrt(np.mean((given - expected) ** 2, axis=0))
    # One fault spreads into the others by the motion: the worst, and what is as wrong.
    off = [int(i) for i in np.flatnonzero(apart >= apart.max() / 2)]
    yield from explain_numbers(given, expected, off, rate_names())
