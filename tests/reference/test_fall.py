"""Where a ride ends at a fall: the time is solved, and nothing before it changes."""

from __future__ import annotations

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.fall import FALLEN_HEIGHT, heights_above_fallen, solve_fall
from velodrome.reference.kinematics import body_positions
from velodrome.reference.simulate import PreciseMotion, simulate, simulate_modified_euler
from velodrome.reference.surface import Paraboloid, Plane, Surface, evaluate

BICYCLE = Bicycle()
GROUNDS: dict[str, Surface] = {"plane": Plane(), "bowl": Paraboloid(0.05)}


def pushed(surface: Surface, lean_rate: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A start of an unstable upright ride that falls within some two seconds."""
    return consistent_state(BICYCLE, surface, (0.1, 0.2), 0.3, 0.1, (lean_rate, 0.0, 6.0))


def ride(surface: Surface, rate: float, until_fall: bool, duration: float = 3.0) -> PreciseMotion:
    times = np.arange(round(duration * rate) + 1) / rate
    return simulate(BICYCLE, surface, *pushed(surface), times, until_fall=until_fall)


@pytest.mark.parametrize("ground", GROUNDS)
def test_height_and_rate_are_those_of_the_centre_of_mass(ground: str) -> None:
    surface = GROUNDS[ground]
    motion = ride(surface, 100.0, until_fall=True)
    height, rate = heights_above_fallen(BICYCLE, surface, motion.q, motion.qd)
    centre = body_positions(BICYCLE, motion.q)[:, 0]
    expected = centre[:, 2] - evaluate(surface, centre[:, 0], centre[:, 1])[:, 0] - FALLEN_HEIGHT * BICYCLE.rear_frame_z
    assert height == pytest.approx(expected, abs=1e-14)
    # Central differences of heights along a direction, exact to the square of their step.
    step = 1e-6
    ahead, behind = (
        heights_above_fallen(BICYCLE, surface, motion.q + s * motion.qd, motion.qd)[0] for s in (step, -step)
    )
    assert rate == pytest.approx((ahead - behind) / (2 * step), abs=1e-8)


@pytest.mark.parametrize("ground", GROUNDS)
def test_samples_before_a_fall_are_those_of_a_ride_that_goes_on(ground: str) -> None:
    ended, whole = (ride(GROUNDS[ground], 40.0, until_fall) for until_fall in (True, False))
    n = len(ended.time)
    assert 1 < n < len(whole.time)
    for name in ("time", "q", "qd", "contact", "force"):
        assert np.array_equal(getattr(ended, name), getattr(whole, name)[:n])
    height, _ = heights_above_fallen(BICYCLE, GROUNDS[ground], whole.q, whole.qd)
    assert np.flatnonzero(height < 0)[0] == n
    assert ended.steps < whole.steps
    assert ended.ended is not None
    assert ended.ended.startswith("the bicycle fell at t = ")


@pytest.mark.parametrize("ground", GROUNDS)
def test_time_of_a_fall_is_solved(ground: str) -> None:
    """It does not depend on the samples, and is that of a ride sampled at a tiny interval."""
    surface = GROUNDS[ground]
    times = []
    for rate in (3.0, 10.0, 64.0):
        fall = ride(surface, rate, until_fall=True).fall
        assert fall is not None
        heights, rates = heights_above_fallen(BICYCLE, surface, fall.q, fall.qd)
        assert heights[0] > 0 >= heights[1]
        times.append(solve_fall(fall.time, heights, rates))
    assert max(times) - min(times) <= 1e-13
    fine = ride(surface, 2000.0, until_fall=False)
    heights, rates = heights_above_fallen(BICYCLE, surface, fine.q, fine.qd)
    k = int(np.flatnonzero(heights < 0)[0])
    around = slice(k - 1, k + 1)
    # The cubic's error is h^4 / 384 times the height's fourth derivative, below 1e4 m/s^4 here, over a rate of 1 m/s.
    assert solve_fall(fine.time[around], heights[around], rates[around]) == pytest.approx(times[0], abs=2e-12)


def test_the_paper_s_method_converges_to_the_time_of_the_fall() -> None:
    exact = ride(Plane(), 10.0, until_fall=True).fall
    assert exact is not None
    fell = solve_fall(exact.time, *heights_above_fallen(BICYCLE, Plane(), exact.q, exact.qd))
    errors = []
    for step in (4e-3, 2e-3, 1e-3):
        fall = simulate_modified_euler(
            BICYCLE, Plane(), *pushed(Plane()), np.arange(31) / 10 * 0.8, step=step, until_fall=True
        ).fall
        assert fall is not None
        errors.append(abs(solve_fall(fall.time, *heights_above_fallen(BICYCLE, Plane(), fall.q, fall.qd)) - fell))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    # Of second order; the next term of the error changes it by the ratio of its share at these steps.
    assert orders == pytest.approx(2.0, abs=0.2)


def test_a_ride_that_stands_does_not_end() -> None:
    motion = simulate(BICYCLE, Plane(), *pushed(Plane(), 0.0), np.array([0.0, 0.2]), until_fall=True)
    assert motion.fall is None
    assert motion.ended is None
    assert len(motion.time) == 2


def test_a_start_that_lies_is_a_fall_at_once() -> None:
    q, qd = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 1.5, 0.0, (0.0, 0.0, 0.0))
    motion = simulate(BICYCLE, Plane(), q, qd, np.arange(11) / 10, until_fall=True)
    assert len(motion.time) == 1
    assert motion.fall is not None
