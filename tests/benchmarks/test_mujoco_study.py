"""The settings study: MuJoCo's creep against its law, the energy of its integrators, and drifts with confidence."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.mujoco_settings.laws import creep_row, creep_study, energy_study
from benchmarks.mujoco_settings.study import Rate, drift_rate, ride_row, settings_study
from velodrome.engines.engine import Problem
from velodrome.engines.mujoco import exact_contact, native
from velodrome.engines.mujoco.settings import NativeSettings
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.families import find_motion
from velodrome.reference.stability import linearise
from velodrome.reference.surface import Paraboloid, Plane, SurfaceOfRevolution

BOWL = Paraboloid(1 / 200)


@cache
def circle(
    surface: SurfaceOfRevolution, rear_rate: float, family: int, near: tuple[float, float] | None, duration: float
) -> Problem:
    _, motion = find_motion(Bicycle(), surface, rear_rate, family, near)
    return Problem(Bicycle(), surface, *motion.state(), np.arange(round(duration * 100) + 1) / 100)


def plane_circle(duration: float) -> Problem:
    return circle(Plane(), 18.0, 2, (0.74, 2.84), duration)


def bowl_circle(duration: float) -> Problem:
    return circle(BOWL, 18.0, 2, (0.74, 2.84), duration)


def test_creep_follows_its_law() -> None:
    """slip = J' q' / b within 5 % over two decades of b, on plane and bowl, at two steps for each b.

    What else there is: the change of the motion at its own rates, 12.3 1/s at most, against b (>= 105 1/s);
    the depth of the contacts, g (time constant)^2, against the radius: below 1 % each once settled.
    """
    rows = creep_study([plane_circle(0.5), bowl_circle(0.5)], [0.0002, 0.002, 0.02])
    rates = [row.damping for row in rows]
    assert max(rates) / min(rates) > 99
    for row in rows:
        np.testing.assert_allclose(row.slip, row.law, rtol=0.05)
        assert max(row.worst) < 0.05


@pytest.mark.parametrize("impratio", [1.0, 100.0])
@pytest.mark.parametrize("name", ["plane", "1/200", "1/20", "1/5"])
def test_whole_law_holds_at_any_friction_on_any_bowl(name, impratio) -> None:
    """With softness and sinking, from b = 105 to 21000 1/s: within 5 %, and within the motion's fastest rate over b.

    The first law alone is 24 % off with soft friction and 12 % on the steepest bowl at the smallest b, where the
    wheels sink 3 mm deep; what is left is that slip follows its equilibrium at the rate b while the motion
    changes at its own.
    """
    problem = {
        "plane": plane_circle(0.3),
        "1/200": bowl_circle(0.3),
        "1/20": circle(Paraboloid(1 / 20), 18.0, 2, None, 0.3),
        "1/5": circle(Paraboloid(1 / 5), 18.0, 2, None, 0.3),
    }[name]
    fastest = np.abs(linearise(problem.bicycle, problem.surface, problem.q, problem.qd).eigenvalues).max()
    rows = creep_study([problem], [0.0001, 0.001, 0.01, 0.02], impratio=impratio, shares=(2,))
    assert rows[0].damping / rows[-1].damping == pytest.approx(200)
    for row in rows:
        np.testing.assert_allclose(row.slip, row.whole_law, rtol=0.05)
        assert max(row.whole_worst) < min(0.05, fastest / row.damping)
    if impratio == 1.0:
        # The law alone is off by the softness at any b, however large.
        assert max(rows[0].worst) > 0.05


def test_creep_does_not_depend_on_the_step() -> None:
    """Only on b: at one time constant, steps of a half and a tenth of it."""
    slips = [
        creep_row(plane_circle(0.5), NativeSettings(step=step, time_constant=0.004, impratio=100.0)).slip
        for step in (0.002, 0.0004)
    ]
    # One-step integrators turn the velocity by spin * step too far in a step: of the slip, that fraction.
    np.testing.assert_allclose(slips[0], slips[1], rtol=18.0 * 0.002)


def test_creep_follows_its_law_at_any_speed_and_radius() -> None:
    """Circles of the plane and of steep bowls, at 2 to 8 m/s: J' q' from 4 to 18 m/s^2, radii from 1.3 to 7 m."""
    gentle = [
        circle(Plane(), 8.0, 1, None, 0.3),
        circle(Plane(), 18.0, 1, None, 0.3),
        circle(Plane(), 25.0, 2, (0.96, 2.95), 0.3),
        circle(Paraboloid(1 / 20), 8.0, 4, None, 0.3),
        circle(Paraboloid(1 / 20), 18.0, 2, None, 0.3),
    ]
    # On the steepest the normal turns fast, and b must be large against that as well.
    steep = [circle(Paraboloid(1 / 5), 18.0, 2, None, 0.3)]
    rows = creep_study(gentle, [0.0002, 0.002, 0.01]) + creep_study(steep, [0.0002, 0.002])
    accelerations = [max(row.law) * row.damping for row in rows]
    assert min(accelerations) < 4.1
    assert max(accelerations) > 18.0
    for row in rows:
        np.testing.assert_allclose(row.slip, row.law, rtol=0.05)


def test_one_step_integrators_add_energy_in_proportion_to_the_step() -> None:
    """Exact contacts, so that slip costs nothing: half the step, half the gain, 5 W a millisecond; RK4 of order 4.

    The next power of the step is the fastest mode's rate times the step.
    """
    problem = replace(plane_circle(2.0), times=np.arange(101) * 0.02)
    steps = (0.004, 0.002, 0.001)
    rows = energy_study(problem, steps)
    gain = {(row.integrator, row.step): row.gain for row in rows}
    for name in ("Euler", "implicit", "implicitfast"):
        for step in steps[1:]:
            assert gain[name, 2 * step] / gain[name, step] == pytest.approx(2, abs=12.3 * step)
            assert gain[name, step] / (1e3 * step) == pytest.approx(5, abs=0.5)
    assert np.log2(gain["RK4", 0.004] / gain["RK4", 0.002]) > 3.5


def test_settings_have_the_effects_that_they_have() -> None:
    """Trends of the settings on a circle of the plane at 2 ms and a time constant of 5 ms.

    - Hard friction brings the slip to its law (impratio 1: 19 % above, 10: 2 %, 100: on it), noslip as well.
    - A larger impedance makes b smaller by as much, and no more.
    - The pyramid is softer than the ellipse.
    - RK4 takes away the 5 W a millisecond that one-step integrators add, and leaves the slip as it is.
    - Half the time constant, half the slip, half the loss of energy and half the shrinking of the circle.
    """
    base = {"step": 0.002, "time_constant": 0.005}
    hard_base = base | {"impratio": 100.0}
    soft, medium, hard, noslip, stiff, pyramid, rk4, one, half = settings_study(
        plane_circle(2.0),
        [
            (native.ENGINE, base | {"impratio": 1.0}),
            (native.ENGINE, base | {"impratio": 10.0}),
            (native.ENGINE, hard_base),
            (native.ENGINE, base | {"noslip_iterations": 5}),
            (native.ENGINE, hard_base | {"impedance": (0.9, 0.99, 0.001, 0.5, 2.0)}),
            (native.ENGINE, base | {"cone": "pyramidal"}),
            (native.ENGINE, hard_base | {"integrator": "RK4"}),
            (native.ENGINE, {"step": 0.001}),
            (native.ENGINE, {"step": 0.0005}),
        ],
    )
    for row in (hard, noslip, stiff, rk4):
        assert row.law is not None
        assert abs(row.slip / row.law - 1) < 0.02
    assert soft.law is not None
    assert 1.1 < soft.slip / soft.law < 1.3
    assert hard.slip < medium.slip < pyramid.slip < soft.slip
    assert medium.slip / hard.slip < 1.03
    assert stiff.slip / hard.slip == pytest.approx(0.99 / 0.95, rel=0.01)
    energy = {name: value(row.energy_rate) for name, row in (("soft", soft), ("hard", hard), ("rk4", rk4))}
    assert energy["soft"] < energy["hard"] < 0
    gained = {name: energy[name] - row.slip_power for name, row in (("hard", hard), ("rk4", rk4))}
    assert 4.0 < gained["hard"] / 2 < 6.0  # [W] per ms
    assert abs(gained["rk4"]) < 0.05 * gained["hard"]
    assert abs(one.slip / half.slip - 2) < 18.0 * 0.001
    assert abs(value(one.energy_rate) / value(half.energy_rate) - 2) < 0.1
    assert value(soft.radius_rate) < value(hard.radius_rate) < value(one.radius_rate) < 0
    # Two seconds at 9 mm/s are 1 % of the radius, and the slip changes with it.
    assert abs(value(one.radius_rate) / value(half.radius_rate) - 2) < 0.1


def value(rate: Rate | None) -> float:
    assert rate is not None
    return rate.value


def test_exact_contact_has_no_law_and_no_loss() -> None:
    row = ride_row(exact_contact.ENGINE, {}, plane_circle(2.0))
    assert row.law is None
    assert row.slip < 1e-7
    assert row.energy_rate is not None
    assert abs(row.energy_rate.value) < 1e-5
    assert row.ridden == 2.0


def test_drift_rate_covers_the_truth_as_often_as_it_says() -> None:
    """A line with noise and a slow wave: the interval holds the slope in 19 of 20 cases, not in all."""
    rng = np.random.default_rng(3)
    time = np.linspace(0, 100, 1001)
    held = 0
    for _ in range(400):
        values = 0.2 * time + rng.normal(size=time.size) + 0.1 * np.sin(5 * time + rng.uniform(0, 6))
        rate = drift_rate(time, values)
        held += abs(rate.value - 0.2) < rate.half_width
    # 380 expected, with a standard deviation of 4.4: five of them.
    assert 358 < held < 400
