"""Tables of a scenario file: how they are read, and what is said of one that is wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator


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


def refuse_unknown(data: Mapping[str, Any], known: Iterable[str]) -> None:
    """Raise ValueError with the known keys if there is another."""
    unknown = sorted(set(data) - set(known))
    if unknown:
        raise ValueError(f"unknown key {unknown[0]!r}; there are {', '.join(known)}")


_PLAIN_WORDS = {
    "missing": "is missing",
    "union_tag_not_found": "kind is missing",
    "model_type": "must be a table",
    "dict_type": "must be a table",
    "model_attributes_type": "must be a table",
}


def _kinds() -> set[str]:
    """All values that the kind of a table may have."""
    kinds = (table.model_fields["kind"] for table in Table.__subclasses__() if "kind" in table.model_fields)
    return {value for kind in kinds for value in get_args(kind.annotation)}


def one_line(error: ValidationError) -> str:
    """Say the first thing wrong in one line: where, what, what came."""
    first = error.errors()[0]
    # Discriminator values appear in the location of a union's member: they are no keys of the file.
    where = ".".join(str(part) for part in first["loc"] if part not in _kinds())
    plain = _PLAIN_WORDS.get(first["type"], first["msg"].removeprefix("Value error, "))
    message = plain.replace("\n", " ")
    came = first.get("input")
    shown = "" if isinstance(came, Mapping | BaseModel) or first["type"] == "missing" else f" (it is {came!r})"
    more = len(error.errors()) - 1
    return f"{where}: {message}{shown}".lstrip(": ") + (f"; and {more} more" if more else "")
