"""The releases with which quantities moved, as stored histories know them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from packaging.version import Version

from ..error import ScenarioError
from ..gate import ABSOLUTE, CHANGES, Verdict, gated_names, load_gated
from .problems import MeasuredRide, digest_json, prepare_ride
from .ride import RODE
from .store import ROWS, StoredRow, read_stored_rows
from .verdicts import judge_step

Entries = Mapping[str, Mapping[str, Mapping[str, Any]]]  # by scenario and engine


def find_stored_histories(folder: Path, named: bool) -> list[Path]:
    """Return the folders of histories: a folder itself, or those in it.

    Parameters
    ----------
    folder : Path
    named : bool
        Whether the user named the folder, which must then hold a history.

    Raises
    ------
    ScenarioError
        If a folder that was named holds none.
    """
    found = [path for path in [folder, *sorted(folder.glob("*"))] if (path / ROWS).is_dir()]
    if named and not found:
        raise ScenarioError(f"--history {folder}: holds no history; name a folder that velodrome history has written")
    return found


def name_origins(
    verdicts: Sequence[tuple[str, Verdict]],
    sources: Sequence[str],
    before: Entries,
    after: Entries,
    histories: Iterable[Path],
) -> list[tuple[str, Verdict]]:
    """Add to what moved the releases with which it moved, where stored histories know them.

    A history counts if it rode the same: the scenario, its start, the settings and what is measured. It must have both
    the release of the baseline and the one that was judged, and have measured on them what the baseline and the gate
    have, within the quantity's limit. Builds are left out, since their versions do not order them.

    Parameters
    ----------
    verdicts : sequence of (scenario, Verdict)
    sources : sequence of str
        The scenarios, as `velodrome.scenarios.gate.check_gate` takes them.
    before, after : mapping
        Entries of the baselines and of the judged rides, by scenario and engine.
    histories : iterable of Path
        Folders of histories.

    Returns
    -------
    list of (scenario, Verdict)
        The same verdicts, some with a longer reason.
    """
    asked = {(name, verdict.engine) for name, verdict in verdicts if _may_have_origin(verdict)}
    rows = [row for folder in histories for row in read_stored_rows(folder) if (row.scenario, row.engine) in asked]
    if not rows:
        return list(verdicts)
    wanted = {row.scenario for row in rows}
    rides = {
        name: prepare_ride(source)
        for source in sources or gated_names()
        for name in [load_gated(source)[0]]
        if name in wanted
    }
    found = []
    for name, verdict in verdicts:
        if name in rides and _may_have_origin(verdict):
            entries = [kept.get(name, {}).get(verdict.engine) for kept in (before, after)]
            origin = _find_origin(verdict, rides[name], rows, entries[0], entries[1])
            if origin is not None:
                found.append((name, replace(verdict, reason=f"{verdict.reason}; {origin}")))
                continue
        found.append((name, verdict))
    return found


def _may_have_origin(verdict: Verdict) -> bool:
    return verdict.moved and verdict.quantity not in ("run", CHANGES, *ABSOLUTE)


def _find_origin(
    verdict: Verdict,
    ride: MeasuredRide,
    rows: Sequence[StoredRow],
    before: Mapping[str, Any] | None,
    after: Mapping[str, Any] | None,
) -> str | None:
    """Return the words for the releases that moved a quantity between two entries; None where no history knows."""
    if before is None or after is None or before["version"] == after["version"]:
        return None
    same = [
        row
        for row in rows
        if (row.engine, row.scenario) == (verdict.engine, ride.scenario)
        and row.ride == ride.identify_for(row.engine)
        and row.wheel_sha256 is None
        and row.row["status"] == RODE
    ]
    best: tuple[int, str] | None = None
    # Rows of one suite with one set of libraries: others may differ by more than the release.
    for comparison in sorted({row.comparison for row in same}):
        ridden = sorted((row for row in same if row.comparison == comparison), key=lambda row: Version(row.version))
        ridden = list({row.key: row for row in ridden}.values())
        ends = [_find_end(ridden, verdict, entry) for entry in (before, after)]
        if ends[0] is None or ends[1] is None:
            continue
        between = ridden[min(ends[0], ends[1]) : max(ends[0], ends[1]) + 1]
        steps = [(one, other) for one, other in pairwise(between) if _moves(one, other, verdict.quantity)]
        # The more releases, the closer together are those between which it moved.
        if steps and (best is None or len(between) > best[0]):
            best = len(between), _describe_origin(steps, ridden)
    return None if best is None else best[1]


def _find_end(ridden: Sequence[StoredRow], verdict: Verdict, entry: Mapping[str, Any]) -> int | None:
    """Return the place of the one release that an entry is of and agrees with; None if there is none."""
    places = [place for place, row in enumerate(ridden) if row.row["version"] == entry["version"]]
    if len(places) != 1:
        return None
    row = ridden[places[0]].row
    if digest_json(row["settings"]) != digest_json(entry["settings"]):
        return None
    value, stored = entry["quantities"].get(verdict.quantity), row["quantities"].get(verdict.quantity)
    if value is None or stored is None:
        return places[0] if value is stored else None
    return places[0] if abs(value - stored) <= (verdict.limit or 0.0) else None


def _moves(before: StoredRow, after: StoredRow, quantity: str) -> bool:
    verdict = judge_step(before.row, after.row)
    return verdict is not None and any(move.quantity == quantity for move in verdict.moves)


def _describe_origin(steps: Sequence[tuple[StoredRow, StoredRow]], ridden: Sequence[StoredRow]) -> str:
    moved = " and ".join(f"{after.version} (after {before.version})" for before, after in steps)
    package, first, last = ridden[0].package, ridden[0].version, ridden[-1].version
    return f"moved with {package} {moved}, by the history of {first} to {last}"
