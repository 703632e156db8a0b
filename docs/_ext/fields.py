"""Fields of pydantic models as Markdown: scenario files, sweep files and engines' settings."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

_TYPES = {
    "number": "number",
    "integer": "whole number",
    "string": "text",
    "boolean": "`true` or `false`",
    "object": "table",
}


def list_fields(model: type[BaseModel], tables: Mapping[str, str] | None = None) -> str:
    """Describe every field of a model: its type, its range, whether it must be given, its default and its meaning.

    Parameters
    ----------
    model : type of BaseModel
    tables : mapping, optional
        Heading of each model that has one of its own, by the model's name.

    Returns
    -------
    str
        A definition list.
    """
    schema = model.model_json_schema()
    required = set(schema.get("required", ()))
    known = schema.get("$defs", {})
    lines = []
    for name, field in schema.get("properties", {}).items():
        given = "required" if name in required else _default(field)
        lines += [
            f"`{name}`",
            f": {describe_type(field, known, tables or {})}{_unit(field)}; {given}",
            f": {make_sentence(_without_unit(field))}" if field.get("description") else "",
            "",
        ]
    return "\n".join(lines)


def describe_type(field: Mapping[str, Any], known: Mapping[str, Any], tables: Mapping[str, str]) -> str:
    """Type and range of a field of a JSON schema in words."""
    if "$ref" in field:
        name = field["$ref"].rpartition("/")[2]
        return tables.get(name) or describe_type(known[name], known, tables)
    if "const" in field:
        return f"`{json.dumps(field['const'])}`"
    if "enum" in field:
        return "one of " + ", ".join(f"`{json.dumps(value)}`" for value in field["enum"])
    for choice in ("anyOf", "oneOf"):
        if choice in field:
            parts = [describe_type(part, known, tables) for part in field[choice] if part.get("type") != "null"]
            return " or ".join(dict.fromkeys(parts))
    if field.get("type") == "array":
        if "prefixItems" in field:
            inner = [describe_type(part, known, tables) for part in field["prefixItems"]]
            if len(set(inner)) == 1:
                return f"list of {len(inner)}, each a {inner[0]}"
            return "list of " + ", then ".join(inner)
        return f"list, each a {describe_type(field.get('items', {}), known, tables)}"
    text = _TYPES.get(str(field.get("type")), "any value")
    return " ".join([text, *_range(field)])


def _unit(field: Mapping[str, Any]) -> str:
    unit = field.get("unit")
    return "" if unit in (None, "1") else f" [{unit}]"


def _range(field: Mapping[str, Any]) -> Iterator[str]:
    least, most = field.get("minimum"), field.get("maximum")
    above, below = field.get("exclusiveMinimum"), field.get("exclusiveMaximum")
    words = []
    if least is not None:
        words.append(f"from {least:g}")
    if above is not None:
        words.append(f"above {above:g}")
    if most is not None:
        words.append(f"to {most:g}" if least is not None else f"at most {most:g}")
    if below is not None:
        words.append(f"below {below:g}")
    if words:
        joint = " " if least is not None and most is not None else ", "
        yield joint.join(words)


def _default(field: Mapping[str, Any]) -> str:
    if "default" not in field or field["default"] in ({}, [], ""):
        return "optional"
    if field["default"] is None:
        return "may be left out"
    if isinstance(field["default"], Mapping):
        return "optional"
    return f"default `{json.dumps(field['default'])}`"


def _without_unit(field: Mapping[str, Any]) -> str:
    """A field's description without the unit that stands with its type."""
    return field["description"].replace(f" [{field['unit']}]", "", 1) if "unit" in field else field["description"]


def make_sentence(text: str) -> str:
    """A description as a sentence: in the code it may be a phrase."""
    first, _, _ = text.partition(" ")
    if len(first) > 1 or first == "a":  # another letter is a name, such as x
        text = text[:1].upper() + text[1:]
    return text if text.endswith((".", "!", "?")) else f"{text}."
