"""An engine that does what it must not, at one place of its code; installed for this process and those it starts."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

NAME = "quitting"
PLACES = ("import", "version", "check", "step_noise", "simulate", "progress")
_SOURCE = """
import os
import sys
from dataclasses import replace

from velodrome.engines.engine import Settings
from velodrome.engines.lagrange import ENGINE as INNER


def do(place):
    if place == {place!r}:
        {statement}


class QuittingSettings(Settings):
    step: float = 0.01


class Quitting:
    name = "quitting"
    gives = INNER.gives
    settings = QuittingSettings

    @property
    def version(self):
        do("version")
        return "1.0"

    def check(self, problem, settings):
        do("check")

    def step_noise(self, settings):
        do("step_noise")
        return 1e-15

    def simulate(self, problem, settings, progress):
        do("simulate")

        def report(time):
            progress(time)
            do("progress")

        ride = INNER.simulate(problem, INNER.settings(), report)
        return replace(ride, engine=self.name, version="1.0", settings=settings.model_dump())


do("import")
ENGINE = Quitting()
"""
LINE = 1 + _SOURCE.splitlines().index("        {statement}")


def announce(folder: Path, monkeypatch: pytest.MonkeyPatch, place: str, statement: str) -> None:
    """Install the engine, which runs a statement at one of `PLACES`."""
    assert place in PLACES
    info = folder / "velodrome_quitting-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: velodrome-quitting\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[velodrome.engines]\n{NAME} = quitting_engine:ENGINE\n")
    (folder / "quitting_engine.py").write_text(_SOURCE.format(place=place, statement=statement))
    monkeypatch.delitem(sys.modules, "quitting_engine", raising=False)
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]))
