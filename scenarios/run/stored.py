"""Reading of run folders; a missing or damaged file raises an error with a one-line message."""

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
    """Return the path of an existing file of a run folder.

    Raises
    ------
    ScenarioError
        If there is no such file, or the name is a path to another folder.
    """
    if Path(name).name != name:
        raise ScenarioError(f"{folder}: {show_value(repr(name))} is no name of a file in it")
    if not folder.is_dir():
        raise ScenarioError(f"{folder}: no such folder; velodrome run writes one and says where")
    if not (folder / name).is_file():
        raise ScenarioError(f"{folder}: not the folder of a finished run: it has no {show_value(name)}")
    return folder / name


def read_document(folder: Path, name: str) -> Mapping[str, Any]:
    """Read a JSON object of a run folder, without its version and its digest.

    Files of format version 1 have neither and are read without these checks.

    Raises
    ------
    ScenarioError
        If the file is missing, cannot be read, is not a JSON object, has a newer format, or was changed since it was
        written.
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


def read_sealed(path: Path, newest: int) -> dict[str, Any]:
    """Read a JSON object as `velodrome.scenarios.files.write_sealed` writes it.

    Parameters
    ----------
    path : Path
    newest : int
        Newest version of its format that is read.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it is no JSON object, has a newer format, or was changed since it was written.
    """
    found = read_json(path)
    if not isinstance(found, dict):
        raise ValueError("not a JSON object")
    read_version(found, newest)
    if found.get(DIGEST_KEY) != content_digest(found):
        raise ValueError("its contents do not match their digest")
    return found


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
    """Read a JSON document as `velodrome.scenarios.files.write_json` writes it.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If the file is not a JSON document; this includes NaN, infinity, and characters that UTF-8 cannot encode.
    """

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is no number of JSON")

    try:
        found = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
        # JSON escapes can express unpaired surrogates, which UTF-8 cannot encode.
        json.dumps(found, ensure_ascii=False).encode("utf-8")
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    return found


def read_start_state(manifest: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinates and rates at the start of a stored run, shapes (9,) each.

    Raises
    ------
    KeyError, TypeError, ValueError
        If the manifest does not contain them.
    """
    q, qd = (np.array(manifest["start"][key], float) for key in ("q", "qd"))
    if q.shape != (9,) or qd.shape != (9,):
        raise ValueError("a start has nine coordinates and nine rates")
    return q, qd


def read_ride(folder: Path, manifest: Mapping[str, Any], metrics: Mapping[str, Any], engine: str) -> Trajectory:
    """Read an engine's trajectory of a run folder and check that it belongs to the manifest and the metrics.

    Raises
    ------
    ScenarioError
        If the file is missing, or belongs to another engine or another run.
    ValueError
        If the file is not a trajectory.
    """
    path = find_part(folder, f"{engine}.parquet")
    found = read_trajectory(path)
    entries = {"manifest.json": manifest["engines"][engine], "metrics.json": metrics[engine]}
    if found.engine != engine:
        raise ScenarioError(f"{path}: is a trajectory of {show_value(repr(found.engine))}")
    for name, entry in entries.items():
        # The CPU time differs between any two runs in its last digits.
        if (entry["cpu_time"], entry["steps"]) != (found.cpu_time, found.steps):
            raise ScenarioError(f"{path}: is of another run than {name}")
    return found
