"""A registry of tiny wheels of the package `wheelmill`, whose engine changes from release to release.

The engine rides the plane by a method of order 2. The releases differ in one line each.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest

PACKAGE = "wheelmill"
_SOURCE = '''
import os
import time

import numpy as np
from pydantic import Field

from velodrome import Settings, Trajectory, UnsuitableProblem
from velodrome.reference.kinematics import body_positions, body_quaternions
from velodrome.reference.simulate import simulate_modified_euler

{loading}
__version__ = {version!r}
STRETCH = {stretch!r}


class MillSettings(Settings):
    """Settings of the engine."""

    step: float = Field(default=1e-3, gt=0, le=0.1, description="step [s]")


class Mill:
    """Ride by a method of order 2."""

    name = "wheelmill"
    version = __version__
    gives = ()
    settings = MillSettings

    def check(self, problem, settings):
        {checking}

    def step_noise(self, settings):
        return 2.0**-52

    def simulate(self, problem, settings, progress):
        {before}
        start = problem.qd * STRETCH
        ride = simulate_modified_euler(
            problem.bicycle, problem.surface, problem.q, start, problem.times, settings.step
        )
        with open(os.environ.get("WHEELMILL_LOG", os.devnull), "a") as log:
            log.write(f"{{__version__}} {{len(problem.times)}}\\n")
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(),
            time=ride.time,
            q=ride.q,
            qd=ride.qd,
            body_position=body_positions(problem.bicycle, ride.q),
            body_quaternion=body_quaternions(problem.bicycle, ride.q),
            steps=ride.steps,
            cpu_time=0.0,
            ended=ride.ended,
        )


ENGINE = Mill()
'''
SAME, ROUND_OFF, FAULT = 1.0, 1.0 + 2.0**-52, 1.0 + 1e-4  # factors on the rates of the start
CIRCLE = """
title = "A short circle on the plane"

[surface]
kind = "plane"

[motion]
rear_rate = 18.0
family = 2
near = { lean = 0.73, steer = 2.84 }

[simulation]
duration = 1.0
output_rate = 50.0

[gate]
duration = 1.0
output_rate = 50.0
"""


def make_wheel(
    folder: Path,
    version: str,
    stretch: float = SAME,
    before: str = "",
    requires: str | None = None,
    loading: str = "",
    checking: str = "",
) -> Path:
    """Write a wheel of the engine's package.

    Parameters
    ----------
    folder : Path
    version : str
    stretch : float
        Factor on the rates of the start, by which releases differ.
    before : str
        A line that the engine runs before it rides.
    requires : str, optional
        What the package needs.
    loading : str
        A line that the module runs when it is imported.
    checking : str
        A line that the engine runs when it is asked whether it can ride.
    """
    info = f"{PACKAGE}-{version}.dist-info"
    files = {
        f"{PACKAGE}.py": _SOURCE.format(
            version=version,
            stretch=stretch,
            before=before or "pass",
            loading=loading,
            checking=checking or "pass",
        ),
        f"{info}/entry_points.txt": f"[velodrome.engines]\n{PACKAGE} = {PACKAGE}:ENGINE\n",
    }
    return make_package_wheel(folder, PACKAGE, version, files, requires)


def make_package_wheel(
    folder: Path, name: str, version: str, files: Mapping[str, str], requires: str | None = None
) -> Path:
    """Write a wheel of any package with these files, by their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    stem = f"{name.replace('-', '_')}-{version}"
    needs = "" if requires is None else f"Requires-Dist: {requires}\n"
    described = {
        f"{stem}.dist-info/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n{needs}",
        f"{stem}.dist-info/WHEEL": "Wheel-Version: 1.0\nGenerator: mill\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    record = f"{stem}.dist-info/RECORD"
    every = {**files, **described}
    every[record] = "".join(f"{path},,\n" for path in [*every, record])
    path = folder / f"{stem}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as wheel:
        for inside, text in every.items():
            wheel.writestr(inside, text)
    return path


def install_mill(folder: Path, monkeypatch: pytest.MonkeyPatch, version: str = "1.0", stretch: float = SAME) -> None:
    """Install a release of the engine for this process and those it starts."""
    with zipfile.ZipFile(make_wheel(folder / "wheel", version, stretch)) as wheel:
        wheel.extractall(folder / "site")
    monkeypatch.syspath_prepend(str(folder / "site"))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder / "site"), os.environ.get("PYTHONPATH", "")]))


def use_registry(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let pip know the wheels of a folder alone."""
    folder.mkdir(parents=True, exist_ok=True)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(folder))
