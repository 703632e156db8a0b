"""Tables of a scenario file: reading, validation and messages for wrong values."""

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

# Characters of foreign text that a message quotes at most.
_LONGEST = 200


def show_value(text: str) -> str:
    """Return foreign text for use within one line: shortened, and with unprintable characters escaped."""
    if len(text) > _LONGEST:
        # Both ends are kept: a path ends with the file's name, and a message with the place.
        text = f"{text[: _LONGEST // 2]}...{text[-_LONGEST // 2 :]}"
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)


def read_toml(text: str) -> dict[str, Any]:
    """Read a TOML document.

    Raises
    ------
    ValueError
        If the text is not TOML, or is nested too deeply or too long to be read.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def set_keys(data: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of nested tables with dotted keys set.

    Parameters
    ----------
    data : mapping
        The tables, which are not changed.
    changes : mapping
        Values by dotted key.

    Raises
    ------
    ValueError
        If a key leads through a value that is not a table.
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
    """Base of all tables: unknown keys are refused, values are checked, and instances are frozen.

    All faults of a table are reported at once: values are also checked if there are unknown keys, and the value of a
    misspelt key is checked as that of the closest known key.
    """

    # Strict: neither true nor "18" is accepted as a number.
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="wrap")
    @classmethod
    def _known_keys(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        return validate_known(cls.__name__, data, cls.model_fields, handler)


class UnknownName(ValueError):
    """Raised for a name that is not one of the known names."""


UNKNOWN_NAME = "unknown_name"  # pydantic's error type for such a name


def validate_known(
    title: str,
    data: Any,
    known: Collection[str],
    validate: Callable[[Any], Validated],
    words: str = "unknown key {name} ({meant})",
) -> Validated:
    """Validate a mapping and refuse unknown names in it, with all faults in one error.

    Parameters
    ----------
    title : str
        Title of the error.
    data : Any
        Data to validate; ``validate`` refuses those that are not a mapping.
    known : collection of str
    validate : callable
        Validates the mapping without its unknown names. A misspelt name is replaced by the closest known one.
    words : str
        Message for an unknown name, with the fields ``{name}`` and ``{meant}``.

    Raises
    ------
    ValidationError
        With an error of type `UNKNOWN_NAME` for every unknown name, and the errors of ``validate``.
    """
    unknown = sorted(set(data) - set(known), key=str) if isinstance(data, Mapping) else []
    if not unknown:
        return validate(data)
    found: list[InitErrorDetails] = []
    right = {name: value for name, value in data.items() if name in known}
    for name in unknown:
        fields = {"name": show_value(repr(name)), "meant": suggest_name(str(name), known)}
        # pydantic fills the template: the user's text may contain braces.
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
    """Return an error in the form that pydantic accepts, with its message unchanged."""
    fields = {**entry.get("ctx", {}), "message": entry["msg"]}  # the message last, so that it is not overwritten
    kind = PydanticCustomError(entry["type"], "{message}", fields)  # pyright: ignore[reportArgumentType]
    return {"type": kind, "loc": entry["loc"], "input": entry["input"]}


def list_unknown(data: Mapping[str, Any], known: Collection[str]) -> list[str]:
    """Return a message for every unknown key of a mapping, with the closest known key."""
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
    """Return all values that the key ``kind`` of a table may have."""
    tables = (table.model_fields["kind"] for table in Table.__subclasses__() if "kind" in table.model_fields)
    return {value for kind in tables for value in get_args(kind.annotation)}


def _format_value(value: Any) -> str:
    try:
        return repr(value)
    except ValueError:  # an integer with more digits than Python converts to text
        return "a number of thousands of digits"
    except RecursionError:
        return "nested too deeply"


_MOST = 20  # messages in one line; a file with more faults is probably not the intended file


def join_complaints(complaints: Iterable[str]) -> str:
    """Join messages into one line, separated by ``; ``, without duplicates; from the 21st on they are only counted."""
    found = list(dict.fromkeys(complaints))
    rest = [f"and {len(found) - _MOST} more"] if len(found) > _MOST else []
    return "; ".join(found[:_MOST] + rest)


def format_validation_error(error: ValidationError) -> str:
    """Return all faults in one line, each with its place and the value found."""
    return join_complaints(list_complaints(error))


def list_complaints(error: ValidationError) -> list[str]:
    """Return all faults, each with its place and the value found."""
    return [_format_complaint(entry) for entry in error.errors()]


def error_place(entry: ErrorDetails) -> tuple[str, ...]:
    """Return the keys that lead to a fault.

    The location of a union's member also contains discriminator values; these are left out, as they are no keys of the
    file.
    """
    return tuple(str(part) for part in entry["loc"] if part not in list_kinds())


def _format_complaint(entry: ErrorDetails) -> str:
    place, found, facts = error_place(entry), entry.get("input"), entry.get("ctx", {})
    message = " ".join(_PLAIN_WORDS.get(entry["type"], entry["msg"].removeprefix("Value error, ")).split())
    if entry["type"] in ("too_short", "too_long") and facts.get("field_type") in ("Tuple", "Value"):
        count = facts["min_length"] if entry["type"] == "too_short" else facts["max_length"]
        bound = "at least" if entry["type"] == "too_short" else "at most"
        message = f"must have {bound} {count} item{'' if count == 1 else 's'}"
    left_out = isinstance(found, Mapping | BaseModel) or entry["type"] == "missing"
    if entry["type"] == UNKNOWN_NAME:
        place, left_out = place[:-1], True
    elif entry["type"] == "union_tag_invalid":
        tag, place = str(facts["tag"]), (*place, "kind")
        message = f"unknown kind {show_value(repr(tag))} ({suggest_name(tag, _find_quoted(facts['expected_tags']))})"
    elif entry["type"] == "literal_error" and isinstance(found, str):
        closest = closest_name(found, _find_quoted(facts["expected"]))
        message += "" if closest is None else f", did you mean {closest!r}?"
    where = ".".join(show_value(part) for part in place)
    value = "" if left_out else f" (it is {show_value(_format_value(found))})"
    return f"{where}: {message}{value}".lstrip(": ")


def _find_quoted(text: str) -> list[str]:
    """Return the quoted words in a message of pydantic."""
    return re.findall(r"'([^']*)'", text)
