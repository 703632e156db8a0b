"""The contact force in a value that Exudyn's own test stores: as long as this passes, it is wrong."""

from __future__ import annotations

import runpy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.defects import DEFECTS, assert_shows_defect

SCRIPT = DEFECTS / "exudyn_stored_test_value.py"


@cache
def load_script() -> dict[str, Any]:
    return runpy.run_path(str(SCRIPT), run_name="example")


def test_the_script_shows_the_defect(tmp_path: Path) -> None:
    assert_shows_defect(SCRIPT, tmp_path, "Exudyn has mended this")


def test_the_ring_keeps_its_energy() -> None:
    """The equations that the forces are held against, by what they do not use: T + V is constant."""
    script = load_script()
    axle, omega, mass, radius = script["AXLE"], script["TURN"] * script["UP"], script["MASS"], script["RADIUS"]
    energies = []
    for step in (0.0, 1e-6):
        # One Euler step moves the energy by the step's square alone, of a rate of turn of some hundred 1/s.
        angular, _, _ = script["find_ring_motion"](axle, omega)
        n, w = axle + step * np.cross(omega, axle), omega + step * angular
        n /= np.linalg.norm(n)
        steep = script["UP"] - (script["UP"] @ n) * n
        arm = radius * steep / np.linalg.norm(steep)
        spin = mass * radius**2 / 4 * (w @ w + (n @ w) ** 2)
        speed = np.cross(w, arm)
        energies.append(0.5 * spin + 0.5 * mass * speed @ speed + mass * script["GRAVITY"] * arm[2])
    assert abs(energies[1] - energies[0]) < (1e-6 * 300) ** 2 * energies[0]


def test_forces_alternate_at_any_step() -> None:
    """The first error neither decays nor shrinks with the step; from right accelerations it is not there."""
    script = load_script()
    exact = script["measure_exact_roll"]()
    for step in (script["STEP"], script["STEP"] / 2):
        roll = script["measure_roll"](step=step)
        assert roll.first[0] / exact.first[0] == pytest.approx(1.252, abs=1e-3)
        assert roll.last[0] - exact.last[0] == pytest.approx(-0.0224, abs=1e-3)
        right = script["measure_roll"](right_start=True, step=step)
        np.testing.assert_allclose(right.last, exact.last, atol=5e-4)


def test_a_cure_is_seen(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    main = load_script()["main"]
    measure = load_script()["measure_roll"]
    monkeypatch.setitem(main.__globals__, "measure_roll", lambda right_start=True: measure(right_start=True))
    assert main() == 0
    assert "cured: " in capsys.readouterr().out
