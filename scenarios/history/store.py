"""The folder of a history: a file for each finished row, and the table, documents and pages that are made of them.

A row is written under a temporary name and renamed, with a digest of its contents, before it is reported: whatever ends
the process, a row is there whole or not at all.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ...engines.files import write_whole
from ...engines.storage import versioned_metadata
from ..error import ScenarioError
from ..files import make_folder, write_json, write_sealed, write_text
from ..locks import open_locked
from ..run import read_sealed
from .loaded import are_installed
from .pairs import PAIR_FOLDER
from .plan import PlannedRide
from .ride import NOT_INSTALLABLE, REPEATED

HISTORY_DOCUMENT, HISTORY_TABLE, HISTORY_PAGE = "history.json", "rides.parquet", "history.html"
ROWS = "rows"
_ROW_VERSION = 1


class HistoryFolder:
    """The rows of a history in a folder.

    Parameters
    ----------
    out : Path
    resume : bool
        Whether the folder already has a history.

    Raises
    ------
    ScenarioError
        If there is a history already, or none to resume, or the folder cannot be made.
    """

    def __init__(self, out: Path, resume: bool) -> None:
        self._out, self._rows = out, out / ROWS
        if resume and not self._rows.is_dir():
            raise ScenarioError(f"--out {out}: there is no history to resume")
        if not resume and self._rows.exists():
            raise ScenarioError(
                f"--out {out}: holds a history already: continue it with --resume, or name another folder by --out"
            )
        make_folder(self._rows)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Let no other process write to the folder.

        Raises
        ------
        ScenarioError
            If another one does.
        """
        try:
            file = open_locked(self._out / ".lock")
        except BlockingIOError as error:
            raise ScenarioError(f"--out {self._out}: another history is being written there") from error
        try:
            yield
        finally:
            os.close(file)

    def read(self, ride: PlannedRide) -> dict[str, Any] | None:
        """Return the row of a ride; None if there is none that holds.

        A row holds if it is whole, the release was installable, the packages that the ride loaded of the suite's
        environment are there in the same versions, and the ride was not ended by what need not be the release's fault.
        """
        try:
            found = read_sealed(self._path(ride), _ROW_VERSION)
            if found["key"] != ride.key:
                return None
            row = dict(found["row"])
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if row["status"] == NOT_INSTALLABLE or row.get(REPEATED):
            return None
        return row if are_installed(row.get("loaded", {})) else None

    def write(self, ride: PlannedRide, row: Mapping[str, Any]) -> None:
        """Store the row of a ride."""
        release = ride.release
        who = {
            "package": release.package,
            "version": release.version,
            "wheel_sha256": release.digest,
            "release": release.label,
            "engine": ride.engine,
            "scenario": ride.scenario,
            "key": ride.key,
            "ride": ride.ride,
            "comparison": ride.comparison,
        }
        write_sealed(self._path(ride), who | {"row": dict(row)}, _ROW_VERSION)

    def finish(
        self,
        document: Mapping[str, Any],
        pairs: Mapping[str, Mapping[str, Any]],
        rows: Mapping[PlannedRide, Mapping[str, Any]],
    ) -> list[Path]:
        """Write the documents, the table and the pages, and return the paths of the document, the table and the page.

        Pages of turning points that there are no more, since a release was added between, are removed.

        Parameters
        ----------
        document : mapping
            Of the history.
        pairs : mapping
            Documents of the rides of turning points, by name of the file.
        rows : mapping
            By ride.
        """
        from ...reports.page import make_history_page, make_ride_pair_page

        paths = [self._out / HISTORY_DOCUMENT, self._out / HISTORY_TABLE, self._out / HISTORY_PAGE]
        folder = self._out / PAIR_FOLDER
        for name, pair in pairs.items():
            make_folder(folder)
            write_json(folder / f"{name}.json", pair)
            write_text(folder / f"{name}.html", make_ride_pair_page(pair, f"../{HISTORY_PAGE}"))
        write_json(paths[0], document)
        _write_table(paths[1], rows)
        write_text(paths[2], make_history_page(document))
        for path in [*folder.glob("*.json"), *folder.glob("*.html")]:
            if path.stem not in pairs:
                path.unlink()
        return paths

    def _path(self, ride: PlannedRide) -> Path:
        return self._rows / f"{ride.key[:32]}.json"


@dataclass(frozen=True)
class StoredRow:
    """A row in the folder of a history.

    Attributes
    ----------
    package, version : str
        The release.
    wheel_sha256 : str or None
        Digest of the wheel; None for a release of the registry.
    engine, scenario : str
    key, ride, comparison : str
        As in `velodrome.scenarios.history.plan.PlannedRide`.
    row : dict
        By `velodrome.scenarios.history.ride.ride_release`.
    """

    package: str
    version: str
    wheel_sha256: str | None
    engine: str
    scenario: str
    key: str
    ride: str
    comparison: str
    row: dict[str, Any]


def read_stored_rows(out: Path) -> list[StoredRow]:
    """Return the rows in the folder of a history, without those that are damaged or of another format."""
    found = []
    names = [one.name for one in fields(StoredRow)]
    for path in sorted((out / ROWS).glob("[!.]*.json")):
        try:
            stored = read_sealed(path, _ROW_VERSION)
            found.append(StoredRow(**{name: stored[name] for name in names}))
        except (OSError, ValueError, KeyError, TypeError):
            continue
    return found


def _write_table(path: Path, rows: Mapping[PlannedRide, Mapping[str, Any]]) -> None:
    """Write one row per release, engine and scenario as Parquet, whole or not at all."""
    quantities = sorted({name for row in rows.values() for name in row.get("quantities", {})})
    facts = ("release", "engine", "scenario", "status", "reason", "bits")
    columns = pa.schema(
        [
            *(pa.field(name, pa.string()) for name in facts),
            *(pa.field(name, pa.float64()) for name in quantities),
            pa.field("sample_time", pa.list_(pa.float64()), metadata={b"unit": b"s"}),
            # The nine coordinates, in the order of a trajectory's columns.
            pa.field("sample_coordinates", pa.list_(pa.list_(pa.float64()))),
        ],
        metadata=versioned_metadata({}),
    )
    records = [
        {
            "release": ride.release.label,
            "engine": ride.engine,
            "scenario": ride.scenario,
            "status": row["status"],
            "reason": row["reason"],
            "bits": row.get("bits"),
            **row.get("quantities", {}),
            "sample_time": row.get("samples", {}).get("time"),
            "sample_coordinates": row.get("samples", {}).get("q"),
        }
        for ride, row in rows.items()
    ]
    with write_whole(path) as partial:
        pq.write_table(pa.Table.from_pylist(records, schema=columns), partial, compression="zstd")
