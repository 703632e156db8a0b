"""What Newton's importer changes of models for MuJoCo, and its defects: as long as these pass, users need to know."""

# Newton is an optional library; MuJoCo's compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("newton", reason="needs the extra newton")

import mujoco
import newton
import warp

from tests.defects import DEFECTS, assert_shows_defect

pytestmark = pytest.mark.engines

FRICTION = DEFECTS / "newton_solreffriction.py"
COLLISIONS = DEFECTS / "newton_self_collisions.py"
GRAVITY = DEFECTS / "newton_ignored_gravity.py"
IMPORT = DEFECTS.parent / "newton_import.py"
FIXED = f"Newton {newton.__version__} has mended this"


@pytest.mark.parametrize("script", [FRICTION, COLLISIONS, GRAVITY], ids=lambda script: script.stem)
def test_the_script_shows_the_defect(script: Path, tmp_path: Path) -> None:
    assert_shows_defect(script, tmp_path, FIXED)


def test_the_import_creeps_five_times_as_fast() -> None:
    """Creep is in proportion to the friction rows' time constant: 0.02 s for 0.004 s."""
    script = runpy.run_path(str(FRICTION), run_name="example")
    right = script["measure_creep"](mujoco.MjModel.from_xml_string(script["BALL"]))
    np.testing.assert_allclose(script["measure_creep"](script["import_model"]()) / right, 5, rtol=script["ACCURACY"])


def test_a_cure_of_the_friction_is_seen(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    solver = newton.solvers.SolverMuJoCo
    register = solver.register_custom_attributes

    def register_mended(builder: Any) -> None:
        register(builder)
        builder.custom_attributes["mujoco:pair_solreffriction"].default = warp.vec2(0.0, 0.0)

    monkeypatch.setattr(solver, "register_custom_attributes", register_mended)
    assert runpy.run_path(str(FRICTION), run_name="example")["main"]() == 0
    assert "cured: " in capsys.readouterr().out


def test_a_cure_of_the_lost_ground_is_seen(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    add = newton.ModelBuilder.add_mjcf

    def add_mended(builder: Any, text: str, enable_self_collisions: bool) -> None:
        """The model has a single body: it has no self-collisions to leave out."""
        add(builder, text, enable_self_collisions=True)

    monkeypatch.setattr(newton.ModelBuilder, "add_mjcf", add_mended)
    assert runpy.run_path(str(COLLISIONS), run_name="example")["main"]() == 0
    assert "cured: " in capsys.readouterr().out


def test_a_ball_of_the_moon_falls_as_on_earth() -> None:
    script = runpy.run_path(str(GRAVITY), run_name="example")
    right = script["measure_fall"](mujoco.MjModel.from_xml_string(script["BALL"]))
    np.testing.assert_allclose(right, script["GRAVITY"], rtol=1e-9)
    np.testing.assert_allclose(script["measure_fall"](script["import_model"]()), 9.81, rtol=script["ACCURACY"])


def test_a_cure_of_the_ignored_options_is_seen(capsys: pytest.CaptureFixture[str]) -> None:
    main = runpy.run_path(str(GRAVITY), run_name="example")["main"]
    load = main.__globals__["import_model"]

    def load_mended(gravity: float, step: float) -> Any:
        model = load()
        model.opt.gravity[:], model.opt.timestep = (0, 0, -gravity), step
        return model

    for gravity, step, lost in ((1.62, 0.002, "timestep"), (9.81, 0.0005, "gravity"), (1.62, 0.0005, None)):
        main.__globals__["import_model"] = lambda gravity=gravity, step=step: load_mended(gravity, step)
        assert main() == (lost is not None)
        assert (f"the file's {lost} is not read" if lost else "cured: ") in capsys.readouterr().out


def test_every_change_of_the_bicycle_is_known() -> None:
    script = runpy.run_path(str(IMPORT), run_name="example")
    equal, changed = script["measure_bicycle"]()
    assert set(script["_TOLD"]) <= set(equal)
    unexpected = [quantity.name for quantity in changed if not quantity.meaning]
    assert not unexpected
    found = {quantity.name: quantity for quantity in changed}
    mended = set(script["MEANINGS"]) - set(found)
    assert not mended, f"Newton {newton.__version__} no longer changes these: drop them from MEANINGS"
    np.testing.assert_allclose(found["pair_solreffriction"].after, [[0.02, 1.0]] * 2, rtol=1e-7)
    np.testing.assert_allclose(found["opt.gravity"].after, [0, 0, -9.81], rtol=1e-7)


def test_a_change_of_the_model_is_seen() -> None:
    """By a ten-thousandth of the largest number, which is more than single precision explains."""
    script = runpy.run_path(str(IMPORT), run_name="example")
    text = script["mjcf"](script["Bicycle"](), script["ENGINE"].settings(), "plane")
    before = mujoco.MjModel.from_xml_string(text)
    for name in ("body_mass", "jnt_axis", "pair_solref", "qpos0"):
        after = mujoco.MjModel.from_xml_string(text)
        getattr(after, name)[-1] += 1e-4 * np.abs(getattr(before, name)).max()
        assert [quantity.name for quantity in script["compare_models"](before, after)[1]] == [name]
