"""Escaping of text from other sources for Markdown."""

from __future__ import annotations

# An underscore within a word has no meaning in Markdown, and neither has > within a line.
_SPECIAL = "\\`*|<[]"


def escape_markdown(text: str) -> str:
    """Escape a text for one line of Markdown, so that no character has a meaning."""
    return "".join(f"\\{letter}" if letter in _SPECIAL else letter for letter in make_printable(text))


def make_printable(text: str) -> str:
    """Replace control characters, which neither XML nor a single line can contain, by spaces."""
    return "".join(letter if letter.isprintable() else " " for letter in text)
