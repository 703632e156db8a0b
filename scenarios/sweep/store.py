"""The folder of a sweep: ``sweep.json``, the journal, and the data set that is made of it when all is done."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pyarrow as pa
import pyarrow.parquet as pq

from engines.files import whole
from scenarios.error import ScenarioError
from scenarios.files import make_folder, write_json
from scenarios.stored import read_json

from .journal import finished, row_at
from .plan import Plan
from .rows import TIMING, record, schema

MANIFEST, JOURNAL, RESULTS, TIMINGS = "sweep.json", "journal.txt", "results", "timing.parquet"
_BLOCK = 20_000  # rows of a row group


def open_folder(out: Path, plan: Plan, resume: bool) -> None:
    """Make the folder of a new sweep, or see that an old one is of the same sweep.

    Raises
    ------
    ScenarioError
        If there is a sweep already, or none to resume, or another.
    """
    facts, known = plan.facts(), out / MANIFEST
    if resume:
        _same(known, _manifest(known), facts)
    elif known.exists():
        raise ScenarioError(f"{out}: holds a sweep already: go on with it by --resume, or name another folder by --out")
    else:
        make_folder(out)
        write_json(known, facts | {"title": plan.file.title, "complete": False})


def _manifest(path: Path) -> dict[str, Any]:
    try:
        found = read_json(path)
    except FileNotFoundError as error:
        raise ScenarioError(f"{path.parent}: there is no sweep to resume") from error
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{path}: is not of a sweep: {error}") from error
    if not isinstance(found, dict):
        raise ScenarioError(f"{path}: is not of a sweep")
    return found


def _same(path: Path, then: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Refuse to mix rows of two sweeps, or of two versions of anything."""
    for part in ("libraries", "engines"):
        old, new = then.get(part), now[part]
        if not isinstance(old, dict):
            raise ScenarioError(f"{path}: is not of a sweep: it has no {part}")
        for name in sorted({*old} & {*new}):
            if old[name] != new[name]:
                raise ScenarioError(
                    f"{path.parent}: was begun with {name} {old[name]}, and here is {new[name]}: "
                    "their rows do not belong together"
                )
    if then.get("hash") != now["hash"]:
        raise ScenarioError(f"{path.parent}: is of another sweep, or the file has changed; --out names another folder")


def part_of(out: Path, engine: str) -> Path:
    """The part of the data set that holds an engine's rows."""
    return out / RESULTS / f"engine={quote(engine, safe='')}" / "part-0.parquet"


def write_results(out: Path, plan: Plan) -> None:
    """Make the data set of a complete journal, sorted by key, a part an engine; and say that it is complete.

    Raises
    ------
    OSError
        If the disk is full, or the like; the journal stays, and nothing looks whole that is not.
    """
    facts = plan.facts()
    offsets = {index: offset for offset, index, _, _ in finished(out / JOURNAL)}
    columns = schema(plan.tasks)
    with (out / JOURNAL).open("rb") as journal:
        done = [(task, offsets[task.index]) for task in plan.tasks if task.index in offsets]
        for engine, version in facts["engines"].items():
            part = part_of(out, engine)
            part.parent.mkdir(parents=True, exist_ok=True)
            own = ((task, row_at(journal, offset)) for task, offset in done if task.engine == engine)
            # A run that was killed could not say its version.
            found = ({"version": version} | record(task, row, columns) for task, (_, row, _) in own)
            _write(part, columns, found)
        every = ((task, row_at(journal, offset)) for task, offset in done)
        clocks = ({"key": task.key, "index": task.index, "engine": task.engine, **time} for task, (_, _, time) in every)
        _write(out / TIMINGS, pa.schema(list(TIMING.items())), clocks)
    write_json(out / MANIFEST, facts | {"title": plan.file.title, "complete": True})


def _write(path: Path, columns: pa.Schema, records: Iterator[dict[str, Any]]) -> None:
    """Write records as Parquet, whole or not at all, without holding them all."""
    with whole(path) as partial, pq.ParquetWriter(partial, columns, compression="zstd") as writer:
        block = list(islice(records, _BLOCK))
        while block:
            writer.write_table(pa.Table.from_pylist(block, schema=columns))
            block = list(islice(records, _BLOCK))
