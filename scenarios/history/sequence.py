"""Judge the releases of one engine and scenario in their order: each step, and what moves slowly over several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .ride import NOT_INSTALLABLE, RODE
from .verdicts import QuantityMove, StepVerdict, judge_return, judge_step


@dataclass(frozen=True)
class GradualMove:
    """Quantities that moved beyond their limits over several releases, though in no single one of them.

    Attributes
    ----------
    since : int
        Place of the release from which they moved.
    moves : tuple of QuantityMove
        From that release to this one.
    """

    since: int
    moves: tuple[QuantityMove, ...]


@dataclass(frozen=True)
class ReleaseVerdict:
    """What is said of a release.

    Attributes
    ----------
    compared_with : int or None
        Place of the release that it is compared with; None for the first.
    verdict : StepVerdict or None
        None where there is nothing to compare.
    gradual : tuple of GradualMove
        One for each release from which something moved.
    """

    compared_with: int | None
    verdict: StepVerdict | None
    gradual: tuple[GradualMove, ...] = ()


def judge_sequence(rows: Sequence[Mapping[str, Any]]) -> list[ReleaseVerdict]:
    """Judge the releases of one engine and scenario, oldest first.

    A release that rides is compared with the last one that rode, so that what moved behind a release that failed is
    found; one that does not ride, with the one before it that could be installed. What no step moves beyond its limit
    is judged as well against the release with which it was last found to have moved, or the first that rode: a limit is
    how far two rides may differ by round-off, however many releases lie between them.

    Parameters
    ----------
    rows : sequence of mapping
        Of `velodrome.scenarios.history.ride.ride_release`.
    """
    found: list[ReleaseVerdict] = []
    installed: int | None = None  # places of the last release that could be installed, and of the last that rode
    rode: int | None = None
    last_moved: dict[str, int] = {}  # by quantity: place of the release since which it has not moved
    for place, row in enumerate(rows):
        if row["status"] != RODE or rode is None:
            verdict = None if installed is None else judge_step(rows[installed], row)
            found.append(ReleaseVerdict(installed, verdict))
        else:
            judge = judge_step if installed == rode else judge_return
            verdict = judge(rows[rode], row)
            last_moved |= {move.quantity: place for move in verdict.moves} if verdict is not None else {}
            found.append(ReleaseVerdict(rode, verdict, _find_gradual_moves(rows, place, last_moved, rode)))
        if row["status"] == RODE:
            rode = place
            # A quantity that there was not before starts here.
            last_moved = dict.fromkeys(row["quantities"], place) | last_moved
        if row["status"] != NOT_INSTALLABLE:
            installed = place
    return found


def _find_gradual_moves(
    rows: Sequence[Mapping[str, Any]], place: int, last_moved: dict[str, int], before: int
) -> tuple[GradualMove, ...]:
    """Return what has moved since it last did; ``last_moved`` is brought up to date."""
    found = []
    for since in sorted({*last_moved.values()} - {before, place}):
        verdict = judge_step(rows[since], rows[place])
        moves = () if verdict is None else tuple(m for m in verdict.moves if last_moved.get(m.quantity) == since)
        if moves:
            found.append(GradualMove(since, moves))
            last_moved |= {move.quantity: place for move in moves}
    return tuple(found)
