"""Defects of Pinocchio that the suite works around: as long as these tests pass, it needs to."""

# pinocchio is an optional library whose compiled bindings carry no types.
# pyright: reportMissingImports=false

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import pytest

from tests.defects import DEFECTS, assert_shows_defect

pin = pytest.importorskip("pinocchio", reason="the extra pinocchio is not installed")

pytestmark = pytest.mark.engines

ACCELERATION, RESIDUAL = DEFECTS / "pinocchio_desired_acceleration.py", DEFECTS / "pinocchio_absolute_residual.py"
FIXED = f"Pinocchio {pin.__version__} has mended this: drop what works around it"


@pytest.mark.parametrize("script", [ACCELERATION, RESIDUAL], ids=lambda script: script.stem)
def test_the_script_shows_the_defect(script: Path, tmp_path: Path) -> None:
    assert_shows_defect(script, tmp_path, FIXED)


def test_a_wheel_s_contact_force_is_wrong_without_its_own_acceleration() -> None:
    """As large as the force itself, and pulling; with the acceleration in the data it is right to round-off."""
    script = runpy.run_path(str(ACCELERATION), run_name="example")
    _, exact = script["find_precession"]()
    naive, given = script["solve_contact"](True, False), script["solve_contact"](False, True)
    assert naive[2] < 0 < exact[2]
    assert abs(given - exact).max() < script["ACCURACY"] * abs(exact).max()


def test_a_cure_of_the_ignored_acceleration_is_seen(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    solve = pin.constraintDynamics

    def mended(model: Any, data: Any, q: Any, v: Any, tau: Any, contacts: Any, datas: Any, *settings: Any) -> Any:
        for contact, of_contact in zip(contacts, datas, strict=True):
            of_contact.contact_acceleration_desired += contact.desired_contact_acceleration
        return solve(model, data, q, v, tau, contacts, datas, *settings)

    monkeypatch.setattr(pin, "constraintDynamics", mended)
    assert runpy.run_path(str(ACCELERATION), run_name="example")["main"]() == 0
    assert "cured: " in capsys.readouterr().out


def test_a_cure_of_the_absolute_residual_is_seen(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Mended(pin.ProximalSettings):
        absolute_residual = 0.0

    monkeypatch.setattr(pin, "ProximalSettings", Mended)
    assert runpy.run_path(str(RESIDUAL), run_name="example")["main"]() == 0
    assert "cured: " in capsys.readouterr().out
