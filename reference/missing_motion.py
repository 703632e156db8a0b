"""Errors that tell a motion that does not exist from a search that broke off; both differ from bad input."""

from __future__ import annotations


class NoSuchMotion(ValueError):
    """Raised where nothing is wrong with what was asked for, and the completed search finds no such motion."""


class SearchFailed(ValueError):
    """Raised where a search broke off, so that there may be a motion that it did not find."""
