"""The sources of the site and what stands in them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
_BLOCK = re.compile(r"^(`{3,})(\{?[\w-]+\}?)[^\n]*\n(.*?)^\1$", re.DOTALL | re.MULTILINE)
_OPTION = re.compile(r"^:[\w-]+:.*\n", re.MULTILINE)


def source_pages() -> list[Path]:
    """Pages that are written by hand, and the README."""
    found = [path for path in DOCS.rglob("*.md") if "made" not in path.relative_to(DOCS).parts]
    return [*sorted(found), ROOT / "README.md"]


@dataclass(frozen=True)
class Block:
    """A fenced block of a page.

    Attributes
    ----------
    page : Path
    language : str
        Such as ``python``, or ``{drawn}`` for a directive.
    text : str
        Without the options of a directive.
    options : str
    """

    page: Path
    language: str
    text: str
    options: str

    @property
    def name(self) -> str:
        """Page and first line, for the name of a test."""
        line = next((line for line in self.text.splitlines() if line.strip()), "")
        return f"{self.page.relative_to(ROOT)}: {line[:40]}"


def blocks(page: Path, *languages: str) -> list[Block]:
    """Blocks of a page in some languages, in their order."""
    found = []
    for _, language, text in _BLOCK.findall(page.read_text(encoding="utf-8")):
        if language in languages:
            options = "".join(_OPTION.findall(text)) if language.startswith("{") else ""
            found.append(Block(page, language, text.removeprefix(options), options))
    return found
