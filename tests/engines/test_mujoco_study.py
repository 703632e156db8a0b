"""The settings study: MuJoCo's creep against its law, the energy of its integrators, and drifts with confidence."""

from functools import cache

import numpy as np

from engines.engine import Problem
from engines.mujoco import exact_contact, native
from engines.mujoco.settings import NativeSettings
from engines.mujoco.study import creep_row, creep_study, drift_rate, ride_row, settings_study
from reference.bicycle import Bicycle
from reference.families import find_motion
from reference.surface import Paraboloid, Plane, SurfaceOfRevolution

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


def test_creep_follows_its_law():
    """slip = J' q' / b within 5 % over two decades of b, on plane and bowl, at two steps for each b.

    What else there is: the change of the motion at its own rates, 12.3 1/s at most, against b (>= 105 1/s);
    the depth of the contacts, g (time constant)^2, against the radius: below 1 % each once settled.
    """
    rows = creep_study([plane_circle(0.5), bowl_circle(0.5)], [0.0002, 0.002, 0.02])
    rates = [row.damping for row in rows]
    assert max(rates) / min(rates) > 99
    for row in rows:
        np.testing.assert_allclose(row.slip, row.law, rtol=0.05)
        assert row.worst < 0.05


def test_creep_does_not_depend_on_the_step():
    """Only on b: at one time constant, steps of a half and a tenth of it."""
    slips = [
        creep_row(plane_circle(0.5), NativeSettings(step=step, time_constant=0.004, impratio=100.0)).slip
        for step in (0.002, 0.0004)
    ]
    # One-step integrators turn the velocity by spin * step too far in a step: of the slip, that fraction.
    np.testing.assert_allclose(slips[0], slips[1], rtol=18.0 * 0.002)


def test_creep_follows_its_law_at_any_speed_and_radius():
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


def test_settings_have_the_effects_that_they_have():
    """Trends of the settings on a circle of the plane at 2 ms and a time constant of 5 ms.

    - Hard friction brings the slip to its law (impratio 1: 19 % above, 100: on it), noslip as well.
    - The pyramid is softer than the ellipse.
    - RK4 takes away the 5 W a millisecond that one-step integrators add, and leaves the slip as it is.
    - Half the time constant, half the slip and half the loss.
    """
    base = {"step": 0.002, "time_constant": 0.005}
    soft, hard, noslip, pyramid, rk4, one, half = settings_study(
        plane_circle(2.0),
        [
            (native.ENGINE, base | {"impratio": 1.0}),
            (native.ENGINE, base | {"impratio": 100.0}),
            (native.ENGINE, base | {"noslip_iterations": 5}),
            (native.ENGINE, base | {"cone": "pyramidal"}),
            (native.ENGINE, base | {"impratio": 100.0, "integrator": "RK4"}),
            (native.ENGINE, {"step": 0.001}),
            (native.ENGINE, {"step": 0.0005}),
        ],
    )
    for row in (hard, noslip, rk4):
        assert row.law is not None
        assert abs(row.slip / row.law - 1) < 0.02
    assert soft.law is not None
    assert 1.1 < soft.slip / soft.law < 1.3
    assert hard.slip < pyramid.slip < soft.slip
    rates = {name: row.energy_rate for name, row in {"hard": hard, "rk4": rk4, "one": one, "half": half}.items()}
    assert all(rate is not None for rate in rates.values())
    gained = {name: rates[name].value - row.slip_power for name, row in (("hard", hard), ("rk4", rk4))}  # pyright: ignore
    assert 4.0 < gained["hard"] / 2 < 6.0  # [W] per ms
    assert abs(gained["rk4"]) < 0.05 * gained["hard"]
    assert abs(one.slip / half.slip - 2) < 18.0 * 0.001
    assert abs(rates["one"].value / rates["half"].value - 2) < 0.1  # pyright: ignore


def test_exact_contact_has_no_law_and_no_loss():
    row = ride_row(exact_contact.ENGINE, {}, plane_circle(2.0))
    assert row.law is None
    assert row.slip < 1e-7
    assert row.energy_rate is not None
    assert abs(row.energy_rate.value) < 1e-5
    assert row.ended == 2.0


def test_drift_rate_covers_the_truth_as_often_as_it_says():
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
