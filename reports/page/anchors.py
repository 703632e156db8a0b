"""Names for anchors and files that are made of text of any kind."""

from __future__ import annotations

import re

_OTHER = re.compile(r"[^A-Za-z0-9.]+")
_LONGEST = 120  # characters; a file name has at most 255 bytes


class AnchorNames:
    """Names of letters, digits, dots and hyphens, no two alike."""

    def __init__(self) -> None:
        self._taken: set[str] = set()

    def choose(self, *parts: str) -> str:
        """Return a name that tells the parts, with a number where it is taken already."""
        stem = "-".join(_OTHER.sub("-", part).strip("-.") or "x" for part in parts)[:_LONGEST]
        name, number = stem, 1
        # File systems may not tell capitals from small letters.
        while name.lower() in self._taken:
            number += 1
            name = f"{stem}-{number}"
        self._taken.add(name.lower())
        return name
