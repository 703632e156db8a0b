"""What is read back of a run folder; a file that is missing or damaged makes one line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from ...engines.format_version import VERSION_KEY, read_version
from ...engines.storage import read_trajectory
from ..error import ScenarioError
from ..files import DIGEST_KEY, content_digest, file_digest
from ..scenario import Scenario, load_scenario, show_value
from .folder import RUN_VERSION, SCENARIO_DIGEST_KEY, SCENARIO_FILE


def find_part(folder: Path, name: str) -> Path:
    """A file of a run folder, which must be there.

    Raises
    ------
    ScenarioError
        If it is not, or the name leads elsewhere.
    """
    if Path(name).name != name:
        raise ScenarioError(f"{folder}: {show_value(repr(name))} is no name of a file in it")
    if not folder.is_dir():
        raise ScenarioError(f"{folder}: no such folder; velodrome run writes one and says where")
    if not (folder / name).is_file():
        raise ScenarioError(f"{folder}: not the folder of a finished run: it has no {show_value(name)}")
    return folder / name


def read_document(folder: Path, name: str) -> Mapping[str, Any]:
    """A JSON object of a run folder, without its version and its digest.

    Folders of before there were versions have neither and are read as they stand.

    Raises
    ------
    ScenarioError
        If it is missing, cannot be read, is something else, of a newer format, or was changed since it was written.
    """
    path = find_part(folder, name)
    try:
        found = read_json(path)
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ScenarioError(f"{path}: not a JSON document: {' '.join(str(error).split())}") from error
    if not isinstance(found, dict):
        raise ScenarioError(f"{path}: not a JSON object")
    try:
        version = read_version(found, RUN_VERSION)
    except ValueError as error:
        raise ScenarioError(f"{path}: {error}") from error
    sealed = version > 1 or DIGEST_KEY in found
    if sealed and found.get(DIGEST_KEY) != content_digest(found):
        raise ScenarioError(
            f"{path}: was changed since it was written: its contents do not match their digest; "
            "run the scenario again, or take the folder from where it is whole"
        )
    return {key: value for key, value in found.items() if key not in (VERSION_KEY, DIGEST_KEY)}


def read_stored_scenario(folder: Path, manifest: Mapping[str, Any]) -> Scenario:
    """Return the scenario of a run folder.

    Raises
    ------
    ScenarioError
        If it is missing, invalid, or was changed since it was written.
    """
    check_stored_scenario(folder, manifest)
    return load_scenario(str(folder / SCENARIO_FILE))[1]


def check_stored_scenario(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Compare the scenario file of a run folder with its digest in the manifest.

    Manifests of earlier versions have no digest of it; nothing is compared then.

    Raises
    ------
    ScenarioError
        If it is missing, or was changed since it was written.
    """
    path = find_part(folder, SCENARIO_FILE)
    if SCENARIO_DIGEST_KEY not in manifest:
        return
    try:
        found = file_digest(path)
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from error
    if found != manifest[SCENARIO_DIGEST_KEY]:
        raise ScenarioError(
            f"{path}: was changed since the run was made: it does not match its digest in manifest.json; "
            "undo the change, or give a changed copy to velodrome run"
        )


def read_json(path: Path) -> Any:
    """A JSON document as `velodrome.scenarios.files.write_json` writes them.

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        If it is none: also where it has numbers or letters that JSON or UTF-8 have not.
    """

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is no number of JSON")

    try:
        found = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
        # Half of a pair of surrogates can be written in JSON, and nowhere else.
        json.dumps(found, ensure_ascii=False).encode("utf-8")
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    return found


def read_start_state(manifest: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and rates at the start of a stored run, shapes (9,).

    Raises
    ------
    KeyError, TypeError, ValueError
        If the manifest does not have them.
    """
    q, qd = (np.array(manifest["start"][key], float) for key in ("q", "qd"))
    if q.shape != (9,) or qd.shape != (9,):
        raise ValueError("a start has nine coordinates and nine rates")
    return q, qd


def read_ride(folder: Path, manifest: Mapping[str, Any], metrics: Mapping[str, Any], engine: str) -> Trajectory:
    """An engine's trajectory of a run folder, which must be the one that the other files tell of.

    Raises
    ------
    ScenarioError
        If it is missing, or of another engine or another run.
    ValueError
        If it is no trajectory.
    """
    path = find_part(folder, f"{engine}.parquet")
    found = read_trajectory(path)
    entries = {"manifest.json": manifest["engines"][engine], "metrics.json": metrics[engine]}
    if found.engine != engine:
        raise ScenarioError(f"{path}: is a trajectory of {show_value(repr(found.engine))}")
    for name, entry in entries.items():
        # No two runs take the same CPU time to the last digit.
        if (entry["cpu_time"], entry["steps"]) != (found.cpu_time, found.steps):
            raise ScenarioError(f"{path}: is of another run than {name}")
    return found
