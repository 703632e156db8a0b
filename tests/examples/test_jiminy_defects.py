"""Defects of Jiminy that its package works around: as long as these tests pass, it needs to."""

# Jiminy is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import runpy
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("jiminy_py", reason="Jiminy is not installed; make test-packages installs it")

from tests.defects import DEFECTS, assert_shows_defect

pytestmark = pytest.mark.packages

ORDER, REFERENCE = DEFECTS / "jiminy_rk4.py", DEFECTS / "jiminy_wheel_reference.py"
FIXED = f"Jiminy {version('jiminy-py')} has mended this: drop what works around it"


@pytest.mark.parametrize("script", [ORDER, REFERENCE], ids=lambda script: script.stem)
def test_the_script_shows_the_defect(script: Path, tmp_path: Path) -> None:
    assert_shows_defect(script, tmp_path, FIXED)


def test_order_is_two() -> None:
    script = runpy.run_path(str(ORDER), run_name="example")
    errors, orders = script["measure_orders"]()
    np.testing.assert_allclose(orders, 2, rtol=0, atol=script["CLOSE"])
    # The first steps turn by 0.06 rad: an error of third order in the angle, a step.
    assert errors[0] < script["STEPS"][0] * 0.06**3


def test_a_cure_of_the_order_is_seen(capsys: pytest.CaptureFixture[str]) -> None:
    """With the method on the quaternion's four numbers in place of Jiminy's."""
    script = runpy.run_path(str(ORDER), run_name="example")
    step = script["step_quaternion"]

    def tumble(count: int) -> np.ndarray:
        state = np.array([0, 0, 0, 1.0, *script["SPIN"]])
        for _ in range(count):
            state = step(state, script["DURATION"] / count)
        return state[:4]

    script["main"].__globals__["tumble_in_jiminy"] = tumble
    assert script["main"]() == 0
    assert "cured: " in capsys.readouterr().out


def test_a_leaning_wheel_is_lifted_out_of_the_ground() -> None:
    """By the stabilisation alone, k^2 r (1 - cos L) of acceleration with k = 2 pi f."""
    script = runpy.run_path(str(REFERENCE), run_name="example")
    _, exact = script["find_precession"]()
    still = script["find_first_force"](0.0)
    assert np.abs(still - exact).max() < script["ACCURACY"] * np.abs(exact).max()
    # The force is linear in the acceleration that is asked for.
    pulled = [script["find_first_force"](frequency) - exact for frequency in (10.0, 20.0)]
    np.testing.assert_allclose(pulled[1], 4 * pulled[0], rtol=1e-6, atol=1e-6)


def test_a_cure_of_the_reference_is_seen(capsys: pytest.CaptureFixture[str]) -> None:
    """A right reference leaves nothing to stabilise: the force is the one without stabilisation."""
    script = runpy.run_path(str(REFERENCE), run_name="example")
    start = script["find_first_force"]
    script["main"].__globals__["find_first_force"] = lambda _frequency: start(0.0)
    assert script["main"]() == 0
    assert "cured: " in capsys.readouterr().out
