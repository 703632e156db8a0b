"""Run the tests that round-off could sway as other machines would run them: ``python -m tests.machines [--short]``.

OpenBLAS chooses its kernels by the CPU, numba its instructions, and both may be told to take another's: the verdicts
must be the same. So must the documents of `velodrome families` (names, order and flags; numbers to round-off), and in
the long form the verdicts of `velodrome paper`. A machine that this CPU cannot play, or whose kernels another one
listed before has too, is named and left out.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tests.shaken import shake

ROOT = Path(__file__).parent.parent
TESTS = (
    "tests/reference",
    *(f"tests/reports/measure/test_{name}.py" for name in ("excited_modes", "identify", "limits", "metrics")),
    *(f"tests/scenarios/gate/test_{name}.py" for name in ("gate", "verdict")),
    *(f"tests/scenarios/paper/test_{name}.py" for name in ("ledger", "paper")),
    "tests/scenarios/studies/test_precision.py",
)
SHORT_TESTS = (
    *(f"tests/reference/test_{name}.py" for name in ("families", "running_direction", "stability")),
    "tests/reports/measure/test_excited_modes.py",
    "tests/scenarios/paper/test_paper.py",
)
ALPHAS = (0.0, 1 / 200, 1 / 5, 1.0)
# Of a row's largest number: a double zero splits by the root of round-off times its condition, 1e-7.
SAME = 1e-6
_OWN = ("OPENBLAS_CORETYPE", "OPENBLAS_NUM_THREADS", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")


@dataclass(frozen=True)
class Machine:
    """What is told to the libraries to play a machine, and the seed of shaken round-off, if any."""

    name: str
    variables: dict[str, str] = field(default_factory=dict)
    seed: int | None = None

    @property
    def environment(self) -> dict[str, str]:
        """The process's environment, without what else would choose the libraries' code."""
        own = {name: value for name, value in os.environ.items() if name not in _OWN}
        return own | {"OPENBLAS_NUM_THREADS": "1"} | self.variables

    def python(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run Python as on this machine, from the repository's root."""
        command = [sys.executable, *arguments]
        return subprocess.run(command, cwd=ROOT, env=self.environment, capture_output=True, text=True)


def _kernel(name: str) -> Machine:
    return Machine(name, {"OPENBLAS_CORETYPE": name})


AS_IT_IS = Machine("this machine")
SHORT = (_kernel("Haswell"), _kernel("Prescott"), Machine("shaken", seed=1))
LONG = (
    *(_kernel(name) for name in ("Haswell", "Zen", "Nehalem", "Sandybridge", "Prescott", "SkylakeX")),
    Machine("two threads", {"OPENBLAS_NUM_THREADS": "2"}),
    Machine("two threads, Haswell", {"OPENBLAS_NUM_THREADS": "2", "OPENBLAS_CORETYPE": "Haswell"}),
    Machine("numba's generic CPU", {"NUMBA_CPU_NAME": "generic"}),
    Machine("shaken", seed=1),
    Machine("shaken otherwise", seed=2),
)


def kernels() -> list[str]:
    """Names of the kernels that the OpenBLAS of numpy and scipy run in this process; empty where they do not say."""
    import scipy.linalg  # noqa: F401  loads scipy's own

    maps = Path("/proc/self/maps")
    loaded = sorted({line.split()[-1] for line in maps.read_text().splitlines() if "openblas" in line.lower()})
    return [name for library in loaded if (name := _core_name(library))] if maps.exists() else []


def _core_name(library: str) -> str | None:
    for symbol in ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename", "openblas_get_corename"):
        function = getattr(ctypes.CDLL(library), symbol, None)
        if function is not None:
            function.restype = ctypes.c_char_p
            return function().decode()
    return None


def write_documents(path: Path, seed: int | None, paper: bool) -> None:
    """Write what must be the same everywhere, as this process computes it, to a JSON file."""
    if seed is not None:
        shake(seed)
    from velodrome.scenarios.motions.families import families_document
    from velodrome.scenarios.paper.claims import make_ledger
    from velodrome.scenarios.paper.ledger import ledger_document

    found: dict[str, Any] = {f"families at alpha = {alpha:g}": families_document(alpha) for alpha in ALPHAS}
    if paper:
        told = ("claim", "kind", "verdict", "fault")
        found["paper"] = [{name: line[name] for name in told} for line in ledger_document(make_ledger(), [])["lines"]]
    path.write_text(json.dumps(found))


