"""The version of a document's format, which every document that leaves the suite carries.

A change that a reader of an older version would misread raises the number. A document without one is of version 1: it
was written before there were numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

VERSION_KEY = "schema_version"


def read_version(document: Mapping[str, Any], newest: int) -> int:
    """Return a document's version.

    Parameters
    ----------
    document : mapping
    newest : int
        The newest version that is read here.

    Raises
    ------
    ValueError
        If it is newer, or no version: what to do, in words that go on after the document's name and a colon.
    """
    version = document.get(VERSION_KEY, 1)
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise ValueError(f"its {VERSION_KEY} is no whole number from 1 to {newest}")
    if version > newest:
        # A number of thousands of digits cannot be written.
        which = f"is {version}" if version < 10**6 else "is very large"
        raise ValueError(
            f"its {VERSION_KEY} {which}, and this velodrome reads up to {newest}: it was written by a newer one; "
            "read it with that, or update this one (pip install --upgrade velodrome)"
        )
    return version
