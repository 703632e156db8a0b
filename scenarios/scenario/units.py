"""Units of the fields of scenario files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from ...engines.registry import preview_engine
from .schema import Scenario


@cache
def find_unit(key: str) -> str | None:
    """Return the unit of a field of a scenario or of an engine's settings.

    Parameters
    ----------
    key : str
        Dotted key, such as ``motion.rear_rate`` or ``engines.exudyn.step``.

    Returns
    -------
    str or None
        ``1`` for a ratio; None where the field has no unit, kinds of its table give it different ones, or there is no
        such field.
    """
    parts = key.split(".")
    if parts[0] == "engines" and len(parts) > 2:
        schema, parts = preview_engine(parts[1]).settings.model_json_schema(), parts[2:]
    else:
        schema = Scenario.model_json_schema()
    entries: list[Mapping[str, Any]] = [schema]
    for part in parts:
        tables = [table for entry in entries for table in _list_tables(entry, schema.get("$defs", {}))]
        entries = [table["properties"][part] for table in tables if part in table.get("properties", {})]
    units = {entry["unit"] for entry in entries if "unit" in entry}
    return units.pop() if len(units) == 1 else None


def _list_tables(entry: Mapping[str, Any], definitions: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield the tables that a field may hold, or the schema itself."""
    if "$ref" in entry:
        yield definitions[entry["$ref"].rpartition("/")[2]]
    if "properties" in entry:
        yield entry
    for option in (*entry.get("anyOf", ()), *entry.get("oneOf", ())):
        yield from _list_tables(option, definitions)
