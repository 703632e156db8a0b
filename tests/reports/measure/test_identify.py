"""An engine's own linear system, measured from its flow, against the linearised equations."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from velodrome.engines.engine import Problem, Settings
from velodrome.engines.lagrange import LagrangeSettings
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.families import find_motion
from velodrome.reference.stability import Linearisation, free_eigenvalues, independent, linearise
from velodrome.reference.surface import Paraboloid, Plane
from velodrome.reports.measure.identify import identify
from velodrome.reports.measure.precision import eigenvalue_pairs

BICYCLE = Bicycle()
# alpha, rear rate, family, and the angles where the family has several motions
MOTIONS: dict[str, tuple[float, float, int, tuple[float, float] | None]] = {
    "q1": (0.005, 18.0, 1, None),
    "q2": (0.005, 18.0, 2, (0.74, 2.84)),
    "p1": (0.2, 10.0, 1, None),
    "p2": (0.2, 20.0, 2, None),
    "p3": (0.2, 20.0, 3, None),
    "p4": (0.2, 4.0, 4, None),
}
# Along family 2 in the bowl of Q2, through its stable section (15.28 to 19.31 rad/s) and beyond both ends.
ALONG = {
    f"family 2 at {rate:g}": (0.005, rate, 2, near)
    for rate, near in ((15.0, (0.62, 2.77)), (16.0, (0.66, 2.79)), (19.0, (0.77, 2.86)), (22.0, (0.87, 2.91)))
}


@cache
def motion(name: str) -> tuple[Problem, Linearisation]:
    alpha, rear_rate, family, near = (MOTIONS | ALONG)[name]
    surface = Paraboloid(alpha)
    state = find_motion(BICYCLE, surface, rear_rate, family, near)[1].state()
    return Problem(BICYCLE, surface, *state, np.array([0.0, 1.0])), linearise(BICYCLE, surface, *state)


def error(name: str, engine: str, settings: Settings, levels: int = 3) -> tuple[float, Any]:
    problem, exact = motion(name)
    found = identify(load_engine(engine), settings, problem, levels=levels)
    return float(np.abs(eigenvalue_pairs(exact.eigenvalues, found.eigenvalues) - exact.eigenvalues).max()), found


@pytest.mark.parametrize("name", MOTIONS)
def test_the_precise_flow_has_the_linearised_eigenvalues(name: str) -> None:
    # The stencil's error of sixth order is below 1e-6 at P3, the most nonlinear; the flow's noise of some
    # 1e-13 is divided by disturbances of 1e-3 and grows by what the fastest mode has decayed, e^4.
    assert error(name, "reference", LagrangeSettings(tolerance=1e-11), levels=2)[0] < 2e-6


@pytest.mark.parametrize("name", ["q1", "q2"])
def test_a_method_of_order_two_shows_it_and_tends_to_the_same_eigenvalues(name: str) -> None:
    settings = LagrangeSettings(integrator="modified-euler", step=0.002)
    worst, found = error(name, "reference", settings)
    # The next power of a step of 2 ms times rates of 13 per second: 3 % of the first.
    assert found.order == pytest.approx(2, abs=0.05)
    assert worst < 1e-6


def test_exudyn_has_the_eigenvalues_of_q2() -> None:
    engine = load_engine("exudyn")
    worst, found = error("q2", "exudyn", engine.settings.model_validate({"step": 0.004}))
    assert found.order == pytest.approx(2, abs=0.05)
    assert worst < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS | ALONG)
def test_exudyn_has_the_eigenvalues_of_all_points(name: str) -> None:
    engine = load_engine("exudyn")
    worst, found = error(name, "exudyn", engine.settings.model_validate({"step": 0.002}))
    # Newton's method leaves 1e-10 of a state; divided by a disturbance of 1e-3 and by the decay e^-1.3.
    assert worst < 1e-5
    assert found.order == pytest.approx(2, abs=0.05)


def test_mujocos_soft_contacts_tend_to_the_same_eigenvalues_with_order_one() -> None:
    engine = load_engine("mujoco-native")
    worst, found = error("q1", "mujoco-native", engine.settings.model_validate({}))
    assert found.order == pytest.approx(1, abs=0.05)
    # Three levels remove the first and the second power: the third, (13/s x 2 ms)^3 = 2e-5 of rates of 13/s.
    assert worst < 3e-4


def test_the_weave_of_the_straight_motion_is_meijaards() -> None:
    """On the plane: the free eigenvalues, since a straight motion's zeros split by the root of any noise."""
    rates = (0.0, 0.0, 4.6 / BICYCLE.rear_wheel_radius)
    state = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, rates)
    problem = Problem(BICYCLE, Plane(), *state, np.array([0.0, 1.0]))
    found = identify(load_engine("reference"), LagrangeSettings(tolerance=1e-11), problem, levels=2)
    weave = max(found.eigenvalues, key=lambda value: value.imag)
    exact = max(free_eigenvalues(Plane(), linearise(BICYCLE, Plane(), *state).eigenvalues, 0.0), key=lambda v: v.imag)
    assert weave == pytest.approx(exact, abs=1e-6)
    assert weave == pytest.approx(complex(-0.37797, 3.87284), abs=1e-5)


def test_independent_variables_are_the_linearisations() -> None:
    """In the heading frame: turning the whole motion changes none of them."""
    problem, _ = motion("q1")
    q, qd = problem.q.copy(), problem.qd.copy()
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    q[:2], qd[:2] = turn @ q[:2], turn @ qd[:2]
    q[3] += angle
    assert np.allclose(independent(q, qd), independent(problem.q, problem.qd), rtol=0, atol=1e-13)


def test_a_method_without_a_step_says_so() -> None:
    class Unsteppable(Settings):
        """No step."""

    with pytest.raises(ValueError, match="no step"):
        Unsteppable().refined(0.5)
