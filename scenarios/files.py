"""What the command writes: folders, texts, JSON documents."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..engines.files import write_whole
from .error import ScenarioError


def make_folder(out: Path) -> None:
    """Make the folder that ``--out`` names, if need be.

    Raises
    ------
    ScenarioError
        If it cannot be made.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ScenarioError(f"--out {out}: the folder cannot be made: {error.strerror}") from error


def write_json(path: Path, data: Any) -> None:
    """Write JSON, whole or not at all."""
    write_text(path, json.dumps(data, indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    with write_whole(path) as partial:
        partial.write_text(text, encoding="utf-8")
