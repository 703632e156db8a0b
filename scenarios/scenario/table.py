"""Tables of a scenario file: how they are read, and what is said of one that is wrong."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

# Letters of somebody else's text in a line: enough to find it by.
_LONGEST = 200


def show_value(text: str) -> str:
    """Text of somebody else's making as a part of one line: nothing that moves a cursor, not too long."""
    if len(text) > _LONGEST:
        # Both ends: that of a path is the file's name, that of a complaint says where.
        text = f"{text[: _LONGEST // 2]}...{text[-_LONGEST // 2 :]}"
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)


def read_toml(text: str) -> dict[str, Any]:
    """Read a TOML document.

    Raises
    ------
    ValueError
        If it is none, or nested or written at such a length that it cannot be read.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def place_error(data: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of nested tables with dotted keys set.

    Parameters
    ----------
    data : mapping
        Stays as it is.
    changes : mapping
        Dotted key to value.

    Raises
    ------
    ValueError
        If a key leads through something that is no table.
    """
    result = dict(data)
    for key, value in changes.items():
        *tables, last = key.split(".")
        here = result
        for table in tables:
            inner = here.get(table, {})
            if not isinstance(inner, Mapping):
                raise ValueError(f"{show_value(key)}: {show_value(table)} is no table")
            here[table] = dict(inner)
            here = here[table]
        here[last] = value
    return result


class Table(BaseModel):
    """Base of all tables: unknown keys are refused with the known ones, values are checked, nothing changes later."""

    # Strict: true is no number, and neither is "18".
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            refuse_unknown(data, cls.model_fields)
        return data


class UnknownName(ValueError):
    """A name that is none of those that there are: a typing error, whatever its value."""


def refuse_unknown(data: Mapping[str, Any], known: Iterable[str]) -> None:
    """Raise UnknownName with the known keys if there is another."""
    unknown = sorted(set(data) - set(known))
    if unknown:
        raise UnknownName(f"unknown key {show_value(repr(unknown[0]))}; there are {', '.join(known)}")


_PLAIN_WORDS = {
    "missing": "is missing",
    "union_tag_not_found": "kind is missing",
    "model_type": "must be a table",
    "dict_type": "must be a table",
    "model_attributes_type": "must be a table",
}


def list_kinds() -> set[str]:
    """All values that the kind of a table may have."""
    tables = (table.model_fields["kind"] for table in Table.__subclasses__() if "kind" in table.model_fields)
    return {value for kind in tables for value in get_args(kind.annotation)}


def _written(value: Any) -> str:
    try:
        return repr(value)
    except ValueError:  # an integer of more digits than Python writes
        return "a number of thousands of digits"
    except RecursionError:
        return "nested too deeply"


def format_validation_error(error: ValidationError) -> str:
    """Say the first thing wrong in one line: where, what, what came."""
    first = error.errors()[0]
    # Discriminator values appear in the location of a union's member: they are no keys of the file.
    where = ".".join(show_value(str(part)) for part in first["loc"] if part not in list_kinds())
    message = " ".join(_PLAIN_WORDS.get(first["type"], first["msg"].removeprefix("Value error, ")).split())
    came = first.get("input")
    left_out = isinstance(came, Mapping | BaseModel) or first["type"] == "missing"
    value = "" if left_out else f" (it is {show_value(_written(came))})"
    more = len(error.errors()) - 1
    return f"{where}: {message}{value}".lstrip(": ") + (f"; and {more} more" if more else "")
