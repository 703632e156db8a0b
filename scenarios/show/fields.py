"""Fields of settings and of tables in files, with unit, default and range, read from JSON schemas."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

Schema = Mapping[str, Any]


@dataclass(frozen=True)
class FieldFacts:
    """Permitted values and meaning of one key.

    Attributes
    ----------
    type : str
        Type as named by JSON Schema; several types are separated by ``or``.
    required : bool
    default : Any
        JSON value; None for a required field, and for a field that is not set by default.
    unit : str or None
        Unit, ``1`` for a dimensionless number; None for other values, or if the model states no unit.
    minimum, maximum : float or None
    exclusive_minimum, exclusive_maximum : float or None
        Bounds that the value must not reach.
    choices : list or None
        All permitted values; None if they are not a list of choices.
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
        """Return the JSON document of the field, including the range as text."""
        return asdict(self) | {"range": self.range}

    @property
    def range(self) -> str:
        """The range as text; empty if there is none."""
        if self.choices is not None:
            return "one of " + ", ".join(str(choice) for choice in self.choices)
        low = _format_bound("from", self.minimum, "above", self.exclusive_minimum)
        high = _format_bound(
            "to" if self.minimum is not None else "at most", self.maximum, "below", self.exclusive_maximum
        )
        joint = " " if self.minimum is not None and self.maximum is not None else ", "
        return joint.join(part for part in (low, high) if part)


def _format_bound(word: str, value: float | None, exclusive_word: str, exclusive: float | None) -> str:
    if value is not None:
        return f"{word} {value!r}"
    return "" if exclusive is None else f"{exclusive_word} {exclusive!r}"


@dataclass(frozen=True)
class TableFacts:
    """A table of a file, or one kind of it.

    Attributes
    ----------
    name : str
        Dotted name; empty for the top level of the file.
    kind : str or None
        Value of its key ``kind``; None if there is only one kind.
    description : str
    fields : dict
        Fields by key.
    """

    name: str
    kind: str | None
    description: str
    fields: dict[str, FieldFacts]

    def as_json(self) -> dict[str, Any]:
        """Return the JSON document of the table."""
        fields = {key: field.as_json() for key, field in self.fields.items()}
        return {"table": self.name, "kind": self.kind, "description": self.description, "fields": fields}


def list_fields(schema: Schema) -> dict[str, FieldFacts]:
    """Return the fields of an object's JSON schema that are not tables, by key."""
    required = schema.get("required", ())
    found = {}
    for key, entry in schema.get("properties", {}).items():
        if not list(_find_tables(entry)) and not _is_table(entry):
            found[key] = _make_facts(entry, key in required)
    return found


def list_tables(schema: Schema, name: str = "", kind: str | None = None) -> Iterator[TableFacts]:
    """Yield the tables of a file from its JSON schema, each before its nested tables."""
    yield from _walk_tables(schema, schema.get("$defs", {}), name, kind, str(schema.get("description", "")))


def _walk_tables(
    schema: Schema, definitions: Schema, name: str, kind: str | None, description: str
) -> Iterator[TableFacts]:
    yield TableFacts(name, kind, " ".join(description.split()), list_fields(schema))
    for key, entry in schema.get("properties", {}).items():
        inner = f"{name}.{key}" if name else key
        field_text = str(entry.get("description", ""))
        references = list(_find_tables(entry))
        for reference in references:
            table = definitions[reference.rpartition("/")[2]]
            # If there are several kinds, each is described by its own model.
            text = (
                table.get("description", field_text)
                if len(references) > 1
                else field_text or table.get("description", "")
            )
            own_kind = table.get("properties", {}).get("kind", {}).get("const")
            yield from _walk_tables(table, definitions, inner, own_kind, text)
        if not references and _is_table(entry):
            yield from _walk_tables(entry, definitions, inner, None, field_text)


def _find_tables(entry: Schema) -> Iterator[str]:
    """Yield the references to the tables that a field may hold."""
    if "$ref" in entry:
        yield entry["$ref"]
    for option in (*entry.get("anyOf", ()), *entry.get("oneOf", ())):
        yield from _find_tables(option)


def _is_table(entry: Schema) -> bool:
    return "properties" in entry


def _make_facts(entry: Schema, required: bool) -> FieldFacts:
    options = [option for option in entry.get("anyOf", [entry]) if option.get("type") != "null"]
    # The bounds of an optional number are those of its only option.
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
