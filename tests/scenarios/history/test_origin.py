"""Which release moved a quantity, as stored histories know it, and where they must not be believed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mill import CIRCLE

from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.gate import Verdict
from velodrome.scenarios.history import HistoryFolder, PlannedRide, find_stored_histories, name_origins
from velodrome.scenarios.history.problems import prepare_ride
from velodrome.scenarios.history.releases import Release
from velodrome.scenarios.history.wheels import WheelFile

ENGINE, LIMIT = "mill", 0.1
# Errors of the releases: it moves with 1.2, by less than the limit with 1.1 and 1.3.
ERRORS = {"1.0": 1.0, "1.1": 1.01, "1.2": 2.0, "1.3": 2.01}
TOLD = "moved with mill 1.2 (after 1.1), by the history of 1.0 to 1.3"


def entry(version: str, error: float, **changes: Any) -> dict[str, Any]:
    return {"version": version, "settings": {"step": 0.001}, "quantities": {"max_gap": error}} | changes


def row(version: str, error: float, **changes: Any) -> dict[str, Any]:
    rode = {"status": "rode", "reason": None, "bits": str(error), "limits": {"max_gap": LIMIT}, "reasons": {}}
    return entry(version, error) | rode | changes


class Told:
    """What is told of a move between two releases, with histories in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.source = str(folder / "circle.toml")
        Path(self.source).write_text(CIRCLE, encoding="utf-8")
        self.ride = prepare_ride(self.source)

    def store(self, rows: dict[str, dict[str, Any]], name: str = "one", **changes: Any) -> None:
        """Write a history."""
        planned = {"ride": self.ride.identify_for(ENGINE), "comparison": "now", "wheel": None} | changes
        wheel = planned.pop("wheel")
        history = HistoryFolder(self.folder / "history" / name, resume=False)
        for number, (version, found) in enumerate(rows.items()):
            files = () if wheel is None else (WheelFile("mill", version, wheel, "0" * 64),)
            release = Release("mill", version, files)
            key = f"{number:032d}"
            history.write(PlannedRide(release, ENGINE, "circle", key, **planned), found)

    def read(self, before: dict[str, Any], after: dict[str, Any], status: str = "worse") -> str | None:
        """Return the origin of the move between two entries."""
        first, second = before["quantities"]["max_gap"], after["quantities"]["max_gap"]
        verdicts = [("circle", Verdict(ENGINE, "max_gap", second, first, LIMIT, status, "it moved"))]
        histories = find_stored_histories(self.folder / "history", named=True)
        entries = [{"circle": {ENGINE: one}} for one in (before, after)]
        ((_, verdict),) = name_origins(verdicts, [self.source], entries[0], entries[1], histories)
        start, _, origin = verdict.reason.partition("; ")
        assert start == "it moved"
        return origin or None


@pytest.fixture
def told(tmp_path: Path) -> Told:
    return Told(tmp_path)


ALL = {version: row(version, error) for version, error in ERRORS.items()}
FIRST, LAST = entry("1.0", 1.0), entry("1.3", 2.01)


def test_the_release_is_named_in_either_direction(told: Told) -> None:
    told.store(ALL)
    assert told.read(FIRST, LAST) == TOLD
    assert told.read(LAST, FIRST, "better") == TOLD
    # What round-off may do to the values does not matter.
    assert told.read(entry("1.0", 1.0 + 0.9 * LIMIT), LAST) == TOLD
    assert told.read(FIRST, LAST, "holds") is None


def test_what_the_history_does_not_know_is_not_told(told: Told) -> None:
    told.store(ALL)
    for before, after in (
        (entry("0.9", 1.0), LAST),  # a release outside it
        (FIRST, entry("1.4", 2.01)),
        (entry("1.0", 1.2), LAST),  # another value than it has
        (FIRST, entry("1.3", 2.2)),
        (entry("1.0", 1.0, settings={"step": 0.002}), LAST),
        (entry("1.3", 1.0), LAST),  # the same version
    ):
        assert told.read(before, after) is None, (before, after)


@pytest.mark.parametrize("changes", [{"ride": "another"}, {"wheel": Path("mill-1.0-py3-none-any.whl")}])
def test_other_rides_and_builds_do_not_count(told: Told, changes: dict[str, Any]) -> None:
    told.store(ALL, **changes)
    assert told.read(FIRST, LAST) is None


def test_rows_of_another_suite_are_not_mixed_and_the_finer_history_tells_more(told: Told) -> None:
    told.store({version: ALL[version] for version in ("1.0", "1.1")}, "a", comparison="then")
    told.store({version: ALL[version] for version in ("1.2", "1.3")}, "b")
    assert told.read(FIRST, LAST) is None
    told.store({version: ALL[version] for version in ("1.0", "1.3")}, "c", comparison="later")
    assert told.read(FIRST, LAST) == "moved with mill 1.3 (after 1.0), by the history of 1.0 to 1.3"
    told.store(ALL, "d", comparison="now and then")
    assert told.read(FIRST, LAST) == TOLD


def test_a_release_that_did_not_ride_is_passed_over(told: Told) -> None:
    failed = {"status": "failed", "reason": "it broke"}
    told.store(ALL | {"1.1": failed})
    assert told.read(FIRST, LAST) == "moved with mill 1.2 (after 1.0), by the history of 1.0 to 1.3"


def test_two_moves_are_both_named(told: Told) -> None:
    told.store(ALL | {"1.3": row("1.3", 3.0)})
    moved = "moved with mill 1.2 (after 1.1) and 1.3 (after 1.2), by the history of 1.0 to 1.3"
    assert told.read(FIRST, entry("1.3", 3.0)) == moved


def test_releases_that_the_engines_version_does_not_tell_apart_are_not_named(told: Told) -> None:
    told.store({version: row("2.0" if version > "1.0" else "1.0", ERRORS[version]) for version in ERRORS})
    assert told.read(FIRST, entry("2.0", 2.01)) is None


def test_a_damaged_row_is_no_row(told: Told) -> None:
    told.store(ALL)
    path = sorted((told.folder / "history" / "one" / "rows").glob("*.json"))[-1]
    path.write_text(path.read_text(encoding="utf-8").replace("2.01", "2.02"), encoding="utf-8")
    assert told.read(FIRST, LAST) is None


def test_a_folder_that_is_named_must_hold_a_history(tmp_path: Path) -> None:
    assert find_stored_histories(tmp_path / "absent", named=False) == []
    with pytest.raises(ScenarioError, match="absent: holds no history"):
        find_stored_histories(tmp_path / "absent", named=True)
