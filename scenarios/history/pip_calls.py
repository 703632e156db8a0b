"""Calls of pip: which releases a package has, and the installation of one into a folder.

Where pip looks is its own configuration's matter. Its constraints are set aside, since they pin the versions of the
suite's environment.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from packaging.version import InvalidVersion, Version

from ..error import ScenarioError
from .children import Children

_AVAILABLE = re.compile(r"^Available versions: (.*)$", re.MULTILINE)
_LISTING_LIMIT, _INSTALLING_LIMIT = 120.0, 1800.0  # [s]
_LONGEST_REASON = 300  # characters


class PipError(RuntimeError):
    """Raised if pip fails; the message is pip's own, in one line."""


def list_registry_versions(package: str, prereleases: bool, children: Children) -> list[str]:
    """Return the versions of a package that pip finds and that fit this Python and this platform.

    Raises
    ------
    PipError
        If pip finds none, or cannot ask.
    """
    pre = ["--pre"] if prereleases else []
    text = _call_pip(["--retries", "1", "index", "versions", *pre, package], _LISTING_LIMIT, children)
    found = _AVAILABLE.search(text)
    return [] if found is None else [version for version in found[1].split(", ") if _is_version(version.strip())]


def install_packages(what: Sequence[str], folder: Path, children: Children) -> None:
    """Install packages or wheels into a folder, without what they depend on, and without building anything.

    Raises
    ------
    PipError
        If pip fails.
    """
    options = ["--quiet", "--no-deps", "--only-binary", ":all:", "--target", str(folder)]
    _call_pip(["install", *options, *what], _INSTALLING_LIMIT, children)


def _call_pip(arguments: Sequence[str], limit: float, children: Children) -> str:
    """Run pip and return what it prints."""
    with tempfile.NamedTemporaryFile(prefix="velodrome-no-constraints-", suffix=".txt") as empty:
        # An empty value would leave the constraints of pip's configuration files in place.
        own = {"PIP_CONSTRAINT": empty.name, "PIP_USER": "0", "PIP_NO_INPUT": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
        command = [sys.executable, "-P", "-m", "pip", *arguments]
        process = children.start(command, os.environ | own, with_input=False, with_errors=True)
        try:
            output, errors = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired as error:
            raise PipError(f"pip did not end within {limit:g} s") from error
        finally:
            children.end(process)
    if process.returncode != 0:
        raise PipError(_describe_pip_failure(errors.decode(errors="replace"), process.returncode))
    return output.decode(errors="replace")


def _describe_pip_failure(errors: str, status: int) -> str:
    if "No module named pip" in errors:
        raise ScenarioError("pip is missing in this Python environment; install it with python -m ensurepip")
    lines = [line.strip() for line in errors.splitlines() if line.strip()]
    told = [line.partition("ERROR:")[2].strip() for line in lines if line.startswith("ERROR:")]
    # The last error is pip's conclusion.
    words = (told or lines or [f"pip ended with status {status}"])[-1]
    return " ".join(words.split())[:_LONGEST_REASON]


def _is_version(text: str) -> bool:
    try:
        Version(text)
    except InvalidVersion:
        return False
    return True
