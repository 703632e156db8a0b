"""The fields of a settings model or of a file's table: unit, default and range, read from its JSON schema."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

Schema = Mapping[str, Any]


@dataclass(frozen=True)
class FieldFacts:
    """What may be written for one key.

    Attributes
    ----------
    type : str
        As JSON Schema calls it; several are separated by ``or``.
    required : bool
    default : Any
        JSON value; None for a required field, and for one that is not set by default.
    unit : str or None
        ``1`` of a pure number; None of what is no number, or where the model does not say.
    minimum, maximum : float or None
    exclusive_minimum, exclusive_maximum : float or None
        Bounds that the value must not reach.
    choices : list or None
        All values that there are; None where there are others.
    description : str
    """

    type: str
    required: bool
    default: Any
    unit: str | None
    minimum: float | None
    maximum: float | None
    exclusive_minimum: float | None
    exclusive_maximum: float | None
    choices: list[Any] | None
    description: str

    def as_json(self) -> dict[str, Any]:
        """As a document has it, with the range in words besides."""
        return asdict(self) | {"range": self.range}

    @property
    def range(self) -> str:
        """The range in words; empty where there is none."""
        if self.choices is not None:
            return "one of " + ", ".join(str(choice) for choice in self.choices)
        low = _bound("from", self.minimum, "above", self.exclusive_minimum)
        high = _bound("to" if self.minimum is not None else "at most", self.maximum, "below", self.exclusive_maximum)
        joint = " " if self.minimum is not None and self.maximum is not None else ", "
        return joint.join(part for part in (low, high) if part)


def _bound(word: str, value: float | None, exclusive_word: str, exclusive: float | None) -> str:
    if value is not None:
        return f"{word} {value!r}"
    return "" if exclusive is None else f"{exclusive_word} {exclusive!r}"


@dataclass(frozen=True)
class TableFacts:
    """A table of a file, or one kind of it.

    Attributes
    ----------
    name : str
        Dotted; empty for what stands above all tables.
    kind : str or None
        Value of its key ``kind``; None where there is no choice.
    description : str
    fields : dict
        By key.
    """

    name: str
    kind: str | None
    description: str
    fields: dict[str, FieldFacts]

    def as_json(self) -> dict[str, Any]:
        """As a document has it."""
        fields = {key: field.as_json() for key, field in self.fields.items()}
        return {"table": self.name, "kind": self.kind, "description": self.description, "fields": fields}


def list_fields(schema: Schema) -> dict[str, FieldFacts]:
    """Fields of a JSON schema of an object that are no tables, by key."""
    required = schema.get("required", ())
    found = {}
    for key, entry in schema.get("properties", {}).items():
        if not list(_find_tables(entry)) and not _is_table(entry):
            found[key] = _make_facts(entry, key in required)
    return found


def list_tables(schema: Schema, name: str = "", kind: str | None = None) -> Iterator[TableFacts]:
    """Tables of a file from its JSON schema, each before those inside it."""
    yield from _walk(schema, schema.get("$defs", {}), name, kind, str(schema.get("description", "")))


def _walk(schema: Schema, definitions: Schema, name: str, kind: str | None, description: str) -> Iterator[TableFacts]:
    yield TableFacts(name, kind, " ".join(description.split()), list_fields(schema))
    for key, entry in schema.get("properties", {}).items():
        inner = f"{name}.{key}" if name else key
        said = str(entry.get("description", ""))
        references = list(_find_tables(entry))
        for reference in references:
            table = definitions[reference.rpartition("/")[2]]
            # One of several kinds is told by its own words.
            words = table.get("description", said) if len(references) > 1 else said or table.get("description", "")
            own_kind = table.get("properties", {}).get("kind", {}).get("const")
            yield from _walk(table, definitions, inner, own_kind, words)
        if not references and _is_table(entry):
            yield from _walk(entry, definitions, inner, None, said)


def _find_tables(entry: Schema) -> Iterator[str]:
    """References to the tables that a field may be."""
    if "$ref" in entry:
        yield entry["$ref"]
    for option in (*entry.get("anyOf", ()), *entry.get("oneOf", ())):
        yield from _find_tables(option)


def _is_table(entry: Schema) -> bool:
    return "properties" in entry


def _make_facts(entry: Schema, required: bool) -> FieldFacts:
    options = [option for option in entry.get("anyOf", [entry]) if option.get("type") != "null"]
    # An optional number has its bounds inside.
    flat: dict[str, Any] = {**(options[0] if len(options) == 1 else {}), **entry}
    kinds = dict.fromkeys(str(option["type"]) for option in options if "type" in option)
    return FieldFacts(
        type=" or ".join(kinds) or "any",
        required=required,
        default=entry.get("default"),
        unit=entry.get("unit"),
        minimum=flat.get("minimum"),
        maximum=flat.get("maximum"),
        exclusive_minimum=flat.get("exclusiveMinimum"),
        exclusive_maximum=flat.get("exclusiveMaximum"),
        choices=flat.get("enum", [flat["const"]] if "const" in flat else None),
        description=" ".join(str(entry.get("description", "")).split()),
    )
