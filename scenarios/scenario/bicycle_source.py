"""Bicycles that commands and scenarios name: the benchmark, a bicycle file, or another scenario's bicycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...engines.names import suggest_name
from ...reference.bicycle import Bicycle
from ..error import ScenarioError
from ..names import LIBRARY, list_library
from .bicycle_file import BicycleFile, read_bicycle_file
from .table import join_complaints, list_unknown, read_toml, show_value

BENCHMARK = "benchmark"
FILE = "file"  # key of a scenario's table [bicycle] that names a bicycle file
_OWN_NAMES = "the suite's names, z up"


def find_bicycle(source: str, folder: Path | None = None, opened: tuple[Path, ...] = ()) -> BicycleFile:
    """Find a bicycle by name, or read it from a bicycle file or a scenario.

    Parameters
    ----------
    source : str
        ``benchmark``, a bicycle file (see `read_bicycle_file`), or a scenario by library name or path.
    folder : Path, optional
        Folder that paths start from; the working folder if not given.
    opened : tuple of Path
        Scenarios that refer to this source, directly or through one another.

    Raises
    ------
    ScenarioError
        If the source cannot be found or read, or scenarios refer to one another in a circle.
    """
    if source == BENCHMARK:
        return BicycleFile(BENCHMARK, Bicycle(), convention=_OWN_NAMES)
    path = Path(source) if folder is None else folder / source
    if source in list_library():
        path = LIBRARY / f"{source}.toml"
    elif not source or (not path.suffix and not path.exists()):
        raise ScenarioError(
            f"no bicycle {show_value(repr(source))}: give {BENCHMARK}, a bicycle file (BicycleParameters or TOML), "
            f"or a scenario ({suggest_name(source, [BENCHMARK, *list_library()])})"
        )
    data = _read_scenario(path)
    if data is None:
        return read_bicycle_file(path)
    if path.resolve() in opened:
        raise ScenarioError(f"{show_value(source)}: its bicycle is taken from a scenario that takes it from this one")
    try:
        merged = insert_bicycle_file(data, path.parent, (*opened, path.resolve()))
        bicycle = _make_bicycle(merged.get("bicycle", {}))
    except ValueError as error:
        raise ScenarioError(f"{show_value(str(path))}: {error}") from error
    return BicycleFile(path.stem, bicycle, convention=_OWN_NAMES)


def _make_bicycle(table: Any) -> Bicycle:
    """Return the bicycle of a scenario's table ``[bicycle]``."""
    if not isinstance(table, Mapping):
        raise ValueError("bicycle: must be a table")
    unknown = list_unknown(table, Bicycle.__dataclass_fields__)
    if unknown:
        raise ValueError(f"bicycle: {join_complaints(unknown)}")
    return Bicycle(**table)


def _read_scenario(path: Path) -> Mapping[str, Any] | None:
    """Return the tables of a scenario file; None for any other file, whose faults are found as it is read."""
    if path.suffix != ".toml":
        return None
    try:
        data = read_toml(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return None
    return data if {"motion", "simulation"} & set(data) else None


def insert_bicycle_file(data: Mapping[str, Any], folder: Path | None, opened: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Return a scenario's tables with the key ``file`` of ``[bicycle]`` replaced by all parameters of that file.

    The table's other keys override the file's parameters.

    Parameters
    ----------
    data : mapping
        A table ``bicycle`` that is no table is left as it is: validation reports it.
    folder, opened
        As `find_bicycle` takes them; ``file`` is a path from the folder.

    Raises
    ------
    ScenarioError
        If the file cannot be read.
    """
    table = data.get("bicycle")
    if not isinstance(table, Mapping) or FILE not in table:
        return dict(data)
    source, rest = table[FILE], {key: value for key, value in table.items() if key != FILE}
    if not isinstance(source, str) or not source:
        raise ScenarioError(f"bicycle.file is {show_value(repr(source))}; it must be the path of a bicycle file")
    try:
        found = find_bicycle(source, folder, opened)
    except ScenarioError as error:
        raise ScenarioError(f"bicycle.file: {error}") from error
    return {**data, "bicycle": asdict(found.bicycle) | rest}


def name_bicycle(bicycle: Bicycle, name: str | None = None) -> dict[str, Any]:
    """Return the entries that say in a document which bicycle it is about.

    Parameters
    ----------
    bicycle : Bicycle
    name : str, optional
        Name of its file; if not given, ``benchmark`` for the benchmark bicycle, and none for another.

    Returns
    -------
    dict
        ``bicycle``, with its name or null and its parameters, and ``warnings``.
    """
    if name is None and bicycle == Bicycle():
        name = BENCHMARK
    return {"bicycle": {"name": name, "parameters": asdict(bicycle)}, "warnings": list(bicycle.warnings())}
