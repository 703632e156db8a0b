"""Tables of a scenario file: how they are read, and what is said of one that is wrong."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Annotated, Any, Self, TypeVar, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    ValidationError,
    model_validator,
)
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from ...engines.names import closest_name, suggest_name

Validated = TypeVar("Validated")

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


def set_keys(data: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
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
    """Base of all tables: unknown keys are refused, values are checked, nothing changes later.

    Everything wrong with a table is told at once: values are checked beside unknown keys too, those of a misspelt
    key as if it were written as it is meant.
    """

    # Strict: true is no number, and neither is "18".
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="wrap")
    @classmethod
    def _known_keys(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        return validate_known(cls.__name__, data, cls.model_fields, handler)


class UnknownName(ValueError):
    """A name that is none of those that there are: a typing error, whatever its value."""


UNKNOWN_NAME = "unknown_name"  # pydantic's type of error of such a name


def validate_known(
    title: str,
    data: Any,
    known: Collection[str],
    validate: Callable[[Any], Validated],
    words: str = "unknown key {name} ({meant})",
) -> Validated:
    """Validate a mapping and refuse names in it that are unknown, all complaints at once.

    Parameters
    ----------
    title : str
        Of the error.
    data : Any
        What is no mapping is left to ``validate``.
    known : collection of str
    validate : callable
        Validates the mapping without unknown names. A misspelt one takes its right name.
    words : str
        What is said of an unknown name, with ``{name}`` and ``{meant}``.

    Raises
    ------
    ValidationError
        With an error of type `UNKNOWN_NAME` a name, and whatever ``validate`` finds.
    """
    unknown = sorted(set(data) - set(known), key=str) if isinstance(data, Mapping) else []
    if not unknown:
        return validate(data)
    found: list[InitErrorDetails] = []
    right = {name: value for name, value in data.items() if name in known}
    for name in unknown:
        fields = {"name": show_value(repr(name)), "meant": suggest_name(str(name), known)}
        # pydantic fills the template by itself; what is typed may have braces.
        error = PydanticCustomError(UNKNOWN_NAME, words, fields)  # pyright: ignore[reportArgumentType]
        found.append({"type": error, "loc": (str(name),), "input": data[name]})
        meant = closest_name(str(name), known)
        if meant is not None:
            right.setdefault(meant, data[name])
    try:
        validate(right)
    except ValidationError as error:
        found += [_copy_error(entry) for entry in error.errors()]
    raise ValidationError.from_exception_data(title, found)


def _copy_error(entry: ErrorDetails) -> InitErrorDetails:
    """An error as pydantic takes it back, with its message as it is."""
    fields = {**entry.get("ctx", {}), "message": entry["msg"]}  # the message last, for nothing to be filled into it
    kind = PydanticCustomError(entry["type"], "{message}", fields)  # pyright: ignore[reportArgumentType]
    return {"type": kind, "loc": entry["loc"], "input": entry["input"]}


def list_unknown(data: Mapping[str, Any], known: Collection[str]) -> list[str]:
    """Say of every key of a mapping that is unknown what is known."""
    return [
        f"unknown key {show_value(repr(name))} ({suggest_name(name, known)})" for name in sorted(set(data) - set(known))
    ]


_PLAIN_WORDS = {
    "missing": "is missing",
    "union_tag_not_found": "kind is missing",
    "model_type": "must be a table",
    "dict_type": "must be a table",
    "tuple_type": "must be a list",
    "model_attributes_type": "must be a table",
}


def refuse_other_than_list(value: Any) -> Any:
    """Return what may be a list of texts as it is; its items are validated later.

    Raises
    ------
    ValueError
        If it is no list.
    """
    if not isinstance(value, list | tuple):
        raise ValueError("must be a list of texts")
    return value


Texts = Annotated[tuple[str, ...], Field(strict=False), BeforeValidator(refuse_other_than_list)]


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


_MOST = 20  # complaints of one line; who reads more than that has another file than they think


def join_complaints(complaints: Iterable[str]) -> str:
    """Put complaints into one line, separated by ``; ``, each once; of more than 20 the rest is counted."""
    found = list(dict.fromkeys(complaints))
    rest = [f"and {len(found) - _MOST} more"] if len(found) > _MOST else []
    return "; ".join(found[:_MOST] + rest)


def format_validation_error(error: ValidationError) -> str:
    """Say everything wrong in one line: where, what, what came."""
    return join_complaints(list_complaints(error))


def list_complaints(error: ValidationError) -> list[str]:
    """Say everything wrong, each with its place: where, what, what came."""
    return [_complaint(entry) for entry in error.errors()]


def error_place(entry: ErrorDetails) -> tuple[str, ...]:
    """Keys that lead to what is wrong.

    Discriminator values appear in the location of a union's member: they are no keys of the file.
    """
    return tuple(str(part) for part in entry["loc"] if part not in list_kinds())


def _complaint(entry: ErrorDetails) -> str:
    place, came, facts = error_place(entry), entry.get("input"), entry.get("ctx", {})
    message = " ".join(_PLAIN_WORDS.get(entry["type"], entry["msg"].removeprefix("Value error, ")).split())
    if entry["type"] in ("too_short", "too_long") and facts.get("field_type") in ("Tuple", "Value"):
        count = facts["min_length"] if entry["type"] == "too_short" else facts["max_length"]
        bound = "at least" if entry["type"] == "too_short" else "at most"
        message = f"must have {bound} {count} item{'' if count == 1 else 's'}"
    left_out = isinstance(came, Mapping | BaseModel) or entry["type"] == "missing"
    if entry["type"] == UNKNOWN_NAME:
        place, left_out = place[:-1], True
    elif entry["type"] == "union_tag_invalid":
        tag, place = str(facts["tag"]), (*place, "kind")
        message = f"unknown kind {show_value(repr(tag))} ({suggest_name(tag, _quoted(facts['expected_tags']))})"
    elif entry["type"] == "literal_error" and isinstance(came, str):
        closest = closest_name(came, _quoted(facts["expected"]))
        message += "" if closest is None else f", did you mean {closest!r}?"
    where = ".".join(show_value(part) for part in place)
    value = "" if left_out else f" (it is {show_value(_written(came))})"
    return f"{where}: {message}{value}".lstrip(": ")


def _quoted(text: str) -> list[str]:
    """Words that stand in quotes in a text of pydantic's."""
    return re.findall(r"'([^']*)'", text)
