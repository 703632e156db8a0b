"""Calls of pip: which releases a package has, and the installation of one into a folder.

Where pip looks, and how it gets there, is its own configuration's matter. All else of the configuration is set aside:
constraints, since they pin the versions of the suite's environment, and what changes where or how pip installs.
"""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from packaging.utils import canonicalize_name
from packaging.version import InvalidVersion, Version

from ..error import ScenarioError
from .children import Children

_AVAILABLE = re.compile(r"^Available versions: (.*)$", re.MULTILINE)
_LISTING_LIMIT, _INSTALLING_LIMIT = 120.0, 1800.0  # [s]
_LONGEST_REASON = 300  # characters
_CONFIGURED = re.compile(r"^(global|install|index|:env:)\.([a-z0-9-]+)=(.*)$")
_KEPT = frozenset(
    (
        *("index-url", "extra-index-url", "find-links", "no-index", "pre", "prefer-binary"),
        *("cert", "client-cert", "trusted-host", "proxy", "keyring-provider"),
        *("timeout", "default-timeout", "retries", "resume-retries", "cache-dir", "no-cache-dir"),
    )
)  # of pip's configuration: which releases there are, and how to get them


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


def install_packages(what: Sequence[str], folder: Path, children: Children) -> dict[str, str | None]:
    """Install packages or wheels into a folder, without what they depend on, and without building anything.

    Returns
    -------
    dict
        SHA-256 of the file that was installed, by canonical name of the package; None where pip does not say it.

    Raises
    ------
    PipError
        If pip fails, or does not install what it was asked for.
    """
    with tempfile.TemporaryDirectory(prefix="velodrome-pip-") as own:
        report = Path(own) / "report.json"
        options = ["--quiet", "--no-deps", "--only-binary", ":all:", "--target", str(folder), "--report", str(report)]
        _call_pip(["install", *options, *what], _INSTALLING_LIMIT, children)
        try:
            found = [_read_installed(entry) for entry in json.loads(report.read_bytes())["install"]]
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise PipError("pip does not say what it has installed; its version must be 22.2 or newer") from error
    if len(found) != len(what) or not folder.is_dir():
        raise PipError(f"pip ended without an error, but has not installed {', '.join(what)}")
    return dict(found)


def _read_installed(entry: Mapping[str, Any]) -> tuple[str, str | None]:
    archive = entry["download_info"].get("archive_info", {})
    # Older releases of pip give one hash in a text; indexes may name hashes of other kinds only.
    text = archive.get("hashes", {}).get("sha256") or archive.get("hash", "").partition("sha256=")[2]
    return canonicalize_name(entry["metadata"]["name"]), text or None


def select_pip_settings(lines: Iterable[str]) -> dict[str, str]:
    """Return environment variables for that part of pip's configuration that a release's environment may depend on.

    Parameters
    ----------
    lines : iterable of str
        Output of ``pip config list``.
    """
    settings: dict[str, dict[str, str]] = {"global": {}, "install": {}, "index": {}, ":env:": {}}
    for line in lines:
        found = _CONFIGURED.match(line)
        if found is not None and found[2] in _KEPT:
            value = " ".join(str(ast.literal_eval(found[3])).split())
            if value:  # pip passes over empty values as well
                settings[found[1]][found[2]] = value
    # The order of pip, where the installation's own values go before those of `pip index`: both must look alike.
    merged = settings["global"] | settings["index"] | settings["install"] | settings[":env:"]
    return {f"PIP_{name.upper().replace('-', '_')}": value for name, value in merged.items()}


def make_pip_environment(children: Children) -> dict[str, str]:
    """Return the environment variables with which pip is called.

    Raises
    ------
    PipError
        If pip does not tell its configuration.
    """
    bare = {name: value for name, value in os.environ.items() if not name.startswith("PIP_")}
    kept = {f"PIP_{name.upper().replace('-', '_')}" for name in _KEPT} | {"PIP_CONFIG_FILE"}
    given = tuple(sorted((name, value) for name, value in os.environ.items() if name in kept))
    own = {"PIP_NO_INPUT": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_CONFIG_FILE": os.devnull}
    return bare | _read_pip_settings(given, children) | own


@lru_cache(maxsize=4)  # asked for once by all calls of a history
def _read_pip_settings(given: tuple[tuple[str, str], ...], children: Children) -> dict[str, str]:
    bare = {name: value for name, value in os.environ.items() if not name.startswith("PIP_")}
    # Settings of its configuration files could silence the listing itself.
    loud = {"PIP_QUIET": "0", "PIP_VERBOSE": "0", "PIP_NO_INPUT": "1"}
    return select_pip_settings(
        _run_pip(["config", "list"], bare | dict(given) | loud, _LISTING_LIMIT, children).splitlines()
    )


def _call_pip(arguments: Sequence[str], limit: float, children: Children) -> str:
    """Run pip with the settings that are kept, and return what it prints."""
    return _run_pip(arguments, make_pip_environment(children), limit, children)


def _run_pip(arguments: Sequence[str], environment: Mapping[str, str], limit: float, children: Children) -> str:
    command = [sys.executable, "-P", "-m", "pip", *arguments]
    process = children.start(command, environment, with_input=False, with_errors=True)
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
    # The last error is pip's conclusion; that of a fault in pip is the last line of its traceback.
    if told and told[-1] == "Exception:":
        told = lines[-1:]
    words = (told or lines or [f"pip ended with status {status}"])[-1]
    return " ".join(words.split())[:_LONGEST_REASON]


def _is_version(text: str) -> bool:
    try:
        Version(text)
    except InvalidVersion:
        return False
    return True
