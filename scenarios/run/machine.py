"""Description of the machine and the software of a run: the suite's commit, the processor, and the BLAS libraries."""

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

_TIMEOUT = 10.0  # limit for a call of git [s]


@cache
def find_commit() -> dict[str, Any]:
    """Return the git commit of the suite's code.

    Returns
    -------
    dict
        ``commit``: the full hash, or None if git does not track the code, as in an installed package.
        ``modified``: whether tracked files differ from that commit; None without a commit.
    """
    own = Path(__file__).resolve()
    # An installed package may lie within another repository, e.g. in a virtual environment of a project.
    if _run_git(own.parent, "ls-files", "--error-unmatch", own.name) is None:
        return {"commit": None, "modified": None}
    changes = _run_git(own.parent, "status", "--porcelain", "--untracked-files=no")
    return {"commit": _run_git(own.parent, "rev-parse", "HEAD"), "modified": None if changes is None else bool(changes)}


def _run_git(folder: Path, *arguments: str) -> str | None:
    """Return the output of git in a folder, or None if git fails or is not installed."""
    # A git hook that runs the suite may set these variables to another repository.
    elsewhere = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE")
    environment = {key: value for key, value in os.environ.items() if key not in elsewhere}
    command = ["git", "-C", str(folder), "--no-optional-locks", *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT, check=False, env=environment)
    except (OSError, ValueError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


@cache
def describe_machine() -> dict[str, str]:
    """Return descriptions of the platform that results depend on; unknown entries are left out."""
    found = {
        "system": platform.platform(),
        "machine": platform.machine(),
        "processor": _find_processor(),
        "python": platform.python_version(),
        "blas_numpy": _describe_build_blas(np),
        "blas_scipy": _describe_build_blas(scipy),
        "blas_loaded": _describe_loaded_blas(),
        # Selects OpenBLAS's kernels, which affect the last bits of results.
        "openblas_coretype": os.environ.get("OPENBLAS_CORETYPE"),
    }
    return {name: text for name, text in found.items() if text is not None}


def _find_processor() -> str | None:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return next(iter(names), platform.processor()) or None


def _describe_build_blas(library: ModuleType) -> str | None:
    """Return the name, version and build of the BLAS that a library was built with, or None if unknown."""
    try:
        blas = library.show_config(mode="dicts")["Build Dependencies"]["blas"]
        parts = (blas.get("name"), blas.get("version"), blas.get("openblas configuration"))
    except (AttributeError, KeyError, TypeError):
        return None
    return ", ".join(str(part) for part in parts if part) or None


def _describe_loaded_blas() -> str | None:
    """Return the BLAS libraries of this process with their kernels, or None if threadpoolctl is not installed."""
    try:
        from threadpoolctl import threadpool_info  # pyright: ignore[reportMissingImports]
    except ImportError:
        return None
    found = [entry for entry in threadpool_info() if entry.get("user_api") == "blas"]
    texts = {f"{entry.get('internal_api')} {entry.get('version')} {entry.get('architecture', '')}" for entry in found}
    return ", ".join(sorted(text.strip() for text in texts)) or None
