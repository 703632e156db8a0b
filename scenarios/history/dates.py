"""The dates of releases, as the registry gives them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Collection, Mapping
from datetime import UTC, datetime
from pathlib import Path

from packaging.utils import InvalidSdistFilename, InvalidWheelFilename, parse_sdist_filename, parse_wheel_filename
from packaging.version import InvalidVersion

from ..files import write_json
from ..run import read_json
from .children import Children, StoppedError
from .pip_calls import PipError, make_pip_environment

_PROGRAM = Path(__file__).with_name("ask_upload_times.py")
_LIMIT = 60.0  # [s]


def find_release_dates(
    package: str, versions: Collection[str], cache: Path, children: Children, *, ask: bool
) -> dict[str, str]:
    """Return the days on which releases were uploaded to the registry, UTC, ISO 8601.

    What the registry says is kept in the cache folder, where it is found without the registry.

    Parameters
    ----------
    package : str
        Canonical name.
    versions : collection of str
        Releases of the registry.
    cache : Path
        Folder of environments.
    children : Children
    ask : bool
        Whether to ask the registry for dates that the cache folder does not have.

    Returns
    -------
    dict
        By version; versions whose date is unknown are left out.
    """
    path = cache / f".dates-{package}.json"
    known = _read_dates(path)
    if ask and not {*versions} <= {*known}:
        times = _ask_upload_times(package, children)
        if times is not None:
            # A version without a date is kept as such, or every history would ask for it again.
            known = dict.fromkeys(versions) | known | dict(select_first_days(times))
            try:
                cache.mkdir(parents=True, exist_ok=True)
                write_json(path, {"dates": known})
            except OSError:
                pass  # whoever makes the environments says that the folder cannot be written
    return {version: day for version in versions if (day := known.get(version)) is not None}


def select_first_days(times: Mapping[str, str]) -> dict[str, str]:
    """Return the day of the first file of every version from upload times by file name.

    Files and times that do not have the form of the index are left out.
    """
    first: dict[str, datetime] = {}
    for name, text in times.items():
        try:
            version = str((parse_wheel_filename if name.endswith(".whl") else parse_sdist_filename)(name)[1])
            time = datetime.fromisoformat(text).astimezone(UTC)
        except (InvalidWheelFilename, InvalidSdistFilename, InvalidVersion, ValueError, TypeError):
            continue
        first[version] = min(time, first.get(version, time))
    return {version: time.date().isoformat() for version, time in first.items()}


def _read_dates(path: Path) -> dict[str, str | None]:
    try:
        found = read_json(path)["dates"]
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    if not isinstance(found, dict):
        return {}
    return {version: day for version, day in found.items() if day is None or isinstance(day, str)}


def _ask_upload_times(package: str, children: Children) -> dict[str, str] | None:
    """Return upload times by file name, or None if they cannot be asked for."""
    try:
        process = children.start(
            [sys.executable, "-P", str(_PROGRAM), package],
            make_pip_environment(children),
            with_input=False,
            with_errors=False,
        )
    except (StoppedError, PipError):
        return None
    try:
        output, _ = process.communicate(timeout=_LIMIT)
        found = json.loads(output)
    except (subprocess.TimeoutExpired, ValueError):
        return None
    finally:
        children.end(process)
    return found if isinstance(found, dict) else None
