"""Writing of folders, text files and JSON documents."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..engines.files import write_whole
from ..engines.format_version import VERSION_KEY
from .error import ScenarioError

DIGEST_KEY = "sha256"
FIGURE_FORMATS = ("png", "svg", "pdf")


@dataclass(frozen=True)
class FigureOutput:
    """How figures are written.

    Attributes
    ----------
    formats : tuple of str
        Some of `FIGURE_FORMATS`, each once.
    columns : int
        Number of a journal's columns that a figure fills: 1 (89 mm) or 2 (183 mm).
    """

    formats: tuple[str, ...] = ("png",)
    columns: int = 2


DEFAULT_FIGURES = FigureOutput()


def make_folder(out: Path) -> None:
    """Make the folder that ``--out`` names if it does not exist.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ScenarioError(f"--out {out}: the folder cannot be made: {error.strerror}") from error


def versioned(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a JSON document with its format version as the first key; the default version is 1."""
    return {VERSION_KEY: 1} | dict(document)


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a JSON document with its format version, whole or not at all."""
    write_text(path, json.dumps(versioned(document), indent=1, allow_nan=False) + "\n")


def write_sealed(path: Path, document: Mapping[str, Any], version: int) -> None:
    """Write a JSON document with its version and a digest of its contents, whole or not at all."""
    found = {VERSION_KEY: version} | dict(document)
    write_json(path, found | {DIGEST_KEY: content_digest(found)})


def content_digest(document: Mapping[str, Any]) -> str:
    """Return the SHA-256 of everything in a JSON document except its digest, in hexadecimal digits.

    The digest does not depend on order and white space. It depends on every bit of the values.
    """
    contents = {key: value for key, value in document.items() if key != DIGEST_KEY}
    text = json.dumps(contents, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal digits.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    return hashlib.sha256(path.read_bytes()).hexdigest()


def digest_named_files(files: Iterable[tuple[str, Path]]) -> str:
    """Return the SHA-256 of files in this order with their names, in hexadecimal digits.

    Parameters
    ----------
    files : iterable of (name, path)

    Raises
    ------
    OSError
        If one cannot be read.
    """
    found = hashlib.sha256()
    for name, path in files:
        found.update(f"{name}\n".encode())
        found.update(hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    with write_whole(path) as partial:
        partial.write_text(text, encoding="utf-8")
