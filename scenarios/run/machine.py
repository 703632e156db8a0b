"""What a run ran on: the suite's commit, the processor, and the BLAS that numpy and scipy call."""

from __future__ import annotations

import os
import platform
import subprocess
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import scipy

_PATIENCE = 10.0  # that git may take [s]


@cache
def find_commit() -> dict[str, Any]:
    """Return the git commit that the suite's code is of.

    Returns
    -------
    dict
        ``commit``: the full hash, or None where the code is not tracked by git, as that of an installed package.
        ``modified``: whether tracked files differ from that commit; None without a commit.
    """
    own = Path(__file__).resolve()
    # An installed package may lie in somebody else's repository, such as a virtual environment in a project.
    if _git(own.parent, "ls-files", "--error-unmatch", own.name) is None:
        return {"commit": None, "modified": None}
    changes = _git(own.parent, "status", "--porcelain", "--untracked-files=no")
    return {"commit": _git(own.parent, "rev-parse", "HEAD"), "modified": None if changes is None else bool(changes)}


def _git(folder: Path, *arguments: str) -> str | None:
    """What git says in a folder; None where it fails or is not there."""
    # A hook that calls us may name another repository.
    elsewhere = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE")
    environment = {key: value for key, value in os.environ.items() if key not in elsewhere}
    command = ["git", "-C", str(folder), "--no-optional-locks", *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE, check=False, env=environment)
    except (OSError, ValueError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


@cache
def describe_machine() -> dict[str, str]:
    """Return the platform that results depend on, one text an entry; what is not known has none."""
    found = {
        "system": platform.platform(),
        "machine": platform.machine(),
        "processor": _processor(),
        "python": platform.python_version(),
        "blas_numpy": _built_with(np),
        "blas_scipy": _built_with(scipy),
        "blas_loaded": _loaded_blas(),
        # Chooses OpenBLAS's kernels, and with them the last bits of results.
        "openblas_coretype": os.environ.get("OPENBLAS_CORETYPE"),
    }
    return {name: text for name, text in found.items() if text is not None}


def _processor() -> str | None:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return next(iter(names), platform.processor()) or None


def _built_with(library: ModuleType) -> str | None:
    """Name, version and build of the BLAS that a library was built with."""
    try:
        blas = library.show_config(mode="dicts")["Build Dependencies"]["blas"]
        parts = (blas.get("name"), blas.get("version"), blas.get("openblas configuration"))
    except (AttributeError, KeyError, TypeError):
        return None
    return ", ".join(str(part) for part in parts if part) or None


def _loaded_blas() -> str | None:
    """BLAS libraries of this process with the kernels that they chose, where threadpoolctl is installed."""
    try:
        from threadpoolctl import threadpool_info  # pyright: ignore[reportMissingImports]
    except ImportError:
        return None
    found = [entry for entry in threadpool_info() if entry.get("user_api") == "blas"]
    texts = {f"{entry.get('internal_api')} {entry.get('version')} {entry.get('architecture', '')}" for entry in found}
    return ", ".join(sorted(text.strip() for text in texts)) or None
