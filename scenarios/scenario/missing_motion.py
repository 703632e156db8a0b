"""What users are told where a scenario's motion does not exist, or is not found."""

from __future__ import annotations

from ...reference.missing_motion import NoSuchMotion, SearchFailed
from ..error import MissingMotionError


def describe_missing_motion(error: NoSuchMotion | SearchFailed, place: str = "") -> MissingMotionError:
    """Return the error for users of a search without a result; ``place`` precedes its message."""
    message = f"{place}{error}"
    return MissingMotionError(message, "no-such-motion" if isinstance(error, NoSuchMotion) else "search-failed")
