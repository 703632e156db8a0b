"""A disc on a knife edge: exact solutions, and the order of what is left."""

import numpy as np
import pytest

from velodrome.engines.mujoco.rolling_disc import ACROSS, AXIAL, GRAVITY, MASS, RADIUS, main, roll, steady_state
from velodrome.reference.surface import Paraboloid, Plane


def test_steady_state_balances_its_moments() -> None:
    """dL/dt = Omega x L equals the moment of the contact force about the centre."""
    for lean, circle in ((0.1, 2.0), (0.4, 1.0), (1.0, 0.2)):
        _, _, rate = steady_state(lean, circle)
        up, axle = np.array([-np.sin(lean), 0, np.cos(lean)]), np.array([np.cos(lean), 0, np.sin(lean)])
        turn = np.array([0, 0, rate])
        spin = turn - rate * (circle + RADIUS * np.sin(lean)) / RADIUS * axle
        momentum = ACROSS * (spin - (spin @ axle) * axle) + AXIAL * (spin @ axle) * axle
        force = MASS * np.array([-(rate**2) * circle, 0, GRAVITY])
        np.testing.assert_allclose(np.cross(turn, momentum), np.cross(-RADIUS * up, force), rtol=0, atol=1e-14)


def test_disc_stays_on_its_circle() -> None:
    """In ten seconds, 2.6 turns; the disc upon MuJoCo's own contact is off by a decimetre."""
    qpos, qvel, rate = steady_state(0.4, 1.0)
    rolled = roll(qpos, qvel, Plane(), 10.0)
    turn = rate * rolled.time
    exact = np.column_stack([np.cos(turn), np.sin(turn)])
    # RK4's error of a step is (w h)^5 / 120 of the motion, w the spin's rate; it adds up along the path.
    spin = rate * (1.0 + RADIUS * np.sin(0.4)) / RADIUS
    local = (spin * 0.002) ** 5 / 120
    assert np.abs(rolled.position[:, :2] - exact).max() < local * 5000 * rate * 10.0
    # What slips is of the method's order too.
    coarse = roll(qpos, qvel, Plane(), 2.0, step=0.004)
    assert np.nanmax(coarse.slip) > 2**3.5 * np.nanmax(rolled.slip)
    own = roll(qpos, qvel, Plane(), 10.0, exact=False)
    assert np.abs(own.position[:, :2] - exact).max() > 0.05


def test_order_on_a_bowl() -> None:
    """Self-convergence of order 4 in a bowl, where no exact solution is at hand; energy is conserved alike."""
    bowl = Paraboloid(0.1)
    qpos, qvel, _ = steady_state(0.4, 1.0)
    # Onto the bowl along the normal below it, near enough: the contact's stabilisation is not what is tested.
    qpos[2] += 0.1 * (1.0 + RADIUS * np.sin(0.4)) ** 2
    ends, drifts = [], []
    for step in (0.02, 0.01, 0.005):
        rolled = roll(qpos, qvel, bowl, 1.0, step=step)
        ends.append(rolled.position[-1])
        drifts.append(np.abs(rolled.energy[round(0.5 / step) :] - rolled.energy[-1]).max())
    order = np.log2(np.linalg.norm(ends[1] - ends[0]) / np.linalg.norm(ends[2] - ends[1]))
    assert order > 3.5
    # After the start's slip is gone energy changes with the same power.
    assert drifts[2] < drifts[1] < drifts[0]


def test_script_tells_both(capsys) -> None:
    main()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert "knife edge: off its path by" in lines[2]


@pytest.mark.parametrize("lean", [0.2, 0.8])
def test_energy_is_kept_on_the_plane(lean) -> None:
    rolled = roll(*steady_state(lean, 0.6)[:2], Plane(), 2.0)
    assert np.ptp(rolled.energy) < 1e-8 * rolled.energy[0]
