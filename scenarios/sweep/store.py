"""The folder of a sweep: ``sweep.json``, the journal, and the tables of the data set."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ...engines.format_version import VERSION_KEY, read_version
from ..error import ScenarioError
from ..files import make_folder, write_json
from ..run import read_json
from .blocks import BlockTable
from .check import canonical_text
from .plan import SweepPlan
from .rows import row_schema, timing_schema

MANIFEST, JOURNAL, RESULTS, TIMINGS = "sweep.json", "journal.txt", "results", "timing.parquet"
_TIMING_BLOCKS = "timing"  # folder of the timings' blocks
STAGING = ".staging"  # folder in which files are prepared
_SWEEP = "sweep"  # in the metadata of every table: the key of the sweep
_ENDED = {"time_limit": "timeout", "memory_limit": "memory"}  # status of the rows that a limit ended
SWEEP_VERSION = 4  # of the manifest, the journal and the data set; earlier, "format" says it


@dataclass(frozen=True)
class Opened:
    """A sweep's folder after it has been opened.

    Attributes
    ----------
    key : str
        Digest of all that determines the sweep's rows, from when the sweep was started; every line of its journal
        has it.
    limits : dict
        Limits under which the existing rows were done; a list of limits where they differ.
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
    for name in (JOURNAL, RESULTS, TIMINGS, _TIMING_BLOCKS, STAGING):
        if (out / name).exists():  # its rows would become a part of this sweep's data set
            raise ScenarioError(
                f"{out}: holds the {name} of a sweep without its {MANIFEST}: name another folder by --out"
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
    for limit, status in _ENDED.items():
        then = opened.limits.get(limit)
        if then != now[limit] and status in statuses:
            raise ScenarioError(
                f"{out}: has rows of status {status} under {limit} {then!r}, but the file has {now[limit]!r}: "
                f"try them again with --retry {status}"
            )


def note_limits(plan: SweepPlan, opened: Opened, statuses: Collection[str]) -> Opened:
    """Return what is opened with the limits of the rows that a session finds and makes.

    Parameters
    ----------
    plan : SweepPlan
    opened : Opened
    statuses : collection of str
        Those of the rows that are there, also of those that are tried again.

    Returns
    -------
    Opened
        Where a limit has changed and rows are there that the earlier one ended, the limit is a list of both: the
        session may be stopped when some of those rows have been tried again, and the rest must be, too.
    """
    found: dict[str, Any] = {}
    for limit, now in _limits(plan).items():
        then = opened.limits.get(limit)
        if then != now and _ENDED[limit] in statuses:
            earlier = then if isinstance(then, list) else [then]
            found[limit] = earlier if now in earlier else [*earlier, now]
        else:
            found[limit] = now
    return replace(opened, limits=found)


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


def make_tables(out: Path, plan: SweepPlan, opened: Opened) -> dict[str, BlockTable]:
    """Return the tables of a sweep's rows by engine."""
    columns = row_schema(plan.parameters, {_SWEEP: opened.key})
    return {
        engine: BlockTable(part_of(out, engine).parent, part_of(out, engine), out / STAGING, columns)
        for engine in plan.file.engines
    }


def make_timing_table(out: Path, opened: Opened) -> BlockTable:
    """Return the table of the rows' timings."""
    return BlockTable(out / _TIMING_BLOCKS, out / TIMINGS, out / STAGING, timing_schema({_SWEEP: opened.key}))


def remove_staging(out: Path) -> None:
    """Remove the folder in which files are prepared."""
    shutil.rmtree(out / STAGING, ignore_errors=True)


def mark_complete(out: Path, plan: SweepPlan, opened: Opened) -> None:
    """Write that all rows are there, under the limits of the file."""
    write_sweep_manifest(out, plan, replace(opened, limits=_limits(plan)), complete=True)
