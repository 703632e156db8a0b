"""Distance of point D between two rides over time, and the distance that round-off allows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from ...reports.measure import position_errors, to_number


@dataclass(frozen=True)
class PositionDifference:
    """Distance of D in one ride from D in the other.

    Attributes
    ----------
    samples : int
        Number of samples that are compared.
    max : float or None
        Largest distance [m]; None where a ride has no number.
    max_at : float
        Time of the largest distance [s].
    end : float or None
        Distance at the last compared sample [m].
    end_limit : float
        Distance allowed there [m].
    compared_until : float
        Time of the last compared sample [s].
    horizon : float or None
        The same, if the motion's growth leaves nothing to compare beyond; None otherwise [s].
    begins_at : float or None
        First time at which the distance is not zero [s].
    exceeds_at : float or None
        First time at which the distance is larger than allowed [s].
    """

    samples: int
    max: float | None
    max_at: float
    end: float | None
    end_limit: float
    compared_until: float
    horizon: float | None
    begins_at: float | None
    exceeds_at: float | None

    def as_json(self) -> dict[str, Any]:
        """Return the difference as a JSON object."""
        return asdict(self)


def compare_positions(
    rides: Sequence[Trajectory], radius: float, reach: Callable[[float], float]
) -> PositionDifference:
    """Compare the positions of D in two rides.

    They are compared until one of the rides falls or ends, and at most until the allowed distance reaches the size of
    the motion.

    Parameters
    ----------
    rides : sequence of Trajectory
        The earlier and the later ride, sampled at the same times, up to their falls.
    radius : float
        Radius of the circle [m].
    reach : callable
        Allowed distance at a time [s], in radii.
    """
    distance = np.nan_to_num(position_errors(rides[1], rides[0]), nan=np.inf)
    lost = [np.isnan(ride.q[: len(distance), :3]) for ride in rides]
    if (lost[0] | lost[1]).any():
        # nan in the same places is no difference.
        distance[lost[0].any(axis=1) & (lost[0] == lost[1]).all(axis=1)] = 0.0
    allowed = np.array([radius * reach(t) for t in rides[0].time[: len(distance)].tolist()])
    samples = max(1, int(np.searchsorted(allowed, radius)))
    cut = samples < len(distance)
    distance, allowed, time = distance[:samples], allowed[:samples], rides[0].time[:samples]
    beyond, apart = np.flatnonzero(distance > allowed), np.flatnonzero(distance)
    most = int(distance.argmax())
    return PositionDifference(
        samples=samples,
        max=to_number(distance[most]),
        max_at=float(time[most]),
        end=to_number(distance[-1]),
        end_limit=float(allowed[-1]),
        compared_until=float(time[-1]),
        horizon=float(time[-1]) if cut else None,
        begins_at=float(time[apart[0]]) if len(apart) else None,
        exceeds_at=float(time[beyond[0]]) if len(beyond) else None,
    )
