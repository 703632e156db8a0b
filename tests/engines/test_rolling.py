"""The public kit of rolling contact: held against the reference's own contacts and against finite differences."""

from __future__ import annotations

import math
from collections.abc import Callable

import numba
import numpy as np
import pytest
from ripples import Ripples

from velodrome.engines import rolling
from velodrome.engines.coordinates import (
    BODIES,
    angular_velocities,
    body_positions,
    body_quaternions,
    body_velocities,
    coordinates_from_bodies,
    quaternions,
    rotation_matrices,
    rotations,
    start_on_turn,
)
from velodrome.engines.rolling import WheelContact, observe, observe_wheel
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Torus
from velodrome.reference.dae import consistent_state, dynamics
from velodrome.reference.height_field import HeightField
from velodrome.reference.surface import Paraboloid, Plane, Surface

BICYCLE = Bicycle()
RADII = np.array([BICYCLE.rear_wheel_radius, BICYCLE.front_wheel_radius])
_AT = np.arange(-6.0, 6.1, 2.0)
WAVES = HeightField((0.06 * np.sin(_AT[:, None] / 2) * np.cos(_AT / 2 - 0.4)).tolist(), 2.0, (-6.0, -6.0))
GROUNDS: dict[str, Surface] = {
    "plane": Plane(),
    "bowl": Paraboloid(0.1),
    "torus": Torus(2.0, 3.0),
    "waves": WAVES,
    "ripples": Ripples(0.15),
}


