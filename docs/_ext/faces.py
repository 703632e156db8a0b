"""The reference of Python modules, from their ``__all__``."""

from __future__ import annotations

import inspect
from importlib import import_module
from types import ModuleType
from typing import Any

_SECTIONS = ("Functions", "Classes", "Errors", "Other names")


def public_names(module: ModuleType) -> list[str]:
    """Names that a module exports.

    Raises
    ------
    ValueError
        If it does not say which.
    """
    names = getattr(module, "__all__", None)
    if not names:
        raise ValueError(f"{module.__name__} has no __all__")
    return list(names)


def describe_module(name: str) -> str:
    """Markdown that has autodoc document every public name of a module, by kind."""
    module = import_module(name)
    kinds: dict[str, list[str]] = {section: [] for section in _SECTIONS}
    for public in public_names(module):
        kinds[_section(getattr(module, public))].append(public)
    parts = [f"```{{eval-rst}}\n.. automodule:: {name}\n```"]
    for section, names in kinds.items():
        if not names:
            continue
        parts.append(f"## {section}")
        for public in names:
            thing = getattr(module, public)
            parts += [f"### `{public}`", f"```{{eval-rst}}\n{_directive(name, public, thing)}\n```"]
    return "\n\n".join(parts)


def _section(thing: Any) -> str:
    if inspect.isclass(thing):
        return "Errors" if issubclass(thing, BaseException) else "Classes"
    return "Functions" if callable(thing) and hasattr(thing, "__name__") else "Other names"


def _directive(module: str, name: str, thing: Any) -> str:
    path = f"{module}.{name}"
    if inspect.ismodule(thing):
        return f".. py:module:: {path}\n   :no-index:"
    if inspect.isclass(thing):
        return f".. autoclass:: {path}\n   :members:\n   :inherited-members: BaseModel, tuple, Exception, ValueError"
    if _section(thing) == "Functions":
        return f".. autofunction:: {path}"
    return f".. autodata:: {path}"
