"""The histories of releases that the documentation shows: `python -m benchmarks.release_history history/mujoco`.

Condenses what `velodrome history` has written into ``docs/histories``: every row without its figures, and the turning
points and gradual moves with theirs.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[1] / "docs" / "histories"
_ROW = (
    *("version", "release", "date", "engine", "scenario"),
    *("status", "reason", "compared_with", "since_previous", "changed"),
)
_WHOLE = ("package", "scenarios", "engines", "remarks", "turning_points", "gradual_moves", "libraries")


def condense_history(document: Mapping[str, Any], command: str, day: str) -> dict[str, Any]:
    """Return a history without the figures of its rows.

    Parameters
    ----------
    document : mapping
        As `velodrome history --json` prints it.
    command : str
        What made it.
    day : str
        On which it was ridden, ISO 8601.

    Raises
    ------
    ValueError
        If it is not complete.
    """
    if not document["complete"] or document["bisected"]:
        raise ValueError(f"the history of {document['package']} does not have all rides")
    rows = [{key: row[key] for key in _ROW} for row in document["releases"]]
    return {"command": command, "ridden_on": day} | {key: document[key] for key in _WHOLE} | {"releases": rows}


def main() -> None:
    """Condense the histories of the folders that the command line names."""
    parser = argparse.ArgumentParser(description="Condense histories of releases for the documentation.")
    parser.add_argument("folder", type=Path, help="what velodrome history has written")
    parser.add_argument("command", help="the command that wrote it, for the reader")
    options = parser.parse_args()
    path = options.folder / "history.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    day = datetime.fromtimestamp(path.stat().st_mtime, UTC).date().isoformat()
    found = condense_history(document, options.command, day)
    FOLDER.mkdir(exist_ok=True)
    rows, points = found.pop("releases"), found.pop("turning_points")
    # One line a row: a release that is added adds lines, and changes no others.
    parts = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in found.items()]
    for key, values in (("releases", rows), ("turning_points", points)):
        parts.append(f"{json.dumps(key)}: [\n  " + ",\n  ".join(json.dumps(value) for value in values) + "\n ]")
    target = FOLDER / f"{document['package']}.json"
    target.write_text("{\n " + ",\n ".join(parts) + "\n}\n", encoding="utf-8")
    print(target)


if __name__ == "__main__":
    main()
