"""The timelines of a recording."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import rerun as rr

from ...engines.engine import Trajectory
from ..drawing import to_nanoseconds


class Clock:
    """Timelines of a recording: ``time``, and ``step``, the index of a sample among the samples of all engines.

    Parameters
    ----------
    trajectories : iterable of Trajectory

    Attributes
    ----------
    times : ndarray of int
        Times of the samples of all engines [ns], rising, each once.
    """

    def __init__(self, trajectories: Iterable[Trajectory]) -> None:
        self.times = np.unique(np.concatenate([to_nanoseconds(run.time) for run in trajectories]))

    def columns(self, time: np.ndarray) -> list[rr.TimeColumn]:
        """Return the index columns of samples at times [s]."""
        exact = to_nanoseconds(time)
        return [
            rr.TimeColumn("time", duration=exact.astype("timedelta64[ns]")),
            rr.TimeColumn("step", sequence=np.searchsorted(self.times, exact)),
        ]
