"""What is read back of a run folder; a file that is missing or damaged makes one line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .error import ScenarioError


def part(folder: Path, name: str) -> Path:
    """A file of a run folder, which must be there.

    Raises
    ------
    ScenarioError
        If it is not.
    """
    if not folder.is_dir():
        raise ScenarioError(f"{folder}: no such folder; velodrome run writes one and says where")
    if not (folder / name).is_file():
        raise ScenarioError(f"{folder}: not the folder of a finished run: it has no {name}")
    return folder / name


def document(folder: Path, name: str) -> Mapping[str, Any]:
    """A JSON object of a run folder.

    Raises
    ------
    ScenarioError
        If it is missing, cannot be read, or is something else.
    """
    path = part(folder, name)
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ScenarioError(f"{path}: not a JSON document: {error}") from error
    if not isinstance(found, dict):
        raise ScenarioError(f"{path}: not a JSON object")
    return found
