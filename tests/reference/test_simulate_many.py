"""Rides of many starts in one call: each has the bits that it has alone."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Sphere
from velodrome.reference.dae import consistent_state
from velodrome.reference.fall import Fall
from velodrome.reference.inputs import Inputs
from velodrome.reference.simulate import PreciseMotion, RideStart, simulate, simulate_many
from velodrome.reference.surface import Paraboloid, Plane, Surface

BICYCLE = Bicycle()
TIMES = np.arange(11) / 10
GROUNDS: list[Surface] = [Plane(), Paraboloid(0.005), Paraboloid(0.01), Sphere(40.0)]
INPUTS = [Inputs(), Inputs(steer_torque=0.1, steer_damping=0.5)]
BICYCLES = [BICYCLE, replace(BICYCLE, trail=0.06), replace(BICYCLE, rear_frame_mass=70.0)]


def make_start(
    lean: float, rate: float, ground: int = 0, inputs: int = 0, bicycle: int = 0, until_fall: bool = False
) -> RideStart:
    surface, own = GROUNDS[ground], BICYCLES[bicycle]
    q, qd = consistent_state(own, surface, (0.5, 0.2), lean, 0.02, (0.0, 0.1, rate))
    return RideStart(own, surface, q, qd, INPUTS[inputs], until_fall)


def ride_alone(start: RideStart, times: np.ndarray = TIMES) -> PreciseMotion:
    return simulate(
        start.bicycle, start.surface, start.q, start.qd, times, inputs=start.inputs, until_fall=start.until_fall
    )


def assert_same_bits(found: PreciseMotion | ValueError, alone: PreciseMotion) -> None:
    assert isinstance(found, PreciseMotion)
    for field in fields(PreciseMotion):
        here, there = getattr(found, field.name), getattr(alone, field.name)
        if isinstance(here, Fall):
            assert isinstance(there, Fall)
            assert all(getattr(here, name).tobytes() == getattr(there, name).tobytes() for name in ("time", "q", "qd"))
        else:
            assert here.tobytes() == there.tobytes() if isinstance(here, np.ndarray) else here == there, field.name


STARTS = st.builds(
    make_start,
    st.floats(-0.3, 0.3),
    st.floats(3.0, 25.0),
    st.integers(0, len(GROUNDS) - 1),
    st.integers(0, len(INPUTS) - 1),
    st.integers(0, len(BICYCLES) - 1),
    st.booleans(),
)


@settings(max_examples=8, deadline=None)
@given(st.lists(STARTS, min_size=1, max_size=6), st.integers(1, 3))
def test_rides_in_a_batch_have_the_bits_of_single_rides(starts: list[RideStart], threads: int) -> None:
    for start, found in zip(starts, simulate_many(starts, TIMES, threads=threads), strict=True):
        assert_same_bits(found, ride_alone(start))


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(st.lists(STARTS, min_size=1, max_size=12), st.integers(1, 4), st.randoms())
def test_order_and_threads_change_no_bit(starts: list[RideStart], threads: int, random) -> None:
    times = np.arange(51) / 10
    order = list(range(len(starts)))
    random.shuffle(order)
    found = simulate_many([starts[i] for i in order], times, threads=threads)
    for i, motion in zip(order, found, strict=True):
        assert_same_bits(motion, ride_alone(starts[i], times))


def test_progress_changes_no_bit() -> None:
    start, seen = make_start(0.1, 15.0, 1), list[float]()
    times = np.arange(101) / 5
    watched = simulate(start.bicycle, start.surface, start.q, start.qd, times, progress=seen.append)
    assert_same_bits(watched, ride_alone(start, times))
    assert len(seen) > 1
    assert seen[-1] == times[-1]


def test_a_refused_start_does_not_cost_the_others_their_rides() -> None:
    good = make_start(0.1, 15.0, 1)
    lost = replace(good, q=np.full(9, np.nan))
    sunk = replace(good, q=good.q - np.array([0, 0, 0.05, 0, 0, 0, 0, 0, 0]))
    found = simulate_many([lost, good, sunk], TIMES)
    assert_same_bits(found[1], ride_alone(good))
    for start, slot in ((lost, found[0]), (sunk, found[2])):
        with pytest.raises(ValueError, match=r"no contact point|inside the ground") as alone:
            ride_alone(start)
        assert isinstance(slot, ValueError)
        assert str(slot) == str(alone.value)


def test_a_ride_that_ends_early_ends_alone() -> None:
    """A bicycle that lies flat has singular equations; its neighbour rides on."""
    flat, good = make_start(1.45, 5.0), make_start(0.0, 20.0)
    times = np.arange(41) / 10
    ended, whole = simulate_many([flat, good], times)
    assert isinstance(ended, PreciseMotion)
    assert isinstance(whole, PreciseMotion)
    assert whole.ended is None
    assert len(whole.time) == len(times)
    assert_same_bits(ended, ride_alone(flat, times))


def test_a_ride_ends_at_its_fall_alone_and_among_others() -> None:
    falling, good = make_start(0.4, 5.0, until_fall=True), make_start(0.0, 20.0, until_fall=True)
    times = np.arange(41) / 10
    fallen, whole = simulate_many([falling, good], times)
    assert isinstance(fallen, PreciseMotion)
    assert fallen.fall is not None
    assert_same_bits(fallen, ride_alone(falling, times))
    assert_same_bits(whole, ride_alone(good, times))
