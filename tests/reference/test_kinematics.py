import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from velodrome.reference import kinematics
from velodrome.reference.bicycle import BODIES, Bicycle
from velodrome.reference.kernels.kinematics import frames
from velodrome.reference.kinematics import (
    angular_velocities,
    body_positions,
    body_velocities,
    constants,
    coordinates_from_bodies,
    quaternions,
    rotations,
    unwrap,
)

BICYCLE = Bicycle()
angle, rate, place = st.floats(-3.1, 3.1), st.floats(-20, 20), st.floats(-30, 30)
lean = st.floats(-1.5, 1.5)
coordinates = st.tuples(place, place, place, angle, lean, angle, angle, angle, angle).map(np.array)
rates = st.tuples(*[rate] * 9).map(np.array)


@given(coordinates)
def test_kernel_frames_are_the_bodies_axes(q: np.ndarray) -> None:
    _, x_r, y_r, z_r, s, x_h, y_h, z_h = (np.array(axis) for axis in frames(q[3], q[4], q[5], q[6], constants(BICYCLE)))
    turned = rotations(BICYCLE, q[None])[0]
    # Products of four rotations: a few units of round-off.
    assert np.allclose(turned[0], np.column_stack([x_r, y_r, z_r]), atol=1e-14)
    assert np.allclose(turned[1], np.column_stack([x_h, y_h, z_h]), atol=1e-14)
    assert np.allclose(s, turned[0] @ BICYCLE.steer_axis, atol=1e-14)


def test_signs_follow_the_conventions() -> None:
    up = np.array([0.0, 0.0, 1.0])

    def turned(index: int) -> np.ndarray:
        q = np.zeros((1, 9))
        q[0, index] = 0.1
        return rotations(BICYCLE, q)[0]

    assert (turned(4)[0] @ up)[1] < 0, "a positive lean is to the right"
    assert (turned(3)[0] @ [1, 0, 0])[1] > 0, "a positive yaw is anticlockwise from above"
    assert (turned(6)[1] @ [1, 0, 0])[1] > 0, "a positive steer turns the front wheel to the left"
    assert (turned(7)[2] @ up)[0] > 0, "a positive wheel angle rolls forward"
    assert (turned(5)[0] @ [1, 0, 0])[2] < 0, "a positive pitch lowers the nose"


def test_at_rest_the_bodies_are_where_the_table_puts_them() -> None:
    q = np.zeros((1, 9))
    q[0, :3] = BICYCLE.reference_point
    expected = np.stack([BICYCLE.centre(body) for body in BODIES])
    assert np.allclose(body_positions(BICYCLE, q)[0], expected, atol=1e-15)


@given(coordinates, rates)
def test_velocities_are_derivatives_of_poses(q: np.ndarray, qd: np.ndarray) -> None:
    # Central differences over 2h: error (w h)^2 / 6 relative with w up to 80 rad/s, round-off eps/h.
    h = 1e-6
    path = np.stack([q - h * qd, q + h * qd])
    position, turned = body_positions(BICYCLE, path), rotations(BICYCLE, path)
    tolerance = 1e-6 * (1 + np.abs(qd).max()) ** 2 * 0.1
    velocity = body_velocities(BICYCLE, q[None], qd[None])[0]
    assert np.allclose((position[1] - position[0]) / (2 * h), velocity, atol=tolerance)
    spin = angular_velocities(BICYCLE, q[None], qd[None])[0]
    middle = rotations(BICYCLE, q[None])[0]
    for body in range(4):
        skew = (turned[1, body] - turned[0, body]) / (2 * h) @ middle[body].T
        assert np.allclose([skew[2, 1], skew[0, 2], skew[1, 0]], spin[body], atol=tolerance)


@given(coordinates, rates)
def test_coordinates_come_back_from_the_bodies(q: np.ndarray, qd: np.ndarray) -> None:
    motion = (body_positions(BICYCLE, q[None])[:, 0], body_velocities(BICYCLE, q[None], qd[None])[:, 0])
    turned, spin = rotations(BICYCLE, q[None]), angular_velocities(BICYCLE, q[None], qd[None])
    back, back_rates = coordinates_from_bodies(BICYCLE, np.zeros(1), *motion, turned, spin)
    # Yaw and pitch are conditioned like 1 / cos(lean), the lean itself too (an arc sine).
    tolerance = 2e-14 * (1 + np.abs(q).max()) / np.cos(q[4]) ** 2
    assert np.allclose(back[0], q, atol=tolerance)
    assert np.allclose(back_rates[0], qd, atol=tolerance * (1 + np.abs(qd).max()))


def test_angles_are_followed_through_many_turns_a_sample() -> None:
    time = np.linspace(0, 10, 36)
    rate = 30 + 5 * np.sin(time)
    whole = 30 * time - 5 * np.cos(time)
    wrapped = np.angle(np.exp(1j * whole))
    # One sample takes more than a turn; the trapezoidal rule errs by far less than half a turn.
    assert np.diff(whole).min() > 2 * np.pi
    assert np.allclose(np.diff(unwrap(time, wrapped, rate)), np.diff(whole), atol=1e-12 * 300)


def test_quaternions_are_continuous_and_right() -> None:
    q = np.zeros((400, 9))
    q[:, 7] = np.linspace(0, 40, 400)
    turned = rotations(BICYCLE, q)
    wxyz = quaternions(turned)
    assert np.linalg.norm(np.diff(wxyz[:, 2], axis=0), axis=1).max() < 0.06  # half of 0.1 rad a sample
    w, x, y, z = np.moveaxis(wxyz, -1, 0)
    rebuilt = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1)
    assert np.allclose(rebuilt, turned[..., 0, :], atol=1e-14)
    assert wxyz[0] == pytest.approx(np.tile([1, 0, 0, 0], (4, 1)))


@pytest.mark.parametrize(
    "name", ["rotations", "body_positions", "body_quaternions", "angular_velocities", "body_velocities"]
)
def test_maps_take_one_state_or_many(name: str) -> None:
    states = np.random.default_rng(1).normal(size=(2, 3, 9))
    rates = name.endswith("velocities")
    taken = states if rates else states[:1]
    map_states = getattr(kinematics, name)
    many = map_states(Bicycle(), *taken)
    for k in range(3):
        one = map_states(Bicycle(), *taken[:, k])
        assert one.shape == many.shape[1:]
        assert np.allclose(one, many[k], rtol=0, atol=1e-15)
    for shape in ((8,), (3, 8), (1, 3, 9), ()):
        with pytest.raises(ValueError, match=r"q has shape .* it must be \(9,\) or \(n, 9\)"):
            map_states(Bicycle(), *np.zeros((len(taken), *shape)))
    if rates:
        with pytest.raises(ValueError, match=r"qd has shape \(9,\), but q has \(3, 9\)"):
            map_states(Bicycle(), states[0], states[1, 0])
