"""Every engine ends a ride where the bicycle falls, and its time is solved within a step."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.wrapped import WrappedEngine
from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import EngineError, Problem, Progress, Trajectory
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.surface import Paraboloid
from velodrome.reports.measure import fell_at

BICYCLE, BOWL = Bicycle(), Paraboloid(0.05)
# Orders of the methods. The contacts of MuJoCo and Drake are soft or slide, so their falls converge to other times.
ORDERS = {"exudyn": 2.0, "exudyn-plane-normal": 2.0, "mujoco-multipliers": 4.0}
OPTIONAL_ORDERS = {"pinocchio-constraint": 4.0, "mjx-multipliers": 4.0, "drake-multipliers": 3.0}
EACH = [*ORDERS, *(pytest.param(name, marks=pytest.mark.engines) for name in OPTIONAL_ORDERS)]


@cache
def falling() -> Problem:
    """A leaning bicycle that falls within 0.35 s; outputs are 32 ms apart."""
    start = consistent_state(BICYCLE, BOWL, (0.1, 0.2), 0.6, 0.1, (1.5, 0.0, 6.0))
    return Problem(BICYCLE, BOWL, *start, 0.032 * np.arange(16))


@cache
def ride(name: str, step: float | None = None, beyond_fall: bool = False) -> Trajectory:
    engine = load_engine(name)
    settings = engine.settings.model_validate({} if step is None else {"step": step})
    return ride_engine(engine, replace(falling(), beyond_fall=beyond_fall), settings, lambda _: None)


def find_fall(trajectory: Trajectory) -> float:
    time = fell_at(trajectory, BICYCLE, BOWL)
    assert time is not None
    return time


@pytest.mark.parametrize("name", EACH)
def test_the_time_of_a_fall_converges_with_the_order_of_the_method(name: str) -> None:
    """The cubic of the height within a step is of order 4 too: with the output interval it would err by 1e-6 s."""
    exact = find_fall(ride("reference"))
    coarse, fine = (abs(find_fall(ride(name, step)) - exact) for step in (4e-3, 2e-3))
    # A next term of the error, relative h / tau, changes the order by (2 ms / tau) / ln 2: 0.4 for a tau of 7 ms.
    assert np.log2(coarse / fine) == pytest.approx((ORDERS | OPTIONAL_ORDERS)[name], abs=0.4)


@pytest.mark.parametrize("name", EACH)
def test_a_ride_before_its_fall_is_that_of_one_that_goes_on(name: str) -> None:
    step = 2e-3
    ended, whole = ride(name, step), ride(name, step, beyond_fall=True)
    n, fall = len(ended.time), ended.fall
    assert 1 < n < len(whole.time)
    for field in ("time", "q", "qd", "body_position", "contact_force"):
        assert np.array_equal(getattr(ended, field), getattr(whole, field)[:n]), field
    assert whole.fall is None
    assert fall is not None
    assert fall.time[1] - fall.time[0] == pytest.approx(step, rel=1e-9)
    assert ended.time[-1] <= find_fall(ended) < whole.time[n]
    assert ended.ended == f"the bicycle fell at t = {find_fall(ended):.6g} s"


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("standing", "its fall is no fall"),
        ("late", "not between its last sample"),
        ("shape", "it must be a Fall with arrays of floats"),
        ("infinite", "are not finite, or their times do not rise"),
    ],
)
def test_a_fall_that_is_none_is_refused(wrong: str, words: str) -> None:
    right = ride("exudyn", 4e-3)
    fall = right.fall
    assert fall is not None
    falls = {
        "standing": replace(fall, q=right.q[:2], qd=right.qd[:2]),
        "late": replace(fall, time=fall.time + 0.1),
        "shape": replace(fall, q=fall.q[:1]),
        "infinite": replace(fall, qd=np.full((2, 9), np.nan)),
    }

    class Claiming(WrappedEngine):
        def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
            return replace(right, fall=falls[wrong])

    engine = load_engine("exudyn")
    with pytest.raises(EngineError, match=words):
        ride_engine(Claiming(engine), falling(), engine.settings.model_validate({"step": 4e-3}), lambda _: None)
