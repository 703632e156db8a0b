"""Rooms whose names are imported when they are first used: a command needs a part of them only."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module


def import_when_used(package: str, homes: Mapping[str, Sequence[str]]) -> Callable[[str], object]:
    """Return the ``__getattr__`` of a package that imports its names when they are first used.

    Parameters
    ----------
    package : str
        The package's ``__name__``.
    homes : mapping
        The names in each of its modules, such as ``{".error": ("ScenarioError",)}``.

    Returns
    -------
    callable
    """
    home = {name: module for module, names in homes.items() for name in names}

    def find_name(name: str) -> object:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(home[name], package), name)
        setattr(sys.modules[package], name, value)
        return value

    return find_name
