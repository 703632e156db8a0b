"""A defect of DART that its package works around: as long as these tests pass, it needs to."""

# DART is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import runpy
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("dartpy", reason="DART is not installed; make test-packages installs it")

from tests.defects import DEFECTS, assert_shows_defect

pytestmark = pytest.mark.packages

SCRIPT = DEFECTS / "dart_friction_bound.py"


def test_the_script_shows_the_defect(tmp_path: Path) -> None:
    assert_shows_defect(
        SCRIPT, tmp_path, f"DART {version('dartpy')} has mended this: a friction of 2 is enough for the package"
    )


def test_friction_is_bounded_by_the_force_without_friction() -> None:
    script = runpy.run_path(str(SCRIPT), run_name="example")
    sticks, without = script["find_forces"]()
    found = script["step_rod"]()
    limit = script["ACCURACY"] * script["MASS"] * script["GRAVITY"]
    assert sticks[0] < script["FRICTION"] * sticks[1]  # Coulomb's law lets it stick
    assert found[0] == pytest.approx(script["FRICTION"] * without, abs=limit)


def test_a_cure_is_seen(capsys: pytest.CaptureFixture[str]) -> None:
    """With DART's other solver as its default."""
    script = runpy.run_path(str(SCRIPT), run_name="example")
    sticks, _ = script["find_forces"]()
    right = script["solve_right"]()
    np.testing.assert_allclose(right, sticks, rtol=0, atol=script["ACCURACY"] * script["MASS"] * script["GRAVITY"])
    script["main"].__globals__["step_rod"] = lambda *_solver: right
    assert script["main"]() == 0
    assert "cured: " in capsys.readouterr().out
