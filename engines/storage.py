"""Trajectories as Parquet files: one column per quantity, units in the columns' metadata, the rest in the schema's.

A file contains a digest of everything in it. Parquet's own checksums cover the data pages only and do not detect a
changed bit in a column's name or in the metadata.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..reference.bicycle import BODIES
from ..reference.fall import Fall
from ..reference.kinematics import COORDINATES, WHEELS
from .engine import REQUIRED, SHAPES, Trajectory
from .files import write_whole
from .format_version import VERSION_KEY, read_version

METADATA_KEY, DIGEST_KEY = b"velodrome", b"velodrome-sha256"
PARQUET_VERSION = 1  # format version of the metadata and the columns


_State = Annotated[list[float], Field(min_length=9, max_length=9)]


class _FallFacts(BaseModel):
    """The states around a fall in the schema's metadata."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    time: Annotated[list[float], Field(min_length=2, max_length=2)]
    q: Annotated[list[_State], Field(min_length=2, max_length=2)]
    qd: Annotated[list[_State], Field(min_length=2, max_length=2)]

    def make_fall(self) -> Fall:
        """Return the states as arrays."""
        return Fall(np.array(self.time), np.array(self.q), np.array(self.qd))


class _Facts(BaseModel):
    """Facts about a trajectory in the schema's metadata."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    engine: str
    version: str
    settings: dict[str, Any]
    steps: Annotated[int, Field(ge=0)]
    cpu_time: Annotated[float, Field(ge=0)]
    ended: str | None
    friction: Annotated[float, Field(ge=0)] | None
    # Files of earlier versions do not have these fields.
    unconverged_steps: Annotated[int, Field(ge=0)] | None = None
    largest_residual: Annotated[float, Field(ge=0)] | None = None
    fall: _FallFacts | None = None


STORED_FACTS = tuple(_Facts.model_fields)


def _coordinate_columns() -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    units = ["m"] * 3 + ["rad"] * 6
    positions = [(str(name), unit) for name, unit in zip(COORDINATES, units, strict=True)]
    return positions, [(f"{name}_rate", f"{unit}/s") for name, unit in positions]


def trajectory_columns() -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Yield the fields of a trajectory with their columns: (field, [(column, unit), ...]), flattened in C order."""
    positions, rates = _coordinate_columns()
    yield "time", [("time", "s")]
    yield "q", positions
    yield "qd", rates
    yield "contact_point", [(f"{w}_contact_{a}", "m") for w in WHEELS for a in "xyz"]
    yield "contact_force", [(f"{w}_force_{a}", "N") for w in WHEELS for a in "xyz"]
    yield "gap", [(f"{w}_gap", "m") for w in WHEELS]
    yield "slip", [(f"{w}_slip_{d}", "m/s") for w in WHEELS for d in ("lateral", "forward")]
    yield "kinetic_energy", [("kinetic_energy", "J")]
    yield "potential_energy", [("potential_energy", "J")]
    yield "body_position", [(f"{b}_{a}", "m") for b in BODIES for a in "xyz"]
    yield "body_quaternion", [(f"{b}_q{a}", "1") for b in BODIES for a in "wxyz"]


ROWS_PER_GROUP = 1 << 16  # 35 MB of the widest trajectory's numbers
# Neighbouring samples share their leading bytes, which compress well once they lie together. Rides hardly repeat a
# number, so dictionaries only cost memory.
_ENCODING: dict[str, Any] = {"compression": "zstd", "use_dictionary": False, "use_byte_stream_split": True}
_LONGEST_REASON = 300  # characters that are quoted of a reader's error message