def differences(one: Any, other: Any, where: str = "") -> Iterator[str]:
    """Where two JSON documents differ: in names, order, flags and texts at all, in numbers by more than round-off."""
    numbers = [_numbers(value) for value in (one, other)]
    if numbers[0] is not None and numbers[1] is not None and numbers[0].shape == numbers[1].shape:
        off = np.abs(numbers[0] - numbers[1])
        size = SAME * (1 + np.abs(numbers[0]).max(axis=-1 if numbers[0].ndim > 1 else None, keepdims=True, initial=0.0))
        if np.any(off > size):
            yield f"{where}: numbers differ by up to {off.max():.1e}"
    elif isinstance(one, dict) and isinstance(other, dict):
        if list(one) != list(other):
            yield f"{where}: {', '.join(one)} against {', '.join(other)}"
        for name in [name for name in one if name in other]:
            yield from differences(one[name], other[name], f"{where}/{name}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for k, (first, second) in enumerate(zip(one, other, strict=True)):
            yield from differences(first, second, f"{where}/{k}")
    elif one != other:
        yield f"{where}: {str(one)[:80]} against {str(other)[:80]}"


def _numbers(value: Any) -> np.ndarray | None:
    """The numbers of a float or of a rectangle of floats; None for anything else."""
    try:
        found = np.array(value)
    except ValueError:  # lists of several lengths
        return None
    if found.dtype.kind != "f":
        return None
    return np.atleast_1d(found.reshape(len(found), -1) if found.ndim > 2 else found)


def run(machines: tuple[Machine, ...], tests: tuple[str, ...], paper: bool) -> list[str]:
    """Play all machines and say how each fared; return the names of those that failed."""
    failed, seen = [], {}
    with tempfile.TemporaryDirectory() as folder:
        expected = _documents(AS_IT_IS, Path(folder), paper)
        if isinstance(expected, str):
            return [_report(AS_IT_IS.name, expected)]
        for machine in machines:
            probe = machine.python("-m", "tests.machines", "--kernels")
            if probe.returncode != 0:
                print(f"{machine.name}: left out, this CPU cannot run it (exit status {probe.returncode})", flush=True)
                continue
            key = (probe.stdout, *sorted(set(machine.variables.items()) - {("OPENBLAS_CORETYPE", machine.name)}))
            known = seen.setdefault((key, machine.seed), machine.name)
            if known != machine.name:
                print(f"{machine.name}: left out, it has the kernels of {known}", flush=True)
                continue
            began = time.monotonic()
            faults = [*_compared(machine, Path(folder), paper, expected), *_tested(machine, tests)]
            which = f"{machine.name} ({probe.stdout.strip() or 'unknown kernels'}, {time.monotonic() - began:.0f} s)"
            if faults:
                failed.append(_report(machine.name, "\n".join(faults)))
            print(f"{which}: {'fails' if faults else 'passes'}", flush=True)
    return failed


def _report(name: str, text: str) -> str:
    print(f"--- {name}\n{text}\n---", flush=True)
    return name


def _documents(machine: Machine, folder: Path, paper: bool) -> dict[str, Any] | str:
    """The documents as a machine has them, or what went wrong."""
    path = folder / f"{machine.name}.json"
    options = (["--paper"] if paper else []) + ([] if machine.seed is None else ["--seed", str(machine.seed)])
    done = machine.python("-m", "tests.machines", "--write", str(path), *options)
    return json.loads(path.read_text()) if done.returncode == 0 else f"no documents:\n{done.stderr}"


def _compared(machine: Machine, folder: Path, paper: bool, expected: dict[str, Any]) -> list[str]:
    found = _documents(machine, folder, paper)
    return [found] if isinstance(found, str) else list(differences(expected, found))


def _tested(machine: Machine, tests: tuple[str, ...]) -> list[str]:
    shaken = [] if machine.seed is None else ["-p", "tests.shaken", "--shaken", str(machine.seed)]
    done = machine.python("-m", "pytest", *shaken, *tests)
    return [] if done.returncode == 0 else [done.stdout + done.stderr]


def main() -> int:
    """Parse the command line; exit status 1 where a machine fails."""
    parser = argparse.ArgumentParser(prog="python -m tests.machines", description="Run tests as other machines would.")
    parser.add_argument("--short", action="store_true", help="three machines and the tests that sway most")
    parser.add_argument("--only", metavar="NAME", action="append", help="this machine; may be given again")
    parser.add_argument("--kernels", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--write", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--seed", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--paper", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.kernels:
        # What a kernel cannot do here shows when it works.
        np.linalg.eigvals(np.random.default_rng(0).standard_normal((64, 64)))
        print(", ".join(dict.fromkeys(kernels())))
        return 0
    if given.write is not None:
        write_documents(given.write, given.seed, given.paper)
        return 0
    machines = SHORT if given.short else LONG
    unknown = [name for name in given.only or () if all(name != machine.name for machine in machines)]
    if unknown:
        parser.error(f"no machine {', '.join(unknown)}; there are: {', '.join(machine.name for machine in machines)}")
    chosen = tuple(machine for machine in machines if given.only is None or machine.name in given.only)
    failed = run(chosen, SHORT_TESTS if given.short else TESTS, paper=not given.short)
    print(f"fails on: {', '.join(failed)}" if failed else "the same on every machine")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
