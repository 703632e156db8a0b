"""Scenarios with inputs: stored whole, measured by their energy balance, told apart from others; commands with them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import velodrome
from velodrome.engines.engine import Settings
from velodrome.engines.guard import GuardedEngine
from velodrome.reference.dae import dynamics
from velodrome.reference.kinematics import LEAN, REAR_ANGLE, STEER
from velodrome.scenarios.compare.folders import read_pair
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.gate.checks import gated_content
from velodrome.scenarios.run import runner
from velodrome.scenarios.run.runner import plan_run
from velodrome.scenarios.scenario import load_scenario, make_start

DRIVEN = """
title = "Driven, steered and damped"
[surface]
kind = "plane"
[motion]
kind = "upright"
speed = 4.6
[perturbation]
lean_rate = 0.2
[inputs]
steer_torque = 0.3
rear_wheel_torque = 5.0
steer_damping = 1.0
[simulation]
duration = 0.5
"""
HELD = velodrome.Inputs(steer_torque=0.3, rear_wheel_torque=5.0, steer_damping=1.0)


@pytest.fixture
def driven(tmp_path: Path) -> Path:
    path = tmp_path / "driven.toml"
    path.write_text(DRIVEN)
    return path


def test_a_run_with_inputs_is_stored_whole_and_its_energy_balance_closes(driven: Path, tmp_path: Path) -> None:
    run = velodrome.run(driven, engines=["exudyn", "mujoco-multipliers"], out=tmp_path / "runs")
    assert run.start.inputs == HELD
    assert run.folder is not None
    again = velodrome.load(run.folder)
    assert again.start.inputs == HELD
    assert again.metrics == run.metrics
    drift = {name: values["energy_drift"] for name, values in run.metrics.items()}
    # The reference's tolerance; order 2 and 4 with the default steps, as without inputs.
    assert drift["reference"] < 1e-12
    assert drift["mujoco-multipliers"] < 1e-10
    assert drift["exudyn"] < 1e-6
    energies = run.trajectories["reference"].to_pandas()[["kinetic_energy", "potential_energy"]].sum(axis=1)
    assert np.ptp(energies) > 0.02 * energies.iloc[0]
    page = (run.folder / "report.html").read_text()
    assert "steer torque 0.3 N m, rear wheel torque 5.0 N m, steer damping 1.0 N m s/rad" in page
    assert "With its torques this start is no steady motion" in page
    assert "Inputs" not in velodrome_page(tmp_path)


def velodrome_page(tmp_path: Path) -> str:
    run = velodrome.run("plane-circle", engines=["mujoco-native"], duration=0.1, out=tmp_path / "free")
    assert run.folder is not None
    return (run.folder / "report.html").read_text()


def test_runs_with_different_inputs_are_not_compared(driven: Path, tmp_path: Path) -> None:
    folders = []
    for torque in (0.3, 0.31):
        changes = {"inputs.steer_torque": torque}
        run = velodrome.run(driven, engines=[], changes=changes, duration=0.1, out=tmp_path / "runs")
        assert run.folder is not None
        folders.append(run.folder)
    with pytest.raises(ScenarioError, match=r"different scenarios: inputs.steer_torque 0.3 against 0.31"):
        read_pair(*folders)


def test_the_gate_tells_inputs_apart_and_reads_baselines_of_before() -> None:
    _, free = load_scenario("q2")
    assert "inputs" not in gated_content(free)
    _, damped = load_scenario("q2", {"inputs.steer_damping": 0.1})
    assert gated_content(damped)["inputs"]["steer_damping"] == 0.1


def test_the_start_is_the_circle_with_the_torque_held() -> None:
    near = {"motion.near": {"lean": 0.73744, "steer": 2.837}, "inputs.steer_torque": 0.05}
    _, scenario = load_scenario("q2", near)
    with pytest.raises(ScenarioError, match=r"motion: families are numbered by their hands-free motions"):
        make_start(scenario)
    table = scenario.motion.model_copy(update={"family": None})
    start = make_start(scenario.model_copy(update={"motion": table}))
    problem = start.problem
    assert start.family is None
    now = dynamics(problem.bicycle, problem.surface, problem.q, problem.qd, problem.inputs).acceleration
    # Known to round-off of the equations times the rates squared.
    assert np.abs(now[[LEAN, STEER, REAR_ANGLE]]).max() < 1e-9
    hands_free = dynamics(problem.bicycle, problem.surface, problem.q, problem.qd).acceleration
    assert np.abs(hands_free[[LEAN, STEER]]).max() > 0.01


def test_a_circle_with_a_rear_wheel_torque_is_refused_with_the_reason() -> None:
    _, scenario = load_scenario("q2", {"inputs.rear_wheel_torque": 1.0})
    with pytest.raises(ScenarioError, match=r"motion: no circular motion exists with a rear-wheel torque of 1.0 N m"):
        make_start(scenario)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("steer_damping", -1.0, "greater than or equal to 0"),
        ("steer_torque", "much", "number"),
        ("brake", 1.0, "brake"),
    ],
)
def test_wrong_inputs_are_refused_in_one_line(key: str, value: object, said: str) -> None:
    with pytest.raises(ScenarioError, match=said) as refused:
        load_scenario("q2", {f"inputs.{key}": value})
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith("q2: inputs")


def test_an_engine_that_ignores_inputs_is_left_out_or_refused_by_name(driven: Path, monkeypatch) -> None:
    name, scenario = load_scenario(str(driven))
    configure = runner.configure_engine

    def configure_silent(engine: str, given: dict[str, Any], any_release: bool) -> tuple[GuardedEngine, Settings]:
        loaded, settings = configure(engine, given, any_release)
        assert isinstance(loaded, GuardedEngine)
        return replace(loaded, takes_inputs=engine != "exudyn"), settings

    monkeypatch.setattr(runner, "configure_engine", configure_silent)
    plan = plan_run(name, scenario)
    assert "exudyn-builtin" in plan.engines
    assert plan.left_out["exudyn"].startswith("it applies no inputs, and the problem has steer_torque 0.3 N m, ")
    with pytest.raises(ScenarioError, match=r"^engines\.exudyn: it applies no inputs"):
        plan_run(name, scenario, ["exudyn"])


def test_circular_and_families_take_inputs_from_python() -> None:
    held = velodrome.Inputs(steer_torque=0.05)
    found = velodrome.circular(alpha=0.005, rear_rate=18.0, near=(0.737, 2.837), inputs=held)
    assert found.family is None
    assert found.as_json()["inputs"] == {"steer_torque": 0.05, "rear_wheel_torque": 0.0, "steer_damping": 0.0}
    assert "inputs: steer_torque 0.05 N m" in repr(found)
    free = velodrome.circular(alpha=0.005, rear_rate=18.0, near=(0.737, 2.837))
    assert free.motion.lean != found.motion.lean
    damped = velodrome.circular(alpha=0.005, rear_rate=18.0, family=2, inputs=velodrome.Inputs(steer_damping=1.0))
    assert damped.growth_rate != free.growth_rate
    with pytest.raises(ScenarioError, match=r"inputs is 0.05 \(float\); it must be an Inputs"):
        velodrome.circular(alpha=0.005, rear_rate=18.0, family=2, inputs=0.05)  # type: ignore[arg-type]
    with pytest.raises(ScenarioError, match=r"no circular motion exists with a rear-wheel torque"):
        velodrome.families(alpha=0.005, inputs=replace(held, rear_wheel_torque=1.0))


def test_commands_take_inputs(velodrome) -> None:
    options = ("--alpha", "0.005", "--rear-rate", "18")
    found = velodrome("circular", *options, "--near", "0.737,2.837", "--steer-torque", "0.05", "--json")
    assert found.status == 0
    assert found.json()["inputs"]["steer_torque"] == 0.05
    assert "steer_torque" in velodrome("circular", *options, "--near", "0.737,2.837", "--steer-torque", "0.05").stdout
    for wrong, status, said in (
        (("--family", "2", "--steer-torque", "0.05"), 2, "no curve has a number"),
        # Nothing is wrong with it, but there is no such motion.
        (("--family", "2", "--rear-wheel-torque", "1"), 1, "no circular motion exists with a rear-wheel torque"),
        (("--family", "2", "--steer-torque", "nan"), 2, "--steer-torque is nan; it must be a finite number"),
        (("--family", "2", "--steer-damping", "-1"), 2, "--steer-damping"),
    ):
        refused = velodrome("circular", *options, *wrong)
        assert refused.status == status
        assert said in refused.stderr
        assert refused.stderr.count("\n") == 1
    damped = velodrome("bicycle", "--steer-damping", "2", "--json").json()
    assert damped["steer_damping"] == 2.0
    assert damped["weave_speed"] > velodrome("bicycle", "--json").json()["weave_speed"]
