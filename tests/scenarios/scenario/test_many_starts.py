"""Starts of many scenarios have the bits and the errors that each scenario's own start has."""

from typing import Any

import numpy as np
import pytest

from velodrome.reference.regularity import require_inertia
from velodrome.reference.stability import growth_rate, linearise
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.scenario import Scenario, Start, load_scenario, make_start, make_starts

COUNT = 12


def draw_scenarios(name: str, ranges: dict[str, tuple[float, float]], count: int = COUNT) -> list[Scenario]:
    """Draw scenarios from a library scenario, with values between bounds by dotted key."""
    rng = np.random.default_rng(0)
    changes = [{key: float(rng.uniform(*bounds)) for key, bounds in ranges.items()} for _ in range(count)]
    return [load_scenario(name, change)[1] for change in changes]


SMALL: dict[str, tuple[float, float]] = {"perturbation.lean": (-0.05, 0.05), "perturbation.steer_rate": (-0.1, 0.1)}
KINDS: dict[str, tuple[str, dict[str, tuple[float, float]]]] = {
    "bowl": ("q2-plus", SMALL),
    "bowls": ("q2-plus", {"surface.alpha": (0.005, 0.0051), "motion.rear_rate": (17.6, 18.4)} | SMALL),
    "plane": ("plane-circle", SMALL | {"perturbation.x": (-0.1, 0.1)}),
    "sphere": ("sphere", SMALL),
    "waves": ("waves", SMALL | {"motion.speed": (3.0, 6.0), "perturbation.y": (-0.1, 0.1)}),
    "far": ("q2-plus", {"perturbation.lean": (-3.0, 3.0), "perturbation.steer": (-3.0, 3.0)}),
}


def start_or_error(scenario: Scenario) -> Start | ScenarioError:
    try:
        return make_start(scenario)
    except ScenarioError as error:
        return error


def list_numbers(start: Start) -> list[np.ndarray]:
    problem, motion = start.problem, start.motion
    found: list[Any] = [*start.undisturbed, problem.q, problem.qd, problem.times, start.growth_rate, start.size]
    return [np.asarray(each) for each in found + ([] if motion is None else [motion.position, motion.force])]


@pytest.mark.parametrize("kind", KINDS)
def test_starts_do_not_depend_on_their_neighbours(kind: str) -> None:
    scenarios = draw_scenarios(*KINDS[kind])
    order = np.random.default_rng(1).permutation(len(scenarios))
    together = make_starts([scenarios[i] for i in order])
    for i, found in zip(order, together, strict=True):
        alone = start_or_error(scenarios[i])
        assert type(alone) is type(found)
        if isinstance(alone, Start) and isinstance(found, Start):
            assert alone.family == found.family
            for one, other in zip(list_numbers(alone), list_numbers(found), strict=True):
                np.testing.assert_array_equal(one, other)
        else:
            assert str(alone) == str(found)


@pytest.mark.parametrize("kind", ["bowl", "plane", "sphere"])
def test_growth_rates_are_those_of_the_linearisation(kind: str) -> None:
    """Both take the same complex steps at states that differ by round-off, 1e-14 times the eigenvalues' condition."""
    for start in make_starts(draw_scenarios(*KINDS[kind], count=3)):
        assert isinstance(start, Start)
        problem = start.problem
        eigenvalues = linearise(problem.bicycle, problem.surface, *start.undisturbed, problem.inputs).eigenvalues
        expected = growth_rate(problem.surface, eigenvalues, float(start.undisturbed[1][3]))
        assert start.growth_rate == pytest.approx(expected, abs=1e-10)


def test_errors_stand_among_starts() -> None:
    scenarios = [load_scenario("q2-plus", {"motion.rear_rate": rate})[1] for rate in (18.0, 3.0, 18.0)]
    first, missing, third = make_starts(scenarios)
    assert isinstance(missing, ScenarioError)
    assert isinstance(first, Start)
    assert isinstance(third, Start)
    np.testing.assert_array_equal(first.problem.q, third.problem.q)


def test_compiled_check_of_inertia_agrees_with_the_exact_one() -> None:
    """A start that compiled code calls clear is one that `require_inertia` accepts."""
    for start in make_starts(draw_scenarios(*KINDS["bowls"])):
        assert isinstance(start, Start)
        require_inertia(start.problem.bicycle, start.problem.surface, start.problem.q)


@pytest.mark.parametrize("trail", [0.0, 1e-14])
def test_a_steering_without_inertia_is_refused(trail: float) -> None:
    """Velocities that are round-off give no inertia: steering moves no mass where there is no trail."""
    light = {f"bicycle.front_frame_{name}": 0.0 for name in ("mass", "Ixx", "Iyy", "Izz", "Ixz")}
    light |= {f"bicycle.{wheel}_wheel_{name}": 0.0 for wheel in ("rear", "front") for name in ("mass", "Ixx", "Iyy")}
    (found,) = make_starts([load_scenario("iftomm-1", light | {"bicycle.trail": trail})[1]])
    assert isinstance(found, ScenarioError)
    assert "no inertia" in str(found)
