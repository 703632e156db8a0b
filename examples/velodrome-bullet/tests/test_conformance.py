"""The engine keeps to what Velodrome asks of every engine, and to its baselines."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from velodrome.testing import check_engine

pytest.importorskip("pybullet", reason="PyBullet is not installed; make test-packages installs it")

BASELINES = Path(__file__).parents[1] / "baselines"


def test_the_engine_conforms() -> None:
    """Fail with a diagnosis of all that the engine does not keep to."""
    check_engine("bullet")


def test_the_gate_holds() -> None:
    """On every ride that has a baseline."""
    rides = sorted(path.stem for path in BASELINES.glob("*.json"))
    assert rides == ["iftomm-2", "plane-circle"]
    velodrome = "from velodrome.scenarios.cli import main; main()"
    command = ["-c", velodrome, "check", *rides, "--engine", "bullet", "--baselines", BASELINES]
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the gate holds" in done.stdout
