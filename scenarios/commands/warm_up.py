"""The command `warm-up`."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import typer

from .options import JsonOption, count_cores, ending_with, print_json

# Short uses of what needs kernels, which compile what longer ones need. Those that start together need different ones:
# a ride on waves starts at given angles, with no circular motion. The output of runs goes to the folder `runs`.
_RIDE = ("--duration", "0.05", "--no-recording", "--json", "--out", "runs")
_USES: tuple[tuple[str, ...], ...] = (
    ("circular", "--alpha", "0.005", "--rear-rate", "18", "--family", "2", "--json"),
    ("run", "waves", *_RIDE),
    ("families", "--alpha", "0.005", "--json"),
    ("run", "q2-plus", *_RIDE),
    ("run", "plane-circle", *_RIDE),
    ("bicycle", "--json"),
    ("bifurcations", "--alpha", "0.005", "--family", "4", "--json"),
)
_MAIN = "import sys; from {package}.scenarios.cli import main; main()"
_PATIENCE = 1800  # for one use on a busy machine [s]
_PAUSE = 1.0  # between two looks at how many kernels have been compiled [s]


def warm_up_command(
    processes: Annotated[
        int | None, typer.Option(min=1, help="Processes at once; one for each CPU core if not given.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Compile ahead all kernels that commands and installed engines need, as for an image or for CI.

    What is compiled already is not compiled again. The exit status is 1 if a part of it fails.
    """
    from concurrent.futures import ThreadPoolExecutor, wait

    from .progress import SILENCE, ProgressBars

    begin = time.perf_counter()
    quiet = {**os.environ, SILENCE: "off"}
    with ProgressBars() as progress:
        from ...reference.kernels.cache import find_kernel_files, find_kernel_folder

        before = find_kernel_files()
        failures: dict[str, str] = {}
        with (
            TemporaryDirectory(prefix="velodrome-warm-up-") as work,
            ThreadPoolExecutor(processes or count_cores()) as pool,
        ):
            uses = {pool.submit(_use, arguments, Path(work), quiet): arguments for arguments in _USES}
            pending = set(uses)
            while pending:
                done, pending = wait(pending, timeout=_PAUSE)
                progress.watch("compiling kernels", len(find_kernel_files() - before), None, "compiled")
                failures |= {" ".join(uses[use][:2]): reason for use in done if (reason := use.result()) is not None}
        after = find_kernel_files()
        folder = find_kernel_folder()
        found: dict[str, Any] = {
            "compiled": len(after - before),
            "kernels": len(after),
            "seconds": time.perf_counter() - begin,
            "folder": None if folder is None else str(folder),
            "failures": failures,
        }
    with ending_with(1 if failures else 0):
        if as_json:
            print_json(found)
        else:
            _show(found)


def _use(arguments: Sequence[str], work: Path, environment: Mapping[str, str]) -> str | None:
    """Run a command in a process of its own; return its complaint if it fails."""
    code = _MAIN.format(package=__name__.partition(".scenarios.")[0])
    try:
        result = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            cwd=work,
            env=environment,
            capture_output=True,
            text=True,
            timeout=_PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"not done after {_PATIENCE} s"
    if result.returncode == 0:
        return None
    return (result.stderr.strip().splitlines() or [f"exit status {result.returncode}"])[-1]


def _show(found: dict[str, Any]) -> None:
    from .terminal import make_console

    # Each kernel counts once for every set of argument types, and apart as Python calls it and as others do.
    lines = [f"compiled: {found['compiled']} of {found['kernels']} kernels in {found['seconds']:.1f} s"]
    if found["folder"] is None:
        lines.append("no folder can be written to: set NUMBA_CACHE_DIR to one that can")
    else:
        lines.append(f"folder: {found['folder']}")
    lines += [f"failed: {use}: {reason}" for use, reason in found["failures"].items()]
    for line in lines:
        make_console().print(line, markup=False, soft_wrap=True, highlight=False)
