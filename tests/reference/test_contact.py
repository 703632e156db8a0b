import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state, contact_parameters, residual
from velodrome.reference.kernels import dynamics as kernel
from velodrome.reference.kinematics import constants, rotations
from velodrome.reference.surface import Paraboloid, Plane, evaluate

BICYCLE = Bicycle()
states = st.tuples(st.floats(-0.9, 0.9), st.floats(-1.2, 1.2), st.floats(-1, 1), st.floats(-1, 1))
alphas = st.sampled_from([0.0, 0.005, 0.05, 0.2])


@given(states, alphas, st.floats(-3, 3))
def test_consistent_states_satisfy_gaps_contact_and_rolling(state: tuple, alpha: float, yaw: float) -> None:
    lean, steer, x, y = state
    q, qd = consistent_state(BICYCLE, Paraboloid(alpha), (x, y), lean, steer, (0.3, -0.2, 12.0), yaw=yaw)
    p = contact_parameters(BICYCLE, Paraboloid(alpha), q)
    rows = residual(BICYCLE, Paraboloid(alpha), q, qd, np.zeros(9), p, np.zeros(6))[9:]
    # Contact and gap to round-off of lengths of a few metres, rolling of speeds of some 10 m/s.
    assert np.abs(rows[:8]).max() < 2e-14
    assert np.abs(rows[8:]).max() < 1e-12
    assert qd[[4, 6, 7]].tolist() == [0.3, -0.2, 12.0]


def test_on_the_plane_the_contact_is_the_lowest_point_of_the_rim() -> None:
    q = np.array([1.0, -2.0, 0.6, 0.4, 0.5, 0.1, 0.6, 0.0, 0.0])
    seen = observe(BICYCLE, Plane(), q[None], np.zeros((1, 9)))
    rear, front = rotations(BICYCLE, q[None])[0, :2]
    origin, d = q[:3], BICYCLE.reference_point
    for wheel, (axes, body, radius) in enumerate(
        ((rear, "rear_wheel", BICYCLE.rear_wheel_radius), (front, "front_wheel", BICYCLE.front_wheel_radius))
    ):
        centre = origin + axes @ (BICYCLE.centre(body) - d)
        axle = axes[:, 1]
        down = -np.array([0, 0, 1]) + axle[2] * axle
        lowest = centre + radius * down / np.linalg.norm(down)
        assert np.allclose(seen.point[0, wheel], lowest, atol=1e-14)
        assert seen.gap[0, wheel] == pytest.approx(lowest[2], abs=1e-14)


@settings(max_examples=15, deadline=None)
@given(states, st.sampled_from([0.02, 0.05, 0.2]), st.floats(0.01, 0.1))
def test_gap_is_the_distance_of_rim_and_surface(state: tuple, alpha: float, lift: float) -> None:
    """The closest approach found by the contact equations is the minimum that a search finds."""
    lean, steer, x, y = state
    surface = Paraboloid(alpha)
    q, _ = consistent_state(BICYCLE, surface, (x, y), lean, steer, (0, 0, 0))
    q[2] += lift
    seen = observe(BICYCLE, surface, q[None], np.zeros((1, 9)))
    axes = rotations(BICYCLE, q[None])[0, 0]
    centre = q[:3] + axes @ (BICYCLE.centre("rear_wheel") - BICYCLE.reference_point)

    def distance(u: np.ndarray) -> float:
        rim = centre + BICYCLE.rear_wheel_radius * (-np.sin(u[2]) * axes[:, 0] - np.cos(u[2]) * axes[:, 2])
        ground = np.array([u[0], u[1], evaluate(surface, u[0], u[1])[0]])
        return float(np.sum((rim - ground) ** 2))

    start = [*seen.point[0, 0, :2] + 0.01, 0.05]
    best = minimize(distance, start, method="BFGS", options={"gtol": 1e-12})
    # A minimum of d^2 is known to the square root of round-off, its value to round-off / d.
    assert seen.gap[0, 0] == pytest.approx(np.sqrt(best.fun), abs=1e-12 / lift)


@given(states, alphas)
def test_gradient_of_the_gap_is_the_normal_velocity_row(state: tuple, alpha: float) -> None:
    lean, steer, x, y = state
    surface, c = Paraboloid(alpha), constants(BICYCLE)
    q, _ = consistent_state(BICYCLE, surface, (x, y), lean, steer, (0, 0, 0))
    p = contact_parameters(BICYCLE, surface, q)
    function, parameters = surface.function, surface.parameters
    jacobian, rows = np.empty((6, 9)), np.empty((2, 9))
    kernel.rolling(q, np.zeros(9), p, function.real, parameters, c, jacobian, np.empty(6), np.empty(6))
    kernel.normal_rows(q, p, function.real, parameters, c, jacobian, rows)
    for j in range(9):
        z = q.astype(complex)
        z[j] += 1e-30j
        pz = p.astype(complex)
        kernel.find_contacts(z, pz, function.complex, parameters, c)
        work = np.empty((6, 9), complex), np.empty(6, complex), np.empty(6, complex)
        gaps = kernel.rolling(z, np.zeros(9, complex), pz, function.complex, parameters, c, *work)
        assert np.allclose([gap.imag / 1e-30 for gap in gaps], rows[:, j], atol=1e-13)


def test_wheels_that_cannot_reach_the_ground_are_refused() -> None:
    with pytest.raises(ValueError, match="cannot touch the ground"):
        consistent_state(BICYCLE, Plane(), (0, 0), float(np.pi / 2), 0.3, (0, 0, 1))


def test_slip_tells_lateral_from_forward() -> None:
    """An upright bicycle pushed ahead with locked wheels slides forward, pushed to the left laterally."""
    q, _ = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, (0.0, 0.0, 0.0))
    for push, direction in ((np.array([1.0, 0, 0]), 1), (np.array([0, 1.0, 0]), 0)):
        qd = np.zeros(9)
        qd[:3] = push
        slip = observe(BICYCLE, Plane(), q[None], qd[None]).slip[0]
        # Forward is the axle crossed with the normal, ahead; lateral the normal crossed with it, to the left.
        assert np.allclose(slip[:, direction], 1.0, atol=1e-15)
        assert np.allclose(slip[:, 1 - direction], 0.0, atol=1e-15)
