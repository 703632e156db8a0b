"""Which samples of a long ride a recording holds."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ...engines.engine import Trajectory
from ..drawing import to_nanoseconds

MOST_SAMPLES = 2500  # of a ride, if no rate is asked for: 25 s at 100 Hz; a sample of an engine takes about a kilobyte


def choose_stride(rides: Iterable[Trajectory], rate: float | None = None) -> int:
    """Choose how many samples of a ride a recording takes one of.

    Parameters
    ----------
    rides : iterable of Trajectory
        Sampled at equal intervals.
    rate : float, optional
        Largest number of samples a second [Hz]; by default the longest ride gets `MOST_SAMPLES` at most.
    """
    longest = max(rides, key=lambda ride: len(ride.time))
    intervals = len(longest.time) - 1
    if intervals < 1:
        return 1
    if rate is None:
        return max(1, math.ceil(intervals / MOST_SAMPLES))
    duration = float(longest.time[-1] - longest.time[0])
    # A rate that the samples have, up to the round-off of their times, is theirs.
    return max(1, math.ceil(intervals / duration / rate * (1 - 1e-9)))


def thin_samples(ride: Trajectory, shared: np.ndarray, stride: int) -> np.ndarray:
    """Return the indices of the samples of a ride that a recording holds: its first, its last, and every n-th.

    Parameters
    ----------
    ride : Trajectory
    shared : ndarray of int
        Times of the samples of all rides [ns], without repetition, in rising order; every n-th of these is taken, so
        that all rides are shown at the same times.
    stride : int
    """
    place = np.searchsorted(shared, to_nanoseconds(ride.time))
    chosen = place % stride == 0
    chosen[[0, -1]] = True
    return np.flatnonzero(chosen)


def describe_thinning(rides: Iterable[Trajectory], stride: int) -> str | None:
    """Say in one sentence what a recording leaves out; None if it holds every sample."""
    if stride == 1:
        return None
    longest = max(rides, key=lambda ride: len(ride.time))
    rate = (len(longest.time) - 1) / float(longest.time[-1] - longest.time[0])
    return (
        f"The recording holds every {_number(stride)} sample, {rate / stride:.4g} of {rate:.4g} a second, and curves' "
        "peaks between them; the Parquet files hold all samples."
    )


def _number(count: int) -> str:
    """Return an ordinal number."""
    ending = "th" if 10 < count % 100 < 20 else {1: "st", 2: "nd", 3: "rd"}.get(count % 10, "th")
    return f"{count}{ending}"
