"""Amplitudes of a motion's modes: the linear law, its names, and what they do not see."""

from __future__ import annotations

import numpy as np
import pytest

from velodrome.engines.engine import Problem, Trajectory
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.families import find_motion
from velodrome.reference.kinematics import YAW
from velodrome.reference.stability import independent, linearise
from velodrome.reference.surface import Paraboloid, Plane, SurfaceOfRevolution
from velodrome.reports.drawing.plots import RideData, mode_plots
from velodrome.reports.measure.modes import Modes, find_modes

BICYCLE = Bicycle()
BOWL = Paraboloid(0.005)
Q2 = find_motion(BICYCLE, BOWL, 18.0, 2, (0.74, 2.84))[1].state()
PLANE = find_motion(BICYCLE, Plane(), 18.0, 2, (0.74, 2.84))[1].state()
SPEED = 4.6
UPRIGHT = consistent_state(
    BICYCLE,
    Plane(),
    (float(BICYCLE.reference_point[0]), 0.0),
    0.0,
    0.0,
    (0.0, 0.0, SPEED / BICYCLE.rear_wheel_radius),
)
SMALL = 1e-3  # of the disturbances' rates [rad/s]


def ride(
    surface: SurfaceOfRevolution, motion: tuple[np.ndarray, np.ndarray], duration: float = 2.0, size: float = SMALL
) -> Trajectory:
    """The reference from a motion whose lean and steer rates are slightly disturbed."""
    q, qd = motion
    v = independent(q, qd)
    state = consistent_state(
        BICYCLE,
        surface,
        (float(v[0]), float(v[1])),
        v[2],
        v[3],
        (v[4] + size, v[5] - size, v[6]),
        guess=(float(q[2]), float(q[5])),
    )
    times = np.arange(round(50 * duration) + 1) / 50
    engine = load_engine("reference")
    return engine.simulate(Problem(BICYCLE, surface, *state, times), engine.settings(), lambda _: None)


@pytest.mark.parametrize(("surface", "motion"), [(BOWL, Q2), (Plane(), PLANE), (Plane(), UPRIGHT)])
def test_small_disturbances_follow_the_linear_law(
    surface: SurfaceOfRevolution, motion: tuple[np.ndarray, np.ndarray]
) -> None:
    modes = find_modes(BICYCLE, surface, *motion)
    rides = [ride(surface, motion, size=size) for size in (SMALL, SMALL / 2)]
    for mode in modes.modes:
        found = [modes.amplitude(mode, run) for run in rides]
        left = [a - a[0] * np.exp(mode.eigenvalue.real * rides[0].time) for a in found]
        # What the law leaves out is quadratic in the disturbance, a quarter of it at half the size; or cubic, where
        # the mirror image of a ride upright is one too. The next powers are smaller by the size of the disturbance.
        assert np.abs(left[0]).max() / np.abs(left[1]).max() > 4 * 0.9, mode.name
    amplitude, law = modes.amplitude(modes.modes[2], rides[1]), modes.modes[2].eigenvalue.real
    assert np.abs(amplitude / amplitude[0] / np.exp(law * rides[1].time) - 1).max() < 0.01


def test_amplitudes_add_up_to_the_deviation() -> None:
    modes = find_modes(BICYCLE, BOWL, *Q2)
    jacobian = linearise(BICYCLE, BOWL, *Q2).jacobian
    rng = np.random.default_rng(1)
    deviation = 1e-3 * rng.standard_normal(7)
    total = np.zeros(7)
    for mode in modes.modes:
        # A mode's own direction: the eigenvector whose amplitude is 1.
        values, right = np.linalg.eig(jacobian)
        r = right[:, np.abs(values - mode.eigenvalue).argmin()]
        total += np.real((mode.left @ deviation) * r / (mode.left @ r) * (1 if mode.eigenvalue.imag == 0 else 2))
        unit = (2 if mode.eigenvalue.imag else 1) * r / (mode.left @ r)
        share = abs(unit[6]) if mode.unit == "rad/s" else np.abs(unit[2:4]).max()
        assert share == pytest.approx(1, rel=1e-9)
    # Left and right eigenvectors are inverse to round-off times their condition, some 1e3.
    np.testing.assert_allclose(total, deviation, atol=1e-11)


def test_the_published_modes_have_their_names() -> None:
    found = {mode.name: mode.eigenvalue for mode in find_modes(BICYCLE, BOWL, *Q2).modes}
    assert found == {
        "castering": pytest.approx(-12.28445, abs=5e-6),
        "capsize": pytest.approx(-0.42773, abs=5e-6),
        "weave": pytest.approx(-0.14067 + 6.70938j, abs=1e-5),
        "orbital": pytest.approx(-0.01111 + 2.35022j, abs=1e-5),
        "family": 0,
    }
    titles = [mode.title for mode in find_modes(BICYCLE, BOWL, *Q2).modes]
    assert titles[2:4] == ["weave −0.141 ± 6.71i 1/s", "orbital −0.0111 ± 2.35i 1/s"]


def test_a_circle_may_lie_anywhere_on_the_plane() -> None:
    modes, run = find_modes(BICYCLE, Plane(), *PLANE), ride(Plane(), PLANE, duration=0.5)
    assert [mode.name for mode in modes.modes] == ["castering", "capsize", "weave", "family"]
    moved = run.q.copy()
    moved[:, :2] += (3.0, -2.0)
    for mode in modes.modes:
        here = np.abs((independent(moved, run.qd) - modes.motion) @ mode.left)
        np.testing.assert_array_equal(here, modes.amplitude(mode, run))


def test_an_upright_ride_has_the_modes_of_the_benchmark() -> None:
    found = {mode.name: mode for mode in find_modes(BICYCLE, Plane(), *UPRIGHT).modes}
    assert set(found) == {"castering", "capsize", "weave", "family"}
    assert found["weave"].eigenvalue == pytest.approx(-0.37797 + 3.87284j, abs=1e-5)
    assert UPRIGHT[1][YAW] == 0


def test_modes_without_plain_names_keep_their_eigenvalues_only() -> None:
    # P4 has four real modes: no pair is the weave.
    motion = find_motion(BICYCLE, Paraboloid(0.2), 4.0, 4)[1].state()
    names = [mode.name for mode in find_modes(BICYCLE, Paraboloid(0.2), *motion).modes]
    assert sorted(names) == ["family", "pair", "real", "real", "real", "real"]


def test_plots_say_name_and_unit_and_draw_the_law() -> None:
    modes, run = find_modes(BICYCLE, BOWL, *Q2), ride(BOWL, Q2)
    shown = RideData(BOWL, {"reference": run}, modes=modes)
    plots = mode_plots(modes)
    assert plots[2].title == "weave −0.141 ± 6.71i 1/s: angle [10^x rad]"
    assert plots[4].title == "family 0 1/s: rear rate [10^x rad/s]"
    law = plots[2].expected(shown)
    assert law is not None
    slope = np.polyfit(law[0], law[1], 1)[0]
    assert slope == pytest.approx(modes.modes[2].eigenvalue.real / np.log(10), rel=1e-9)
    # A start on the motion itself excites nothing that a law could be drawn of.
    still = RideData(BOWL, {"reference": _still(run, modes)}, modes=modes)
    assert [plot.expected(still) for plot in plots] == [None] * 5


def _still(run: Trajectory, modes: Modes) -> Trajectory:
    q, qd = Q2
    cut = run.first(2)
    cut.q[:], cut.qd[:] = q, qd
    assert np.array_equal(independent(q, qd), modes.motion)
    return cut
