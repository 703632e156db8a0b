"""Text of somebody else's making in Markdown: shown as it is."""

from __future__ import annotations

# An underscore within a word is none, and neither is > within a line.
_SIGNS = "\\`*|<[]"


def escape_markdown(text: str) -> str:
    """Text as a part of one line of Markdown, in which no letter is a sign."""
    return "".join(f"\\{letter}" if letter in _SIGNS else letter for letter in make_printable(text))


def make_printable(text: str) -> str:
    """Without control characters, which neither XML nor a line can carry."""
    return "".join(letter if letter.isprintable() else " " for letter in text)
