"""Judge a release's ride against the one before it, by the gate's limits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from ..gate import ABSOLUTE, BELOW_NOISE, CHANGES, judge_sample
from .ride import NOT_INSTALLABLE, RODE

SAME_BITS, WITHIN_LIMITS, CHANGED, WORSE, BETTER = "same-bits", "round-off", "changed", "worse", "better"
MOVED = (CHANGED, WORSE, BETTER)
RUN = "run"  # the quantity that moved where a release rides and the one before it did not, or the opposite


@dataclass(frozen=True)
class QuantityMove:
    """A quantity that moved from one release to the next beyond its limit.

    Attributes
    ----------
    quantity : str
    before, after : float or None
    limit : float or None
        How far it may move by round-off and by what iterations leave; None where it exists in one release only.
    status : str
        `CHANGED`, `WORSE` or `BETTER`.
    """

    quantity: str
    before: float | None
    after: float | None
    limit: float | None
    status: str

    def as_json(self) -> dict[str, Any]:
        """Return the move as a JSON object."""
        return asdict(self)


@dataclass(frozen=True)
class StepVerdict:
    """Verdict on the step from one release to another.

    Attributes
    ----------
    status : str
        `SAME_BITS`, `WITHIN_LIMITS`, `BETTER` or `WORSE` where all moves that have a direction agree, else `CHANGED`.
        Where a release rides again, this is of its quantities alone.
    moves : tuple of QuantityMove
        What moved beyond its limit, and ``run`` where the release rides and the one before it did not, or the opposite.
    """

    status: str
    moves: tuple[QuantityMove, ...] = ()

    @property
    def moved(self) -> bool:
        """Whether something moved beyond its limit, or the release rides where the one before it did not."""
        return bool(self.moves)


def judge_step(before: Mapping[str, Any], after: Mapping[str, Any]) -> StepVerdict | None:
    """Judge the row of a release against that of another, of the same engine and scenario.

    Parameters
    ----------
    before, after : mapping
        Rows of `velodrome.scenarios.history.ride.ride_release`.

    Returns
    -------
    StepVerdict or None
        None where there is nothing to compare: neither rode, or one was not installable. Where only the second rode,
        it is `CHANGED`: without quantities to compare it cannot be better.
    """
    if NOT_INSTALLABLE in (before["status"], after["status"]):
        return None
    if RODE not in (before["status"], after["status"]):
        return None
    if before["status"] != after["status"]:
        status = CHANGED if after["status"] == RODE else WORSE
        return StepVerdict(status, (QuantityMove(RUN, None, None, None, status),))
    if before["bits"] == after["bits"]:
        return StepVerdict(SAME_BITS)
    moves = (*_judge_quantities(before, after), *_judge_reports(before, after))
    return StepVerdict(sum_up_moves(moves), moves) if moves else StepVerdict(WITHIN_LIMITS)


def sum_up_moves(moves: Iterable[QuantityMove]) -> str:
    """Return `BETTER` or `WORSE` where all moves that have a direction agree, else `CHANGED`."""
    directions = {move.status for move in moves} - {CHANGED}
    return directions.pop() if len(directions) == 1 else CHANGED


def judge_return(last_rode: Mapping[str, Any], after: Mapping[str, Any]) -> StepVerdict:
    """Judge a release that rides again after others did not, against the last one that rode.

    Parameters
    ----------
    last_rode, after : mapping
        Rows of two rides, as `judge_step` takes them.

    Returns
    -------
    StepVerdict
        The status is that of the quantities; the moves have ``run`` besides.
    """
    found = judge_step(last_rode, after)
    assert found is not None, "both rode"
    return replace(found, moves=(QuantityMove(RUN, None, None, None, BETTER), *found.moves))


def _judge_quantities(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[QuantityMove]:
    # The labels differ even where the versions are the same, as those of two builds may be.
    baseline = {"quantities": before["quantities"], "settings": before["settings"], "version": "before"}
    limits = after["limits"] | {name: limit for name, limit in before["limits"].items() if name not in after["limits"]}
    verdicts = judge_sample(
        "", after["quantities"], baseline, limits, after["settings"], "after", reasons=after["reasons"]
    )
    found = []
    for verdict in verdicts:
        if not verdict.moved or verdict.quantity in (CHANGES, *ABSOLUTE):
            continue
        status = verdict.status
        if status == "missing":
            # An error that rises out of the noise is worse, as one that sinks into it is better.
            risen = verdict.baseline is None and before["reasons"].get(verdict.quantity) == BELOW_NOISE
            status = WORSE if risen else CHANGED
        found.append(QuantityMove(verdict.quantity, verdict.baseline, verdict.value, verdict.limit, status))
    return found


def _judge_reports(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[QuantityMove]:
    """Judge the quantities that have limits of their own: whether they held before, and hold now."""
    found = []
    for name in ABSOLUTE:
        held, holds = (_holds_absolutely(row, name) for row in (before, after))
        if held != holds:
            first, second = before["quantities"].get(name), after["quantities"].get(name)
            found.append(QuantityMove(name, first, second, after["limits"].get(name), BETTER if holds else WORSE))
    return found


def _holds_absolutely(row: Mapping[str, Any], name: str) -> bool:
    value, limit = row["quantities"].get(name), row["limits"].get(name)
    return value is not None and limit is not None and value <= limit
