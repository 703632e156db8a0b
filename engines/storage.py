"""Trajectories as Parquet files: one column a quantity, units with the columns, the rest in the schema."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from reference.bicycle import BODIES
from reference.kinematics import COORDINATES, WHEELS

from .engine import Trajectory
from .files import whole

METADATA_KEY = b"velodrome"
FACTS = ("engine", "version", "settings", "steps", "cpu_time", "ended", "friction")
REQUIRED = ("time", "q", "qd", "body_position", "body_quaternion")


def _coordinate_columns() -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    units = ["m"] * 3 + ["rad"] * 6
    positions = [(str(name), unit) for name, unit in zip(COORDINATES, units, strict=True)]
    return positions, [(f"{name}_rate", f"{unit}/s") for name, unit in positions]


def columns() -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Fields of a trajectory with their columns: (field, [(column, unit), ...]), flattened in C order."""
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


SHAPES = {
    "contact_point": (2, 3),
    "contact_force": (2, 3),
    "slip": (2, 2),
    "body_position": (4, 3),
    "body_quaternion": (4, 4),
}
VECTORS = ("time", "kinetic_energy", "potential_energy")


def write_trajectory(trajectory: Trajectory, path: Path) -> None:
    """Write a trajectory to ``path``, whole or not at all."""
    found = []
    for name, names in columns():
        value = getattr(trajectory, name)
        if value is None:
            continue
        flat = np.asarray(value, float).reshape(len(trajectory.time), len(names))
        found += [(column, flat[:, j], unit) for j, (column, unit) in enumerate(names)]
    write_columns(found, path, {key: getattr(trajectory, key) for key in FACTS})


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
        JSON values for the schema's metadata.
    **options
        Of `pyarrow.parquet.write_table`.
    """
    fields, arrays = [], []
    for name, values, unit in columns:
        metadata = None if unit is None else {b"unit": unit.encode()}
        arrays.append(pa.array(np.ascontiguousarray(values)))
        fields.append(pa.field(name, arrays[-1].type, nullable=False, metadata=metadata))
    schema = pa.schema(fields, metadata={METADATA_KEY: json.dumps(facts).encode()})
    with whole(path) as partial:
        pq.write_table(pa.Table.from_arrays(arrays, schema=schema), partial, **options)


def read_trajectory(path: Path) -> Trajectory:
    """Read a trajectory back.

    Raises
    ------
    ValueError
        If the file is not a trajectory.
    """
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowInvalid) as error:
        raise ValueError(f"{path} cannot be read as a trajectory: {error}") from error
    try:
        facts = json.loads((table.schema.metadata or {})[METADATA_KEY])
        facts = {key: facts[key] for key in FACTS}
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} is not a trajectory: its schema has no whole velodrome metadata") from error
    values: dict[str, np.ndarray | None] = {}
    present = set(table.column_names)
    for name, names in columns():
        absent = [column for column, _ in names if column not in present]
        if absent and name in REQUIRED:
            raise ValueError(f"{path} is not a trajectory: it has no column {absent[0]}")
        if absent:
            values[name] = None
            continue
        flat = np.column_stack([table.column(column).to_numpy() for column, _ in names])
        values[name] = flat[:, 0] if name in VECTORS else flat.reshape(-1, *SHAPES.get(name, (len(names),)))
    return Trajectory(**facts, **values)  # pyright: ignore[reportArgumentType]