def write_trajectory(trajectory: Trajectory, path: Path) -> None:
    """Write a trajectory to ``path``, whole or not at all.

    The samples are converted and written in groups of `ROWS_PER_GROUP` rows, so that a long ride needs no second copy
    of its arrays in memory.
    """
    columns = list(_list_columns(trajectory))
    facts = _collect_facts(trajectory)
    empty = _make_table(((name, values[:0], unit) for name, values, unit in columns), facts)
    metadata = empty.schema.metadata
    sealed = empty.schema.with_metadata({**metadata, DIGEST_KEY: _digest_columns(empty.schema, columns)})
    with write_whole(path) as partial, pq.ParquetWriter(partial, sealed, **_ENCODING) as writer:
        for begin in range(0, len(trajectory.time), ROWS_PER_GROUP):
            rows = slice(begin, begin + ROWS_PER_GROUP)
            group = _make_table(((name, values[rows], unit) for name, values, unit in columns), facts)
            writer.write_table(group.replace_schema_metadata(sealed.metadata))


def trajectory_table(trajectory: Trajectory) -> pa.Table:
    """Return a trajectory as a table with units; everything that is not sampled is in the schema's metadata."""
    return _make_table(_list_columns(trajectory), _collect_facts(trajectory))


def _list_columns(trajectory: Trajectory) -> Iterator[tuple[str, np.ndarray, str]]:
    """Yield name, values (n,) and unit of each column of the given fields; the values are views of the arrays."""
    for name, names in trajectory_columns():
        value = getattr(trajectory, name)
        if value is None:
            continue
        flat = np.asarray(value, float).reshape(len(trajectory.time), len(names))
        yield from ((column, flat[:, j], unit) for j, (column, unit) in enumerate(names))


def _collect_facts(trajectory: Trajectory) -> dict[str, Any]:
    facts = {key: getattr(trajectory, key) for key in STORED_FACTS}
    return facts | {"fall": None if trajectory.fall is None else trajectory.fall.as_json()}


def _digest_columns(schema: pa.Schema, columns: Iterable[tuple[str, np.ndarray, str]]) -> bytes:
    """Return the `digest` of the table of columns, of which only one is copied at a time."""
    parts = ([np.ascontiguousarray(values)] for _, values, _ in columns)
    return _digest_parts(schema, parts)


def write_columns(
    columns: Iterable[tuple[str, np.ndarray, str | None]], path: Path, facts: Mapping[str, Any], **options: Any
) -> None:
    """Write columns of one length as Parquet, whole or not at all.

    Parameters
    ----------
    columns : iterable of (str, ndarray, str or None)
        Name, values of shape (n,), unit.
    path : Path
    facts : mapping
        JSON values for the schema's metadata, to which the format version is added.
    **options
        Options of `pyarrow.parquet.write_table`.
    """
    _write_table(_make_table(columns, facts), path, **options)


def _make_table(columns: Iterable[tuple[str, np.ndarray, str | None]], facts: Mapping[str, Any]) -> pa.Table:
    fields, arrays = [], []
    for name, values, unit in columns:
        metadata = None if unit is None else {b"unit": unit.encode()}
        arrays.append(pa.array(np.ascontiguousarray(values)))
        fields.append(pa.field(name, arrays[-1].type, nullable=False, metadata=metadata))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=versioned_metadata(facts)))


def _write_table(table: pa.Table, path: Path, **options: Any) -> None:
    sealed = {**(table.schema.metadata or {}), DIGEST_KEY: digest(table)}
    with write_whole(path) as partial:
        pq.write_table(table.replace_schema_metadata(sealed), partial, **options)


def versioned_metadata(facts: Mapping[str, Any]) -> dict[bytes, bytes]:
    """Return the metadata of a Parquet schema: facts with the format version."""
    return {METADATA_KEY: json.dumps({VERSION_KEY: PARQUET_VERSION, **facts}).encode()}


def digest(table: pa.Table) -> bytes:
    """Return the SHA-256 of a table of numbers without nulls, in hexadecimal digits.

    The digest covers names, types, units, values and facts.
    """
    columns = ([chunk.to_numpy(zero_copy_only=False) for chunk in column.chunks] for column in table.columns)
    return _digest_parts(table.schema, columns)


