"""Suggestions for unknown names."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST = 64  # characters; longer texts are slow to compare, and no known name is longer


def closest_name(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that is most similar to a misspelt one, or None if none is similar.

    Parameters
    ----------
    name : str
    known : iterable of str
        The known names; case is ignored.
    """
    if len(name) > _LONGEST:
        return None
    by_lower = {other.lower(): other for other in known}
    found = get_close_matches(name.lower(), by_lower, n=1)
    return by_lower[found[0]] if found else None


def suggest_name(name: str, known: Iterable[str]) -> str:
    """Return a hint at the most similar known name, or a list of the known names if none is similar.

    Returns
    -------
    str
        ``did you mean 'exudyn'?`` or ``there are exudyn, reference``.
    """
    names = list(known)
    closest = closest_name(name, names)
    return f"there are {', '.join(names)}" if closest is None else f"did you mean {closest!r}?"
