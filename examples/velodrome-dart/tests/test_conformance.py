"""The engine keeps to what Velodrome asks of every engine but for missed contacts, and to its baselines."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from velodrome.testing import examine_engine

pytest.importorskip("dartpy", reason="DART is not installed; make test-packages installs it")

BASELINES = Path(__file__).parents[1] / "baselines"


def test_the_engine_conforms() -> None:
    """But for a sample with a missed contact, whose force is zero; see test_stages.py and the README."""
    report = examine_engine("dart")
    failed = [check.name for check in report.checks if check.outcome == "failed"]
    assert failed == ["forces on plane, another bicycle"], str(report)


def test_the_gate_holds() -> None:
    """On every ride that has a baseline."""
    rides = sorted(path.stem for path in BASELINES.glob("*.json"))
    assert rides == ["iftomm-2", "plane-circle"]
    velodrome = "from velodrome.scenarios.cli import main; main()"
    command = ["-c", velodrome, "check", *rides, "--engine", "dart", "--baselines", BASELINES]
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the gate holds" in done.stdout
