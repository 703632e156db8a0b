"""The format version, which every document written by the suite contains.

The version is raised by changes that a reader of an older version would misread. A document without a version has
version 1, since it was written before versions were introduced.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

VERSION_KEY = "schema_version"


def read_version(document: Mapping[str, Any], newest: int) -> int:
    """Return the format version of a document.

    Parameters
    ----------
    document : mapping
    newest : int
        The newest version that the caller can read.

    Raises
    ------
    ValueError
        If the version is newer, or not a version. The message says what to do and is meant to follow the document's
        name and a colon.
    """
    version = document.get(VERSION_KEY, 1)
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise ValueError(f"its {VERSION_KEY} is no whole number from 1 to {newest}")
    if version > newest:
        # Python refuses to convert an integer of thousands of digits to text.
        which = f"is {version}" if version < 10**6 else "is very large"
        raise ValueError(
            f"its {VERSION_KEY} {which}, and this velodrome reads up to {newest}: it was written by a newer one; "
            "read it with that, or update this one (pip install --upgrade velodrome)"
        )
    return version
