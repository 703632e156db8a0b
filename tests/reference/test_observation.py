"""What the compiled loops over states give, held against plainer forms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from velodrome.reference.bicycle import BODIES, Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.dae import contact_parameters
from velodrome.reference.kernels import dynamics
from velodrome.reference.kinematics import body_positions, body_quaternions, constants, rotations
from velodrome.reference.surface import Paraboloid

BICYCLE = replace(Bicycle(), trail=0.1)
BOWL = Paraboloid(0.02)
numbers = st.floats(-1, 1)
coordinates = st.tuples(
    *[numbers] * 2, st.floats(0.5, 0.8), st.floats(-7, 7), *[numbers] * 3, *[st.floats(-90, 90)] * 2
)
rates = st.tuples(*[st.floats(-20, 20)] * 9)


@settings(max_examples=30, deadline=None)
@given(coordinates, rates)
def test_slip_and_energies_are_those_of_the_equations_of_motion(q: tuple, qd: tuple) -> None:
    state, speed = np.array(q), np.array(qd)
    seen = observe(BICYCLE, BOWL, state[None], speed[None], contact_parameters(BICYCLE, BOWL, state)[None])
    c, jacobian = constants(BICYCLE), np.empty((6, 9))
    p = contact_parameters(BICYCLE, BOWL, state)
    gaps = dynamics.rolling(state, speed, p, BOWL.function.real, BOWL.parameters, c, jacobian, np.empty(6), np.empty(6))
    velocity = (jacobian @ speed).reshape(2, 3)
    # Round-off of lengths of a metre and of speeds of some 20 m/s, in sums of a dozen terms.
    assert seen.gap[0] == pytest.approx(gaps, abs=1e-14)
    across = np.einsum("ki,ki->k", velocity, seen.normal[0])
    assert np.hypot(*seen.slip[0].T) ** 2 + across**2 == pytest.approx((velocity**2).sum(axis=1), rel=1e-12, abs=1e-20)
    kinetic, potential = dynamics.energies(state, speed, c)
    largest = 0.5 * (np.abs(speed) @ np.full((9, 9), 100.0) @ np.abs(speed))
    assert seen.kinetic_energy[0] == pytest.approx(kinetic, abs=float(1e-14 * largest + 1e-12))
    assert seen.potential_energy[0] == pytest.approx(potential, abs=1e-12)


@settings(max_examples=30, deadline=None)
@given(coordinates)
def test_bodies_are_where_their_rotations_carry_them(q: tuple) -> None:
    state = np.array(q)
    turned, centres = rotations(BICYCLE, state), body_positions(BICYCLE, state)
    frames = [turned[0], turned[1], turned[0], turned[1]]
    for body, frame, centre in zip(BODIES, frames, centres, strict=True):
        expected = state[:3] + frame @ (BICYCLE.centre(body) - BICYCLE.reference_point)
        assert centre == pytest.approx(expected, abs=1e-14)
    for matrix, (w, x, y, z) in zip(turned, body_quaternions(BICYCLE, state), strict=True):
        expected = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        # Half angles of up to 45 rad are known to some 1e-14.
        assert np.abs(matrix - expected).max() < 1e-13
