"""What the Drake engines are without their library: names, settings, and what they refuse."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from velodrome.engines.drake.engine import MULTIPLIERS, NATIVE
from velodrome.engines.engine import Problem, UnsuitableProblem
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.surface import Plane


def make_problem(bicycle: Bicycle = Bicycle()) -> Problem:  # noqa: B008
    q, qd = consistent_state(Bicycle(), Plane(), (0.0, 0.0), 0.1, 0.05, (0.1, 0.2, 15.0))
    return Problem(bicycle, Plane(), q, qd, np.arange(11) / 100)


def test_the_library_is_loaded_where_something_runs() -> None:
    code = "import sys, velodrome.engines.drake.engine; print('pydrake' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"


@pytest.mark.parametrize("engine", [MULTIPLIERS, NATIVE], ids=lambda engine: engine.name)
def test_steps_that_miss_the_output_times_are_refused(engine) -> None:
    problem = make_problem()
    engine.check(problem, engine.settings())
    with pytest.raises(ValueError, match=r"step 0\.003 s does not divide the output interval"):
        engine.check(problem, engine.settings(step=0.003))


@pytest.mark.parametrize("engine", [MULTIPLIERS, NATIVE], ids=lambda engine: engine.name)
@pytest.mark.parametrize("wheel", ["rear", "front"])
def test_a_wheel_without_inertia_is_refused(engine, wheel: str) -> None:
    bicycle = replace(Bicycle(), **{f"{wheel}_wheel_Ixx": 0.0, f"{wheel}_wheel_Iyy": 0.0})
    with pytest.raises(UnsuitableProblem, match=f"{wheel}_wheel_Iyy is 0"):
        engine.check(make_problem(bicycle), engine.settings())


@pytest.mark.parametrize(
    ("engine", "values"),
    [
        (MULTIPLIERS, {"integrator": "radau3"}),
        (MULTIPLIERS, {"step": 0.0}),
        (MULTIPLIERS, {"friction": 1.0}),
        (NATIVE, {"solver": "pgs"}),
        (NATIVE, {"stiffness": -1.0}),
        (NATIVE, {"friction": 0.0}),
    ],
    ids=lambda value: getattr(value, "name", None) or str(value),
)
def test_settings_that_drake_does_not_have_are_refused(engine, values: dict) -> None:
    with pytest.raises(ValidationError, match=next(iter(values))):
        engine.settings(**values)


def test_the_noise_of_a_step_is_the_tolerance_of_its_solver() -> None:
    assert MULTIPLIERS.step_noise(MULTIPLIERS.settings()) == 2.0**-52
    for solver in ("lagged", "similar", "sap"):
        assert NATIVE.step_noise(NATIVE.settings(solver=solver)) == 1e-6
    # A hundredth of the stiction tolerance.
    tamsi = NATIVE.settings(solver="tamsi", stiction_tolerance=1e-3)
    assert NATIVE.step_noise(tamsi) == pytest.approx(1e-5, rel=1e-12)