def _digest_parts(schema: pa.Schema, columns: Iterable[Sequence[np.ndarray]]) -> bytes:
    """Return the `digest` of columns that are given as consecutive parts of their values, in the schema's order."""
    found = hashlib.sha256((schema.metadata or {}).get(METADATA_KEY, b""))
    for field, parts in zip(schema, columns, strict=True):
        unit = (field.metadata or {}).get(b"unit", b"")
        # Lengths come first, so that different divisions of the same bytes give different digests.
        heading = [field.name.encode(), str(field.type).encode(), unit]
        rows = sum(len(part) for part in parts)
        found.update(repr([rows, *(len(part) for part in heading)]).encode() + b"".join(heading))
        for part in parts:
            found.update(part.tobytes())
    return found.hexdigest().encode()


def read_trajectory(path: Path) -> Trajectory:
    """Read a trajectory from a Parquet file.

    Raises
    ------
    ValueError
        If the file is not a trajectory, is incomplete, has a newer format, or was altered since it was written. Files
        of earlier versions have no digest and are read without this check.
    """
    table = _read_table(path)
    facts = _read_facts(table, path)
    values: dict[str, Any] = {name: _read_field(table, name, names, path) for name, names in trajectory_columns()}
    time = table.column("time").to_numpy()
    if not (len(time) and np.all(np.isfinite(time)) and np.all(np.diff(time) > 0)):
        raise ValueError(f"{path} is not a trajectory: its times must be finite and rising, one or more")
    found = digest(table)
    if table.schema.metadata.get(DIGEST_KEY, found) != found:
        raise ValueError(f"{path} is not the trajectory that was written: its contents do not match their digest")
    fall = None if facts.fall is None else facts.fall.make_fall()
    return Trajectory(**facts.model_dump(exclude={"fall"}), fall=fall, **values)


def _read_table(path: Path) -> pa.Table:
    """Read the table of one Parquet file, without taking names of folders for partitions."""
    try:
        with path.open("rb") as file:
            # A worker of pyarrow's that frees a buffer of the file as the interpreter ends would abort the process.
            return pq.ParquetFile(file).read(use_threads=False)
    except OSError as error:
        reason = error.strerror or str(error)
    except (pa.ArrowException, ValueError) as error:
        reason = str(error)
    line = " ".join("".join(letter if letter.isprintable() else " " for letter in reason).split())
    raise ValueError(f"{path} cannot be read as a trajectory: {line[:_LONGEST_REASON]}")


def _read_facts(table: pa.Table, path: Path) -> _Facts:
    try:
        found = json.loads((table.schema.metadata or {})[METADATA_KEY])
        if isinstance(found, dict):
            _refuse_newer(found, path)
        return _Facts.model_validate(found)
    except _NewerFormat:
        raise
    except (KeyError, ValueError, RecursionError) as error:
        what = ""
        if isinstance(error, ValidationError):
            first = error.errors()[0]
            what = f" ({'.'.join(str(part) for part in first['loc'])}: {first['msg']})"
        raise ValueError(f"{path} is not a trajectory: its schema has no whole velodrome metadata{what}") from error


class _NewerFormat(ValueError):
    """Raised for a file whose format is newer than this version can read."""


def _refuse_newer(facts: Mapping[str, Any], path: Path) -> None:
    try:
        read_version(facts, PARQUET_VERSION)
    except ValueError as error:
        raise _NewerFormat(f"{path} cannot be read as a trajectory: {error}") from error


def _read_field(table: pa.Table, name: str, names: list[tuple[str, str]], path: Path) -> np.ndarray | None:
    """Return a field's array from its columns, or None if the field is optional and all its columns are absent."""
    counts = [table.column_names.count(column) for column, _ in names]
    if not any(counts) and name not in REQUIRED:
        return None
    for (column, _), count in zip(names, counts, strict=True):
        if count != 1:
            raise ValueError(f"{path} is not a trajectory: it has {count or 'no'} column{'s' * (count > 1)} {column}")
        found = table.column(column)
        if found.type != pa.float64() or found.null_count:
            what = f"is {found.type}" if found.type != pa.float64() else "has holes"
            raise ValueError(
                f"{path} is not a trajectory: its column {column} {what}; it must be double, without holes"
            )
    flat = np.column_stack([table.column(column).to_numpy() for column, _ in names])
    return flat.reshape(-1, *SHAPES[name])
