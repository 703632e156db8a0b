"""The folder of a sweep: ``sweep.json``, the journal, and the data set made from it when all tasks are done."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ...engines.files import write_whole
from ...engines.format_version import VERSION_KEY, read_version
from ...engines.storage import versioned_metadata
from ..error import ScenarioError
from ..files import make_folder, write_json
from ..run import read_json
from .check import canonical_text
from .journal import finished_rows, line_at
from .plan import SweepPlan
from .rows import TIMING, make_record, row_schema

MANIFEST, JOURNAL, RESULTS, TIMINGS = "sweep.json", "journal.txt", "results", "timing.parquet"
_BLOCK = 20_000  # rows of a row group
SWEEP_VERSION = 3  # of the manifest, the journal and the data set; earlier, "format" says it


@dataclass(frozen=True)
class Opened:
    """A sweep's folder after it has been opened.

    Attributes
    ----------
    key : str
        Digest of all that determines the sweep's rows, from when the sweep was started; every line of its journal
        has it.
    limits : dict
        Limits under which the existing rows were done.
    facts : dict
        What determines the rows of this session; see `SweepPlan.facts`.
    """

    key: str
    limits: dict[str, Any]
    facts: dict[str, Any]


def open_folder(out: Path, plan: SweepPlan, resume: bool) -> Opened:
    """Make the folder of a new sweep, or check that an existing one is of the same sweep.

    Raises
    ------
    ScenarioError
        If there is a sweep already, no sweep to resume, or another sweep.
    """
    facts, known = plan.facts(), out / MANIFEST
    if resume:
        then = _manifest(known)
        _same(known, then, facts)
        return Opened(then["key"], then["limits"], facts)
    if known.exists():
        raise ScenarioError(f"{out}: holds a sweep already: continue it with --resume, or name another folder by --out")
    if (out / JOURNAL).exists():
        raise ScenarioError(
            f"{out}: holds the {JOURNAL} of a sweep without its {MANIFEST}: name another folder by --out"
        )
    make_folder(out)
    opened = Opened(hashlib.sha256(canonical_text(facts).encode()).hexdigest()[:16], _limits(plan), facts)
    write_sweep_manifest(out, plan, opened, complete=False)
    return opened


def write_sweep_manifest(out: Path, plan: SweepPlan, opened: Opened, complete: bool) -> None:
    """Write what the folder's rows are of, and whether all are there."""
    found = {VERSION_KEY: SWEEP_VERSION, "key": opened.key} | opened.facts | {"limits": opened.limits}
    write_json(out / MANIFEST, found | {"title": plan.file.title, "complete": complete})


def _limits(plan: SweepPlan) -> dict[str, Any]:
    return {"time_limit": plan.file.time_limit, "memory_limit": plan.file.memory_limit}


def refuse_other_limits(out: Path, plan: SweepPlan, opened: Opened, statuses: Collection[str]) -> None:
    """Refuse to keep rows with these statuses if they could be different under the limits of the file.

    Raises
    ------
    ScenarioError
        If the file's limits are not those under which rows timed out or ran out of memory.
    """
    now = _limits(plan)
    for limit, status in (("time_limit", "timeout"), ("memory_limit", "memory")):
        then = opened.limits.get(limit)
        if then != now[limit] and status in statuses:
            raise ScenarioError(
                f"{out}: has rows of status {status} under {limit} {then!r}, but the file has {now[limit]!r}: "
                f"try them again with --retry {status}"
            )


def _manifest(path: Path) -> dict[str, Any]:
    try:
        found = read_json(path)
    except FileNotFoundError as error:
        raise ScenarioError(f"{path.parent}: there is no sweep to resume") from error
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{path}: is not of a sweep: {error}") from error
    if not isinstance(found, dict):
        raise ScenarioError(f"{path}: is not of a sweep")
    try:
        read_version(found, SWEEP_VERSION)
    except ValueError as error:
        raise ScenarioError(f"{path}: {error}") from error
    return found


def _same(path: Path, then: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Refuse to mix rows of two sweeps, or of two versions of an engine or a library."""
    for part in ("libraries", "engines"):
        old, new = then.get(part), now[part]
        if not isinstance(old, dict):
            raise ScenarioError(f"{path}: is not of a sweep: it has no {part}")
        for name in sorted({*old} & {*new}):
            if old[name] != new[name]:
                raise ScenarioError(
                    f"{path.parent}: was begun with {name} {old[name]}, but {new[name]} is installed: "
                    "their rows cannot be mixed"
                )
    version = then.get(VERSION_KEY, then.get("format"))
    if version != SWEEP_VERSION or not isinstance(then.get("limits"), dict) or "key" not in then:
        raise ScenarioError(
            f"{path.parent}: was begun by another version of velodrome, which numbered the runs otherwise; "
            "start it again in another folder by --out"
        )
    if then.get("hash") != now["hash"]:
        raise ScenarioError(f"{path.parent}: is of another sweep, or the file has changed; --out names another folder")


def part_of(out: Path, engine: str) -> Path:
    """Return the path of the part of the data set with an engine's rows."""
    return out / RESULTS / f"engine={quote(engine, safe='')}" / "part-0.parquet"


def write_results(out: Path, plan: SweepPlan, opened: Opened) -> None:
    """Write the data set of a complete journal, sorted by key, one part per engine, and mark the sweep complete.

    Raises
    ------
    OSError
        If the disk is full or another error occurs; the journal stays, and no incomplete file looks complete.
    """
    offsets = np.full(len(plan.tasks), -1)  # an array: eight bytes a row
    for offset, line in finished_rows(out / JOURNAL):
        offsets[line.index] = offset
    columns = row_schema(plan.parameters)
    engines = {engine: k for k, engine in enumerate(plan.file.engines)}
    owners = np.fromiter((engines[plan.tasks.find_engine_of(i)] for i in range(len(offsets))), np.int8, len(offsets))
    with (out / JOURNAL).open("rb") as journal:
        done = np.flatnonzero(offsets >= 0)
        for engine, version in opened.facts["engines"].items():
            part = part_of(out, engine)
            part.parent.mkdir(parents=True, exist_ok=True)
            own = (
                (plan.tasks[i], line_at(journal, int(offsets[i])))
                for i in done[owners[done] == engines[engine]].tolist()
            )
            # A run that was killed could not report its version.
            found = ({"version": version} | make_record(task, line.row, columns) for task, line in own)
            _write(part, columns, found)
        every = ((plan.tasks[i], line_at(journal, offsets[i])) for i in done.tolist())
        clocks = ({"key": task.key, "index": task.index, "engine": task.engine, **line.timing} for task, line in every)
        _write(out / TIMINGS, pa.schema(list(TIMING.items()), metadata=versioned_metadata({})), clocks)
    write_sweep_manifest(out, plan, replace(opened, limits=_limits(plan)), complete=True)


def _write(path: Path, columns: pa.Schema, records: Iterator[dict[str, Any]]) -> None:
    """Write records as Parquet, completely or not at all, without holding all of them in memory."""
    with write_whole(path) as partial, pq.ParquetWriter(partial, columns, compression="zstd") as writer:
        block = list(islice(records, _BLOCK))
        while block:
            writer.write_table(pa.Table.from_pylist(block, schema=columns))
            block = list(islice(records, _BLOCK))
