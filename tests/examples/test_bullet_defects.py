"""A defect of Bullet that its package works around: as long as these tests pass, it needs to."""

# PyBullet is an optional library, and its compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import math
import runpy
from importlib.metadata import version
from pathlib import Path

import pytest

pytest.importorskip("pybullet", reason="PyBullet is not installed; make test-packages installs it")

from tests.defects import DEFECTS, assert_shows_defect

pytestmark = pytest.mark.packages

SCRIPT = DEFECTS / "bullet_contact_erp.py"


def test_the_script_shows_the_defect(tmp_path: Path) -> None:
    assert_shows_defect(
        SCRIPT, tmp_path, f"PyBullet {version('pybullet')} has mended this: the package could have a contactERP"
    )


def test_a_depth_leaves_a_velocity() -> None:
    """The depth is that of the rounded rim; the velocity is a fifth of it in a step, to what friction takes away."""
    script = runpy.run_path(str(SCRIPT), run_name="example")
    for step in script["STEPS"]:
        depth, kicked = script["step_disc"](script["DEFAULT_ERP"], step)
        assert depth == pytest.approx(script["MARGIN"] * (1 - math.cos(script["LEAN"])), rel=1e-6)
        assert kicked == pytest.approx(script["DEFAULT_ERP"] * depth / step, rel=0.1)
        _, still = script["step_disc"](0.0, step)
        assert abs(still) < script["GRAVITY"] * step


def test_a_cure_is_seen(capsys: pytest.CaptureFixture[str]) -> None:
    """With the contactERP at which a depth stays."""
    script = runpy.run_path(str(SCRIPT), run_name="example")
    step = script["step_disc"]
    script["main"].__globals__["step_disc"] = lambda _erp, length: step(0.0, length)
    assert script["main"]() == 0
    assert "cured: " in capsys.readouterr().out
