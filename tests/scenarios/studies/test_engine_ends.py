"""Where engines' own stable sections end, as `velodrome bifurcations --engine` says."""

import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bifurcations.hopf import HopfPoint, find_hopf_points, section_hopf_points
from velodrome.reference.families import trace
from velodrome.reference.surface import Paraboloid
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.studies.engine_ends import configure_steps, measure_engine_ends


@pytest.fixture(scope="module")
def fast_end() -> HopfPoint:
    return section_hopf_points(trace(Bicycle(), Paraboloid(1 / 200), 2))[1]


def test_ends_of_engines_and_why_there_are_none(fast_end: HopfPoint) -> None:
    watched = []
    riders = configure_steps(["mujoco-native"], [0.01])
    own, native = measure_engine_ends([fast_end], riders, lambda *done: watched.append(done))
    assert (own.engine, own.hopf, own.step, own.order, own.failed_because) == ("reference", 0, 0.01, 2, None)
    assert own.shift is not None
    assert own.law is not None
    # The next power of the step, relative.
    assert own.shift == pytest.approx(own.law, rel=20 * 0.01)
    assert own.rear_rate == pytest.approx(fast_end.motion.rear_rate + own.shift, abs=1e-12)
    assert own.frequency == pytest.approx(fast_end.frequency, abs=0.05)
    assert native.rear_rate is native.shift is native.law is None
    assert "the bicycle fell" in (native.failed_because or "")  # contacts that are as soft as at 10 ms
    assert watched[0] == ("reference", 0, 1, "ends")
    assert watched[-1] == ("mujoco-native", 1, 1, "ends")


def test_points_that_end_nothing_are_left_out() -> None:
    points = find_hopf_points(trace(Bicycle(), Paraboloid(1 / 200), 2))
    other = next(point for point in points if not point.ends_section)
    assert measure_engine_ends([other], configure_steps(["reference"], [0.01]), lambda *_: None) == []


@pytest.mark.parametrize(("wanted", "step", "said"), [("exudin", 0.01, "exudyn"), ("exudyn", 0.5, "step")])
def test_bad_input_is_refused_before_anything_is_computed(wanted: str, step: float, said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        configure_steps([wanted], [step])
