"""What to say of a name that is none of those that there are."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST = 64  # letters; comparing longer texts takes long, and none of ours is longer


def closest_name(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that a misspelt one is most like, or None if it is like none.

    Parameters
    ----------
    name : str
    known : iterable of str
        Upper and lower case are not told apart.
    """
    if len(name) > _LONGEST:
        return None
    by_lower = {other.lower(): other for other in known}
    found = get_close_matches(name.lower(), by_lower, n=1)
    return by_lower[found[0]] if found else None


def suggest_name(name: str, known: Iterable[str]) -> str:
    """Say which known name may be meant, or which there are if none is like it.

    Returns
    -------
    str
        ``did you mean 'exudyn'?`` or ``there are exudyn, reference``.
    """
    names = list(known)
    closest = closest_name(name, names)
    return f"there are {', '.join(names)}" if closest is None else f"did you mean {closest!r}?"
