"""The errors that are raised for a user's input and for motions that are not there."""

from __future__ import annotations

from typing import Any, Literal


class ScenarioError(ValueError):
    """Raised for input that cannot be used; one line says what is wrong, where, and what would be right."""


class MissingMotionError(ScenarioError):
    """Raised where nothing is wrong with the input, but the motion that it asks for is not found.

    Parameters
    ----------
    message : str
    reason : str
        ``no-such-motion`` if the search was completed and nothing is there, ``search-failed`` if it broke off.
    """

    def __init__(self, message: str, reason: Literal["no-such-motion", "search-failed"]) -> None:
        super().__init__(message)
        self.reason: Literal["no-such-motion", "search-failed"] = reason

    def as_json(self) -> dict[str, Any]:
        """Return the JSON document that a command prints in place of its result."""
        return {"reason": self.reason, "message": str(self)}

    def __reduce__(self) -> tuple[type[MissingMotionError], tuple[str, str]]:
        """Pickle both arguments, which `Exception` does not do."""
        return type(self), (str(self), self.reason)
