"""What the examination makes of engines that are none, break, print, forget or do not refuse, and what it leaves."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from planting import changed, plant, reported
from pydantic import BaseModel, Field

from velodrome.engines.engine import REFERENCE, Problem, Settings, Trajectory, UnsuitableProblem
from velodrome.engines.registry import load_engine
from velodrome.testing import ConformanceReport, check_engine, examine_engine

MEMBERS = ("name", "version", "gives", "settings", "check", "step_noise", "simulate")


def variant(engine: Any = REFERENCE, /, **members: Any) -> Any:
    """An engine, or an installed one, with other members."""
    inner = load_engine(engine) if isinstance(engine, str) else engine
    return SimpleNamespace(**{name: getattr(inner, name) for name in MEMBERS} | members)


def said(report: ConformanceReport, name: str) -> str:
    assert report[name].outcome == "failed", report
    return "\n".join(report[name].found)


@pytest.mark.parametrize("member", MEMBERS)
def test_what_lacks_a_member_is_no_engine(member: str) -> None:
    engine = variant()
    delattr(engine, member)
    report = examine_engine(engine)
    assert [check.name for check in report.checks] == ["protocol"]
    assert f"its {member} cannot be read" in said(report, "protocol")


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"name": "my engine"}, "its name is 'my engine'"),
        ({"version": ""}, "its version is ''"),
        ({"gives": ["gap"]}, "its gives is a list"),
        ({"gives": ("gap", "forces")}, "its gives lists 'forces'"),
        ({"settings": dict}, "must be a subclass"),
        ({"simulate": lambda problem: None}, "its simulate does not take 3 arguments"),
    ],
)
def test_members_of_other_types_are_told(members: dict[str, Any], words: str) -> None:
    assert words in said(examine_engine(variant(**members)), "protocol")


def test_an_engine_that_is_not_installed_is_said_to_be_none() -> None:
    assert "'warp' is not installed" in said(examine_engine("warp"), "protocol")


class LooseSettings(BaseModel):
    """Of a stranger who does not know `Settings`."""

    step: float = 1e-3
    method: str = Field("best", description="how")


class NeedySettings(Settings):
    """Without a default."""

    step: float


def test_settings_without_bounds_and_units_are_told() -> None:
    words = said(examine_engine(variant(settings=LooseSettings)), "settings")
    for what in (
        "an unknown setting is accepted",
        "step has no description",
        "step may be nan",
        "step has no lower bound",
        "does not say its unit",
        "an instance can be changed",
        "no refined(factor)",
    ):
        assert what in words
    assert "have no defaults" in said(examine_engine(variant(settings=NeedySettings)), "settings")


@pytest.mark.parametrize("noise", [0.0, 1e-3, float("nan"), "small"])
def test_a_step_noise_that_is_none_is_told(noise: Any) -> None:
    report = examine_engine(variant(step_noise=lambda settings: noise))
    assert "its step_noise is" in said(report, "settings")
    assert [check.name for check in report.failed] == ["settings"]


def test_settings_that_are_refused_are_the_callers_mistake() -> None:
    with pytest.raises(ValueError, match="exudyn refuses the settings"):
        check_engine("exudyn", {"step": 0.0})
    assert check_engine("exudyn", {"step": 0.002}).settings["step"] == 0.002


@pytest.mark.parametrize(
    ("deed", "words"),
    [
        (lambda: sys.exit(3), "it called sys.exit(3)"),
        (lambda: os.chdir("/nowhere"), "FileNotFoundError"),
        (lambda: [][1], "IndexError"),
    ],
)
def test_an_engine_that_breaks_fails_and_ends_nothing(deed: Any, words: str) -> None:
    report = examine_engine(variant(simulate=lambda problem, settings, progress: deed()))
    assert words in said(report, "ride on plane")


def test_what_an_engine_prints_is_not_on_stdout(capsys: pytest.CaptureFixture[str]) -> None:
    inner = load_engine(REFERENCE)

    def loud(problem: Problem, settings: Any, progress: Any) -> Trajectory:
        print("solved")
        return inner.simulate(problem, settings, progress)

    assert check_engine(variant(simulate=loud)).passed
    assert capsys.readouterr().out == ""


def test_wrong_time_stamps_are_told() -> None:
    engine = plant("exudyn", reported(lambda trajectory, *_: {"time": trajectory.time * (1 + 1e-6)}))
    assert "its sample 1 is at 0.012000012 s by its own clock" in said(examine_engine(engine), "ride on plane")


def test_a_ride_that_remembers_the_one_before_is_told() -> None:
    inner, rides = load_engine(REFERENCE), []

    def remember(problem: Problem, settings: Any, progress: Any) -> Trajectory:
        rides.append(problem)
        found = inner.simulate(problem, settings, progress)
        return replace(found, q=found.q + 1e-15 * len(rides))

    assert "its q differs by" in said(examine_engine(variant(simulate=remember)), "same bits")


def test_what_is_listed_and_not_given_is_told() -> None:
    engine = plant("exudyn", reported(lambda *_: {"slip": None}))
    assert "it lists slip in gives, and gives None" in said(examine_engine(engine), "ride on plane")


def test_forces_that_are_no_numbers_are_told() -> None:
    engine = plant("exudyn", changed("contact_force", by=lambda force: np.nan * force))
    report = examine_engine(engine)
    assert "not finite in some samples: contact_force" in said(report, "ride on plane")
    assert "nan" not in str(report)


def test_an_engine_of_single_precision_may_conform() -> None:
    """Coordinates, rates and poses of 24 bits, from steps that say so."""

    def single(trajectory: Trajectory, *_: Any) -> dict[str, Any]:
        names = ("q", "qd", "body_position", "body_quaternion")
        return {name: getattr(trajectory, name).astype(np.float32).astype(float) for name in names}

    engine = plant("mujoco-multipliers", reported(single))
    check_engine(variant(engine, step_noise=lambda settings: 2.0**-23))
    assert examine_engine(engine).failed


def test_progress_that_falls_is_told() -> None:
    inner = load_engine(REFERENCE)

    def backwards(problem: Problem, settings: Any, progress: Any) -> Trajectory:
        progress(0.1)
        progress(0.05)
        return inner.simulate(problem, settings, lambda _: None)

    assert "progress must rise" in said(examine_engine(variant(simulate=backwards)), "ride on plane")


def test_refusals_are_judged() -> None:
    def with_check(check: Any) -> str:
        engine = variant("exudyn", check=check)
        return said(examine_engine(engine), "refusals")

    def fixed(kind: type[Exception], words: str) -> Any:
        def check(problem: Problem, settings: Any) -> None:
            if not np.isclose(problem.times[1], 0.012):
                raise kind(words)
            if not hasattr(problem.surface, "alpha"):
                return
            raise UnsuitableProblem("no bowls here; a plane would do")

        return check

    assert "must say in one line" in with_check(fixed(ValueError, "no\nsuch times"))
    assert "are no UnsuitableProblem" in with_check(fixed(UnsuitableProblem, "no such times"))
    assert "check raises TypeError" in with_check(fixed(TypeError, "what?"))
    # Times are accepted, and the ride refuses them.
    assert "and the ride fails: ValueError" in with_check(lambda problem, settings: None)

    def all_grounds(problem: Problem, settings: Any) -> None:
        raise ValueError("not today")

    engine = variant("exudyn", check=all_grounds)
    assert "a ground that it does not know is an UnsuitableProblem" in said(examine_engine(engine), "grounds")


def test_samples_between_steps_are_held_to_their_times() -> None:
    """An engine that takes any output times and gives the nearest step's samples."""
    inner = load_engine("exudyn")

    def check(problem: Problem, settings: Any) -> None:
        pass

    def nearest(problem: Problem, settings: Any, progress: Any) -> Trajectory:
        times = np.round(problem.times[1] / settings.step) * settings.step * np.arange(len(problem.times))
        return replace(inner.simulate(replace(problem, times=times), settings, progress), time=problem.times)

    engine = variant("exudyn", check=check, simulate=nearest)
    report = examine_engine(engine)
    assert "samples between its steps are off by" in said(report, "refusals")
    assert [one.name for one in report.failed] == ["refusals"]