def states(surface: Surface, lifted: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Poses on a ground or above it, with rates that do not roll."""
    rng = np.random.default_rng(3)
    q = []
    for lean, steer, yaw in ((0.1, -0.2, 0.4), (-0.5, 0.3, 2.0), (0.3, 2.9, -1.0)):
        pose, _ = consistent_state(BICYCLE, surface, (1.4, -0.6), lean, steer, (0.1, 0.2, 9.0), yaw=yaw)
        q.append(pose)
    q = np.array(q)
    q[:, 2] += lifted
    return q, rng.uniform(-2, 2, q.shape)


def of_wheels(surface: Surface, q: np.ndarray, qd: np.ndarray) -> WheelContact:
    """Contacts of both wheels of a bicycle."""
    axle = rotations(BICYCLE, q)[:, 2:, :, 1]
    place, velocity = body_positions(BICYCLE, q)[:, 2:], body_velocities(BICYCLE, q, qd)[:, 2:]
    return observe_wheel(surface, RADII, place, axle, velocity, angular_velocities(BICYCLE, q, qd)[:, 2:])


@pytest.mark.parametrize("lifted", [0.0, 0.03])
@pytest.mark.parametrize("ground", GROUNDS)
def test_it_sees_what_the_reference_sees(ground: str, lifted: float) -> None:
    surface = GROUNDS[ground]
    q, qd = states(surface, lifted)
    seen, found = of_wheels(surface, q, qd), observe(BICYCLE, surface, q, qd)
    assert found.found
    assert seen.found.shape == (3, 2)
    assert seen.found.all()
    # The same closest approach by Newton's method from other axes of the wheel's plane: round-off of some metres.
    for name in ("point", "normal", "gap", "slip"):
        np.testing.assert_allclose(getattr(seen, name), getattr(found, name), rtol=0, atol=1e-13, err_msg=name)
    along = np.einsum("...i,...i", seen.forward, seen.velocity)
    np.testing.assert_allclose(seen.slip[..., 1], along, rtol=0, atol=1e-14)
    frame = np.stack([seen.lateral, seen.forward, seen.normal], axis=-1)
    np.testing.assert_allclose(np.linalg.det(frame), -1, rtol=0, atol=1e-14)


def moving(surface: Surface) -> Callable[[float], tuple[np.ndarray, ...]]:
    """A smooth motion of a wheel near a ground: centre, rotation, velocity, spin, and their derivatives."""
    w0, w1 = np.array([0.3, -0.5, 0.8]), np.array([0.7, 0.4, -0.3])
    q, _ = states(surface, 0.02)
    start = body_positions(BICYCLE, q)[0, 2]
    turned = rotations(BICYCLE, q)[0, 2]
    v0, a0 = np.array([0.9, -0.7, 0.3]), np.array([0.4, 1.1, -0.6])

    def turn(vector: np.ndarray) -> np.ndarray:
        size = float(np.linalg.norm(vector))
        k = np.cross(np.eye(3), vector)
        if size == 0:
            return np.eye(3)
        return np.eye(3) + math.sin(size) / size * k + (1 - math.cos(size)) / size**2 * (k @ k)

    def at(t: float) -> tuple[np.ndarray, ...]:
        # A turn about w0 after one about w1: the spin is t-dependent, w = w0 + R(w0 t) w1.
        first = turn(w0 * t)
        rotation = first @ turn(w1 * t) @ turned
        spin = w0 + first @ w1
        return start + v0 * t + a0 * t * t / 2, rotation, v0 + a0 * t, spin, a0, np.cross(w0, first @ w1)

    return at


@pytest.mark.parametrize("ground", GROUNDS)
def test_rates_are_derivatives(ground: str) -> None:
    surface, radius = GROUNDS[ground], RADII[0]
    at = moving(surface)

    def seen(t: float) -> WheelContact:
        centre, rotation, velocity, spin, _, _ = at(t)
        return observe_wheel(surface, radius, centre, rotation[:, 1], velocity, spin)

    def derivative(name: str, h: float) -> np.ndarray:
        values = [getattr(seen(k * h), name) for k in (-2, -1, 1, 2)]
        return (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * h)

    centre, _, _, _, acceleration, turning = at(0.0)
    here = seen(0.0)
    material = acceleration + np.cross(turning, here.point - centre) + here.acceleration
    # Differences of order 4: the error (h rate)^4 of rates of some 1/s, and round-off of 1e-15 over h.
    for name, expected in (("velocity", material), ("point", here.point_velocity), ("gap", here.gap_rate)):
        np.testing.assert_allclose(derivative(name, 1e-3), expected, rtol=0, atol=1e-10, err_msg=name)
    assert np.linalg.norm(here.acceleration) > 0.1


@pytest.mark.parametrize("ground", GROUNDS)
def test_rolling_accelerations_are_those_of_the_equations_of_motion(ground: str) -> None:
    surface = GROUNDS[ground]
    q, qd = consistent_state(BICYCLE, surface, (1.4, -0.6), 0.1, -0.2, (0.4, -0.3, 9.0), yaw=0.4)
    here = of_wheels(surface, q[None], qd[None])
    assert np.abs(here.velocity).max() < 1e-12
    h = 1e-4
    qdd = dynamics(BICYCLE, surface, q, qd).acceleration
    ahead = [(q + k * h * qd + (k * h) ** 2 / 2 * qdd)[None] for k in (-1, 1)]
    rates = [(qd + k * h * qdd)[None] for k in (-1, 1)]
    linear = np.subtract(*(body_velocities(BICYCLE, a, b) for a, b in zip(ahead, rates, strict=True))) / (-2 * h)
    angular = np.subtract(*(angular_velocities(BICYCLE, a, b) for a, b in zip(ahead, rates, strict=True))) / (-2 * h)
    arm = here.point - body_positions(BICYCLE, q[None])[:, 2:]
    left = linear[:, 2:] + np.cross(angular[:, 2:], arm) + here.acceleration
    # Central differences of spins that turn at the wheels' 27 rad/s.
    assert np.abs(left).max() < 27**3 * 0.35 * h**2


@numba.njit
def _from_compiled_code(centre, axle, radius, velocity, spin, ground, function, parameters):
    x, z = rolling.wheel_axes(axle)
    here = rolling.contact_state(centre, x, axle, z, radius, velocity, spin, ground, function, parameters)
    return here.gap, here.acceleration, rolling.dot(here.forward, here.velocity)


@pytest.mark.parametrize("ground", GROUNDS)
def test_compiled_code_may_call_it(ground: str) -> None:
    surface = GROUNDS[ground]
    centre, rotation, velocity, spin, *_ = moving(surface)(0.1)
    plain = observe_wheel(surface, 0.3, centre, rotation[:, 1], velocity, spin)
    size = np.linalg.norm(rotation[:, 1])
    arguments = [tuple(v.tolist()) for v in (centre, rotation[:, 1] / size, velocity, spin)]
    where = (rolling.rim_search(surface, [0.3]), surface.function.real, surface.parameters)
    gap, own, slip = _from_compiled_code(arguments[0], arguments[1], 0.3, arguments[2], arguments[3], *where)
    assert gap == plain.gap
    assert np.array_equal(own, plain.acceleration)
    assert slip == plain.slip[1]


def test_a_wheel_may_have_no_contact_or_lie_flat() -> None:
    # Beyond the torus's outer edge there is no ground.
    lost = observe_wheel(Torus(2.0, 3.0), 0.3, [[2.0, 0, 0.3], [9.0, 0, 0.3]], [0, 1, 0], [1.0, 0, 0], [0, 3.0, 0])
    assert lost.found.tolist() == [True, False]
    assert np.isnan(lost.acceleration[1]).all()
    assert np.isfinite(lost.acceleration[0]).all()
    # A level disc against the wall of a bowl: closest where the slope is the wall's, along x.
    flat = observe_wheel(Paraboloid(0.5), 0.3, [1.0, 0.0, 0.9], [0, 0, 2.0])
    assert flat.found
    assert flat.gap.shape == ()
    np.testing.assert_allclose(flat.point, [1.3, 0, 0.9], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"radius": 0.0}, "radius is 0.0"),
        ({"axle": [0.0, 0, 0]}, "an axle is a vector"),
        ({"centre": [0.0, 0]}, "each must end in 3"),
    ],
)
def test_what_is_no_wheel_is_refused(wrong: dict, words: str) -> None:
    given = {"radius": 0.3, "centre": [0.0, 0, 0.3], "axle": [0.0, 1, 0]} | wrong
    with pytest.raises(ValueError, match=words):
        observe_wheel(Plane(), **given)


def test_bodies_and_coordinates_go_both_ways() -> None:
    surface = Ripples(0.15)
    q, qd = states(surface)
    q[:, 3:] += 2 * np.pi * np.array([1, 0, 0, 0, -2, 3])
    position, velocity = body_positions(BICYCLE, q), body_velocities(BICYCLE, q, qd)
    spin, turned = angular_velocities(BICYCLE, q, qd), rotations(BICYCLE, q)
    for k in range(len(q)):
        one = (np.zeros(1), position[k : k + 1, 0], velocity[k : k + 1, 0], turned[k : k + 1], spin[k : k + 1])
        found, rates = coordinates_from_bodies(BICYCLE, *one)
        # Angles of some radians and whole turns, back through arctangents.
        np.testing.assert_allclose(start_on_turn(found, q[k])[0], q[k], rtol=0, atol=1e-14)
        np.testing.assert_allclose(rates[0], qd[k], rtol=0, atol=1e-13)
    assert position.shape == (3, len(BODIES), 3)
    for given in (body_quaternions(BICYCLE, q), quaternions(turned)):
        np.testing.assert_allclose(rotation_matrices(3 * given), turned, rtol=0, atol=1e-14)
