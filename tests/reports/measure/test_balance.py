"""The energy balance under inputs: the work of torques and of steer damping from a ride's samples alone."""

from dataclasses import replace

import numpy as np
import pytest

from velodrome.engines.engine import Problem, Trajectory
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.inputs import NO_INPUTS, Inputs
from velodrome.reference.kinematics import REAR_ANGLE, STEER
from velodrome.reference.surface import Plane
from velodrome.reports.measure import compute_metrics, conserved_energy, evaluate_ride, measure_work

BICYCLE = Bicycle()
ALL = Inputs(steer_torque=0.3, rear_wheel_torque=5.0, steer_damping=1.0)


def swinging(time: np.ndarray, rate: float = 7.0, decay: float = 0.5) -> Trajectory:
    """A steer exp(-decay t) sin(rate t), all else at rest but a turning rear wheel."""
    q, qd = np.zeros((2, len(time), 9))
    fall = np.exp(-decay * time)
    q[:, STEER] = fall * np.sin(rate * time)
    qd[:, STEER] = fall * (rate * np.cos(rate * time) - decay * np.sin(rate * time))
    q[:, REAR_ANGLE], qd[:, REAR_ANGLE] = 20 * time, 20.0
    return Trajectory(
        engine="closed form",
        version="",
        settings={},
        time=time,
        q=q,
        qd=qd,
        body_position=np.zeros((len(time), 4, 3)),
        body_quaternion=np.zeros((len(time), 4, 4)),
        steps=1,
        cpu_time=0.0,
    )


def integral(time: np.ndarray, rate: float, decay: float) -> np.ndarray:
    """The integral of the squared steer rate of `swinging` from 0."""

    def antiderivative(t: np.ndarray) -> np.ndarray:
        # The squared rate is exp(-2 decay t) (a + b cos(2 rate t) + c sin(2 rate t)): a sum of exponentials.
        a, b = (rate**2 + decay**2) / 2, (rate**2 - decay**2) / 2
        z = -2 * decay + 2j * rate
        return np.real(-a / (2 * decay) * np.exp(-2 * decay * t) + (b + 1j * rate * decay) / z * np.exp(z * t))

    return antiderivative(time) - antiderivative(np.zeros(1))


@pytest.mark.parametrize("interval", [0.01, 0.02, 0.05])
def test_the_damping_takes_what_the_integral_in_closed_form_says(interval: float) -> None:
    time = interval * np.arange(round(3 / interval) + 1)
    done = measure_work(swinging(time), Inputs(steer_damping=2.0))
    exact = -2.0 * integral(time, 7.0, 0.5)
    off = np.abs(done.work - exact).max()
    assert np.abs(exact).max() > 30
    # What is said of the error bounds it, up to round-off of the sum.
    assert off <= done.error + 1e-15 * len(time) * np.abs(exact).max()
    assert done.error < 1e-5 * np.abs(exact).max()


def test_the_error_of_the_damping_falls_with_the_order_that_is_said() -> None:
    """The steer rate of the polynomials is of order 11, and so is the integral at least."""
    errors = []
    for interval in (0.2, 0.1):
        time = interval * np.arange(round(3 / interval) + 1)
        work = measure_work(swinging(time), Inputs(steer_damping=2.0)).work
        errors.append(np.abs(work + 2.0 * integral(time, 7.0, 0.5)).max())
    assert np.log2(errors[0] / errors[1]) > 9.5  # with the ends' one-sided polynomials, not yet at its limit


def test_uneven_samples_and_few_of_them_are_integrated() -> None:
    time = np.sort(np.random.default_rng(3).uniform(0, 1, 60))
    time[0] = 0.0
    work = measure_work(swinging(time), Inputs(steer_damping=2.0)).work
    assert np.abs(work + 2.0 * integral(time, 7.0, 0.5)).max() < 1e-5
    for few in (1, 2, 3):
        short = swinging(0.01 * np.arange(few))
        done = measure_work(short, Inputs(steer_damping=2.0))
        assert np.abs(done.work + 2.0 * integral(short.time, 7.0, 0.5)).max() < 1e-4 * 0.01 * few * 49


def test_torques_do_the_work_of_their_angles_and_whole_turns_do_not_matter() -> None:
    ride = swinging(np.linspace(0, 2, 201))
    inputs = Inputs(steer_torque=0.5, rear_wheel_torque=3.0)
    expected = 0.5 * ride.q[:, STEER] + 3.0 * 20 * ride.time
    wrapped = ride.q.copy()
    wrapped[:, REAR_ANGLE] = (wrapped[:, REAR_ANGLE] + np.pi) % (2 * np.pi) - np.pi
    for one in (ride, replace(ride, q=wrapped)):
        np.testing.assert_allclose(measure_work(one, inputs).work, expected, rtol=1e-13, atol=1e-13)
    assert measure_work(ride, NO_INPUTS).work.tolist() == [0.0] * 201


def driven(inputs: Inputs, engine: str = "reference", interval: float = 0.02) -> Trajectory:
    q, qd = consistent_state(BICYCLE, Plane(), (1.0, 0.0), 0.05, 0.1, (0.2, 0.0, 16.0))
    problem = Problem(BICYCLE, Plane(), q, qd, interval * np.arange(round(1 / interval) + 1), inputs)
    loaded = load_engine(engine)
    return evaluate_ride(loaded.simulate(problem, loaded.settings(), lambda _: None), BICYCLE, Plane())


@pytest.mark.parametrize(
    "inputs",
    [Inputs(0.3), Inputs(rear_wheel_torque=5.0), Inputs(steer_damping=1.0), ALL],
    ids=["steer", "rear wheel", "damping", "all"],
)
def test_the_balance_of_the_reference_closes_to_its_tolerance(inputs: Inputs) -> None:
    ride = driven(inputs)
    balance = conserved_energy(ride, inputs)
    assert balance is not None
    assert ride.kinetic_energy is not None
    assert ride.potential_energy is not None
    energy = ride.kinetic_energy + ride.potential_energy
    # Some hundred steps of a tolerance of 1e-13; the energy itself changes by far more.
    assert np.abs(balance - balance[0]).max() < 1e-11 * balance[0]
    assert np.abs(energy - energy[0]).max() > 1e-5 * balance[0]
    metrics = compute_metrics(ride, None, BICYCLE, Plane(), 0.0, 1.0, False, inputs=inputs)
    assert metrics["energy_drift"] < 1e-11
    without = compute_metrics(ride, None, BICYCLE, Plane(), 0.0, 1.0, False)
    assert without["energy_drift"] > 1e-5


def test_no_drift_is_below_the_error_of_the_dampings_work() -> None:
    """Five samples a second do not resolve the steering: what is left is no drift of the reference's."""
    inputs = Inputs(steer_damping=1.0)
    ride = driven(inputs, interval=0.2)
    done = measure_work(ride, inputs)
    metrics = compute_metrics(ride, None, BICYCLE, Plane(), 0.0, 1.0, False, inputs=inputs)
    balance = conserved_energy(ride, inputs)
    assert balance is not None
    left = np.abs(balance - balance[0]).max()
    assert 1e-12 < left / balance[0] < done.error / balance[0]
    assert metrics["energy_drift"] == done.error / balance[0]
    assert metrics["energy_variation"] == 100 * done.error / balance[0]
    assert metrics["energy_drift_rate"] is None