def test_a_changed_process_is_told() -> None:
    inner = load_engine(REFERENCE)

    def careless(problem: Problem, settings: Any, progress: Any) -> Trajectory:
        np.seterr(invalid="ignore")
        return inner.simulate(problem, settings, progress)

    before = np.geterr()
    try:
        assert "it changed numpy's handling of errors" in said(
            examine_engine(variant(simulate=careless)), "surroundings"
        )
    finally:
        np.seterr(**before)


def test_changed_environment_variables_are_named_without_their_values(monkeypatch: pytest.MonkeyPatch) -> None:
    inner = load_engine(REFERENCE)
    monkeypatch.setenv("CHANGED_BY_A_RIDE", "old")
    monkeypatch.setenv("REMOVED_BY_A_RIDE", "old")
    monkeypatch.delenv("SET_BY_A_RIDE", raising=False)

    def careless(problem: Problem, settings: Any, progress: Any) -> Trajectory:
        monkeypatch.setenv("CHANGED_BY_A_RIDE", "secret")
        monkeypatch.setenv("SET_BY_A_RIDE", "secret")
        monkeypatch.delenv("REMOVED_BY_A_RIDE", raising=False)
        return inner.simulate(problem, settings, progress)

    words = said(examine_engine(variant(simulate=careless)), "surroundings")
    names = "CHANGED_BY_A_RIDE, REMOVED_BY_A_RIDE, SET_BY_A_RIDE"
    assert f"it changed the environment variables: {names}" in words
    assert "imported" in words
    assert "secret" not in words


STRANGER = """
import numpy, numba, mujoco, exudyn, os, signal, sys
def state():
    return (numba.config.CACHE_DIR, numba.config.THREADING_LAYER, numba.get_num_threads(), numpy.geterr(), os.getcwd(),
            mujoco.get_mju_user_warning(), mujoco.get_mjcb_control(), dict(os.environ), signal.getsignal(signal.SIGINT),
            exudyn.special.solver.timeout, exudyn.special.exceptions.dictionaryVersionMismatch, sys.stdout)
before = state()
from velodrome.testing import check_engine
for name in sys.argv[1:]:
    report = check_engine(name)
    print(report.engine, report.passed)
changed = [(old, new) for old, new in zip(before, state()) if old != new]
assert not changed, changed
"""


@pytest.mark.parametrize(
    "names",
    [
        # One engine of each library, and the one of MuJoCo's that installs the most callbacks.
        pytest.param(("exudyn", "mujoco-exact-contact"), id="one of each"),
        pytest.param(("mujoco-multipliers", "mujoco-native"), id="further", marks=pytest.mark.slow),
    ],
)
def test_a_strangers_process_is_as_before(names: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "engines").mkdir()
    (tmp_path / "engines" / "__init__.py").write_text("raise RuntimeError('the stranger has engines too')")
    (tmp_path / "script.py").write_text(STRANGER)
    command = [sys.executable, "script.py", *names]
    found = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert found.returncode == 0, found.stderr
    assert found.stdout.splitlines() == [f"{name} True" for name in names]
