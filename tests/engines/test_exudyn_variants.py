"""The ways to roll in Exudyn side by side: true constraints, the library's disc on a following plane, and as it is."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from pydantic import ValidationError

from velodrome.engines.engine import Problem, Trajectory
from velodrome.engines.exudyn.engine import BUILTIN, ENGINE, PLANE_NORMAL, ExudynEngine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.simulate import PreciseMotion, simulate
from velodrome.reference.surface import Paraboloid, Plane, Surface
from velodrome.reports.measure.convergence import extrapolate

RATE = 18.0  # rear wheel [rad/s], the fastest rate
STEPS = (4e-3, 2e-3, 1e-3, 5e-4)
LEVEL: Surface = Plane()
BOWL: Surface = Paraboloid(0.005)


@cache
def task(surface: Surface, duration: float = 1.0) -> Problem:
    """A disturbed ride at strong lean, near the circular motion Q2 of the bowl."""
    q, qd = consistent_state(Bicycle(), surface, (0.986, 2.148), 0.7, 2.83, (0.1, 0.0, RATE))
    return Problem(Bicycle(), surface, q, qd, np.arange(round(10 * duration) + 1) / 10)


@cache
def exact(surface: Surface, duration: float = 1.0) -> PreciseMotion:
    problem = task(surface, duration)
    return simulate(problem.bicycle, problem.surface, problem.q, problem.qd, problem.times, tolerance=1e-14)


@cache
def run(engine: ExudynEngine, surface: Surface, step: float, duration: float = 1.0, **settings) -> Trajectory:
    chosen = engine.settings.model_validate({"step": step, **settings})
    result = engine.simulate(task(surface, duration), chosen, lambda _time: None)
    assert result.ended is None
    return result


def furthest(q: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(q[:, :3] - other[:, :3], axis=1).max())


def force_error(result: Trajectory, force: np.ndarray) -> np.ndarray:
    assert result.contact_force is not None
    return (np.linalg.norm(result.contact_force - force, axis=2) / np.linalg.norm(force, axis=2)).max(axis=1)


# Errors C h^2 (1 + k h + ...) fall by 4 (1 +- k h) when the step h is halved.
@pytest.mark.parametrize(("engine", "surface"), [(PLANE_NORMAL, BOWL), (PLANE_NORMAL, LEVEL), (BUILTIN, LEVEL)])
@pytest.mark.parametrize("solver", ["generalized-alpha", "trapezoidal-index2"])
def test_discs_converge_to_the_reference(engine, surface, solver) -> None:
    there = exact(surface).q
    coarse, fine = (furthest(run(engine, surface, step, solver=solver).q, there) for step in STEPS[1:3])
    assert coarse / fine == pytest.approx(4, rel=RATE * 2e-3)


def test_constraints_converge_with_the_trapezoidal_rule() -> None:
    there = exact(BOWL)
    runs = [run(ENGINE, BOWL, step, solver="trapezoidal-index2") for step in STEPS[1:3]]
    coarse, fine = (furthest(result.q, there.q) for result in runs)
    assert coarse / fine == pytest.approx(4, rel=RATE * 2e-3)
    # Velocities are constrained from the start on, so are the multipliers' errors of second order.
    coarse, fine = (force_error(result, there.force).max() for result in runs)
    assert coarse / fine == pytest.approx(4, rel=RATE * 2e-3)


@pytest.mark.parametrize("policy", ["iteration", "reuse"])
def test_jacobian_policies_agree(policy) -> None:
    """All solve the same equations: they differ by what Newton's method leaves of them."""
    usual = run(ENGINE, BOWL, 2e-3)
    other = run(ENGINE, BOWL, 2e-3, jacobian=policy)
    assert furthest(other.q, usual.q) < 1e-11 * usual.steps * 0.094 * 9.81 * 2


def test_on_the_plane_a_following_normal_changes_nothing() -> None:
    following, fixed = (run(engine, LEVEL, 2e-3) for engine in (PLANE_NORMAL, BUILTIN))
    np.testing.assert_array_equal(following.q, fixed.q)
    assert following.contact_force is not None
    assert fixed.contact_force is not None
    np.testing.assert_array_equal(following.contact_force, fixed.contact_force)


def test_discs_drift_off_the_ground_and_constraints_do_not() -> None:
    free = [run(PLANE_NORMAL, BOWL, step).gap for step in STEPS[1:3]]
    held = run(ENGINE, BOWL, 2e-3).gap
    assert held is not None
    sizes = [float(np.abs(gap).max()) for gap in free if gap is not None]
    # A constraint on velocities keeps positions up to the method's error.
    assert sizes[0] / sizes[1] == pytest.approx(4, rel=RATE * 2e-3)
    # The gap is a difference of coordinates of some three metres: a few tens of their round-off.
    assert np.abs(held).max() < 30 * 3 * np.finfo(float).eps


@pytest.mark.parametrize(("duration", "steps"), [(1.0, STEPS[:3]), pytest.param(10.0, STEPS, marks=pytest.mark.slow)])
def test_limits_on_the_plane_are_the_same(duration, steps) -> None:
    """At strong lean, the joint of this suite and the library's own."""
    there = exact(LEVEL, duration).q
    limits = []
    for engine in (ENGINE, BUILTIN):
        runs = [run(engine, LEVEL, step, duration, newton_relative_tolerance=1e-12).q for step in steps]
        errors = [furthest(q, there) for q in runs]
        limits.append(extrapolate([q[:, :3] for q in runs]).value)
        # Each extrapolation takes k h of the finest error.
        assert furthest(limits[-1], there) < (RATE * steps[0]) ** (len(steps) - 1) * errors[-1]
    assert furthest(*limits) < 1e-7


@pytest.mark.parametrize(("engine", "surface"), [(PLANE_NORMAL, BOWL), (BUILTIN, LEVEL)])
def test_runs_are_bitwise_identical(engine, surface) -> None:
    problem, settings = task(surface), engine.settings.model_validate({"step": 4e-3})
    again = engine.simulate(problem, settings, lambda _time: None)
    np.testing.assert_array_equal(again.q, run(engine, surface, 4e-3).q)


def test_builtin_refuses_a_bowl() -> None:
    with pytest.raises(ValueError, match=r"^it rolls on the level plane only[^\n]*$"):
        BUILTIN.check(task(BOWL), BUILTIN.settings())
    BUILTIN.check(task(LEVEL), BUILTIN.settings())


def test_discs_have_no_corrected_start() -> None:
    with pytest.raises(ValidationError, match="start"):
        PLANE_NORMAL.settings.model_validate({"start": "second-order"})


@pytest.mark.parametrize("engine", [ENGINE, PLANE_NORMAL, BUILTIN])
def test_settings_are_explained(engine) -> None:
    assert all(field.description for field in engine.settings.model_fields.values())
