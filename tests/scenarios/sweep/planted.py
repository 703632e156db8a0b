"""An engine with faults, announced like any other; workers find it on PYTHONPATH."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import pytest
from sweeping import UPRIGHT

from velodrome.engines.engine import Problem, Progress, Settings, Trajectory
from velodrome.engines.lagrange import ENGINE as INNER

NAME = "planted"
# A sweep file with every fault, on a short ride.
SWEEP = (
    f'engines = ["{NAME}"]\nmemory_limit = 300\n'
    + UPRIGHT.replace("60.0", "5.0")
    + f'"engines.{NAME}.fault" = ["hang", "crash", "none", "hog", "raise", "abort", "exit", "leave"]\n'
)


class PlantedSettings(Settings):
    fault: Literal["none", "crash", "abort", "hang", "hog", "raise", "exit", "leave", "end-host"] = "none"


class Planted:
    """The reference, unless its settings ask for a fault."""

    name = NAME
    version = "1.0"
    gives = INNER.gives
    settings = PlantedSettings

    def check(self, problem: Problem, settings: Any) -> None:
        pass

    def step_noise(self, settings: Any) -> float:
        return 0.0

    def simulate(self, problem: Problem, settings: PlantedSettings, progress: Progress) -> Trajectory:
        if settings.fault == "crash":
            ctypes.string_at(0)
        elif settings.fault == "abort":
            ctypes.CDLL(None).abort()
        elif settings.fault == "hang":
            ctypes.PyDLL(None).sleep(1000)  # in C, and no other thread of Python runs meanwhile
        elif settings.fault == "hog":
            held = []
            while True:
                held.append(bytearray(20_000_000))
        elif settings.fault == "raise":
            raise RuntimeError("out of\norder")
        elif settings.fault == "exit":
            sys.exit(0)
        elif settings.fault == "leave":
            os._exit(0)
        elif settings.fault == "end-host":  # the process that has the keeper of this one
            status = Path(f"/proc/{os.getppid()}/stat").read_text().rpartition(")")[2].split()
            os.kill(int(status[1]), signal.SIGKILL)
        ride = INNER.simulate(problem, INNER.settings(), progress)
        return replace(ride, engine=NAME, version=self.version, settings=settings.model_dump())


ENGINE = Planted()


def line_of(statement: str) -> int:
    """Line of this file on which a statement stands."""
    (found,) = (i for i, line in enumerate(Path(__file__).read_text().splitlines(), 1) if line.strip() == statement)
    return found


def announce(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install the engine for this process and its workers."""
    info = folder / "velodrome_planted-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: velodrome-planted\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[velodrome.engines]\n{NAME} = planted:ENGINE\n")
    monkeypatch.setenv("PYTHONPATH", f"{folder}:{Path(__file__).parent}:{os.environ.get('PYTHONPATH', '')}")
    monkeypatch.syspath_prepend(str(folder))
