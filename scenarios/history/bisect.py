"""Find the releases that moved something by riding as few releases as possible."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from .plan import HistoryPlan, PlannedRide
from .releases import Release
from .ride import NOT_INSTALLABLE
from .verdicts import judge_step

Rows = Mapping[PlannedRide, Mapping[str, Any]]
RideReleases = Callable[[Sequence[PlannedRide]], Rows]


def bisect_history(plan: HistoryPlan, ride: RideReleases) -> dict[PlannedRide, Mapping[str, Any]]:
    """Ride the first and the last release, and halve every interval between releases whose rides differ.

    Of an interval only those engines and scenarios are ridden on that differ between its ends. A release that is not
    installable is replaced by its neighbour, the first and the last by the nearest towards the other. Where two moves
    within an interval cancel, neither is found; nor is anything between two ends of which neither rides.

    Parameters
    ----------
    plan : HistoryPlan
    ride : callable
        Rides what it is given and returns the rows.

    Returns
    -------
    dict
        Rows of all rides that were needed.
    """
    rows: dict[PlannedRide, Mapping[str, Any]] = {}
    by_place = {(one.release, one.engine, one.scenario): one for one in plan.rides}
    pairs = [(engine, scenario) for scenario in plan.scenarios for engine in plan.engines]

    def at(place: int, which: Sequence[tuple[str, str]]) -> list[PlannedRide]:
        return [by_place[plan.releases[place], engine, scenario] for engine, scenario in which]

    def take(rides: Sequence[PlannedRide]) -> None:
        missing = [one for one in rides if one not in rows]
        rows.update(ride(missing) if missing else {})

    first, last = 0, len(plan.releases) - 1
    take([*at(first, pairs), *at(last, pairs)])
    # Both ends at once, so that two releases can ride at the same time.
    while first < last and (_is_missing(rows, plan.releases[first]) or _is_missing(rows, plan.releases[last])):
        first += _is_missing(rows, plan.releases[first])
        last -= first < last and _is_missing(rows, plan.releases[last])
        take([*at(first, pairs), *at(last, pairs)])
    gaps = [(first, last, pairs)]
    while gaps:
        halves: list[tuple[int, int, int, list[tuple[str, str]]]] = []
        for low, high, which in gaps:
            ends = zip(at(low, which), at(high, which), which, strict=True)
            differing = [pair for before, after, pair in ends if _differ(rows[before], rows[after])]
            # From the middle outwards, past releases that are known not to be installable.
            inside = sorted(range(low + 1, high), key=lambda place: (abs(2 * place - low - high), place))
            middle = next((place for place in inside if not _is_missing(rows, plan.releases[place])), None)
            if differing and middle is not None:
                halves.append((low, middle, high, differing))
        # All intervals of one level at once, so that several releases can ride at the same time.
        take([one for _, middle, _, which in halves for one in at(middle, which)])
        gaps = []
        for low, middle, high, which in halves:
            if _is_missing(rows, plan.releases[middle]):
                gaps.append((low, high, which))
            else:
                gaps += [(low, middle, which), (middle, high, which)]
    return {one: rows[one] for one in plan.rides if one in rows}


def _differ(before: Mapping[str, Any], after: Mapping[str, Any]) -> bool:
    verdict = judge_step(before, after)
    return verdict is not None and verdict.moved


def _is_missing(rows: Rows, release: Release) -> bool:
    return any(ride.release == release and row["status"] == NOT_INSTALLABLE for ride, row in rows.items())
