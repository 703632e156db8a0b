"""The output of `velodrome --version`."""

from __future__ import annotations

import platform

from .options import ending_with


def print_versions() -> None:
    """Print the versions of the suite, of the installed engines' packages and of the libraries.

    They are read from the packages' metadata. No engine is loaded, so that broken engines cause no error.

    Raises
    ------
    ScenarioError
        If two packages announce engines with the same name.
    """
    from ...engines.registry import packages
    from ..run import installed_engines, library_versions

    names = installed_engines()
    found = library_versions()
    suite = found.pop("velodrome")
    plugins = {name: found.pop(name) for name in packages() if name in found}
    lines = [f"velodrome {suite}", f"engines: {', '.join(names)}"]
    if plugins:
        lines.append(f"packages of engines: {_list_versions(plugins)}")
    lines += [f"libraries: {_list_versions(found)}", f"Python {platform.python_version()}"]
    with ending_with(0):
        print("\n".join(lines))


def _list_versions(versions: dict[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in versions.items())
