"""The right-hand side without its constraints, held against the full system of 15 equations."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state, contact_parameters, dynamics, mass_matrix
from velodrome.reference.kernels import dynamics as kernel
from velodrome.reference.kernels import lean
from velodrome.reference.kernels.pose import aligned
from velodrome.reference.kernels.projection import project
from velodrome.reference.kinematics import constants
from velodrome.reference.surface import Paraboloid, Plane, Surface, evaluate, surface_function

BENCHMARK = Bicycle()
BICYCLES = {
    "benchmark": BENCHMARK,
    "vertical steering axis, no trail": replace(BENCHMARK, steer_axis_tilt=0.0, trail=0.0),
    "small wheels, leant forward": replace(
        BENCHMARK, rear_wheel_radius=0.2, front_wheel_radius=0.15, steer_axis_tilt=-0.2, trail=-0.05
    ),
    "heavy front, steep": replace(
        BENCHMARK, front_frame_mass=40.0, front_frame_Ixx=3.0, front_frame_Iyy=3.5, front_frame_Izz=1.0, trail=0.2
    ),
    "long, laid back": replace(BENCHMARK, wheelbase=2.0, steer_axis_tilt=0.9, trail=0.3),
}


@surface_function
def _hills(x, y, parameters):
    """Height h sin(k x + y) cos(k y): no symmetry, every entry of the Hessian at work."""
    h, k = parameters
    s, c, sy, cy = np.sin(k * x + y), np.cos(k * x + y), np.sin(k * y), np.cos(k * y)
    fx, fy = h * k * c * cy, h * (c * cy - k * s * sy)
    fyy = h * (-s * cy - 2 * k * c * sy - k * k * s * cy)
    return h * s * cy, fx, fy, -h * k * k * s * cy, h * k * (-s * cy - k * c * sy), fyy


class Hills:
    """A ground without symmetry."""

    function = _hills
    parameters = np.array([0.1, 0.7])


SURFACES = {"plane": Plane(), "bowl": Paraboloid(0.005), "steep bowl": Paraboloid(0.2), "hills": Hills()}
ROUND_OFF = 2.0**-52

states = st.fixed_dictionaries(
    {
        "position": st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
        "lean": st.floats(-0.9, 0.9),
        "steer": st.floats(-1.5, 1.5),
        "rates": st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-30, 30)),
        "yaw": st.floats(-9, 9),
    }
)


def riding(bicycle: Bicycle, surface: Surface, state: dict[str, Any]) -> np.ndarray:
    """Integration state (24,) of a consistent state."""
    q, qd = consistent_state(bicycle, surface, **state)
    return np.concatenate([q, qd, contact_parameters(bicycle, surface, q)])


def conditioning(bicycle: Bicycle, surface: Surface, y: np.ndarray) -> float:
    """Condition number of the full system, its unknowns scaled to one size: the bound on what round-off does.

    Mass matrix and velocity rows are scaled by the square roots of the masses, as a change of units does.
    """
    mass, jacobian = mass_matrix(bicycle, y[:9]), velocity_rows(bicycle, surface, y)
    units = 1 / np.sqrt(np.diag(mass))
    rows = jacobian * units
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    block = np.block([[units[:, None] * mass * units, rows.T], [rows, np.zeros((6, 6))]])
    return float(np.linalg.cond(block))


def velocity_rows(bicycle: Bicycle, surface: Surface, y: np.ndarray) -> np.ndarray:
    jacobian = np.empty((6, 9))
    where = (surface.function.real, surface.parameters, constants(bicycle))
    kernel.rolling(y[:9], y[9:18], y[18:], *where, jacobian, np.empty(6), np.empty(6))
    return jacobian


def compare(bicycle: Bicycle, surface: Surface, y: np.ndarray) -> None:
    """Hold the right-hand side and the forces against the full system."""
    now = dynamics(bicycle, surface, y[:9], y[9:18])
    where = (surface.function.real, surface.parameters, aligned(constants(bicycle)))
    out, force = np.empty(24), np.empty(6)
    lean.derivative(y, *where, out)
    lean.contact_forces(y, *where, force)
    # The error of a solve: its order times round-off times condition; terms are of the size of rates squared.
    bound = 15 * ROUND_OFF * conditioning(bicycle, surface, y)
    size = np.abs(now.acceleration).max() + np.abs(y[9:18]).max() ** 2 + bicycle.gravity
    assert np.array_equal(out[:9], y[9:18])
    assert np.abs(out[9:18] - now.acceleration).max() <= bound * size
    assert np.abs(out[18:] - now.contact_rate.ravel()).max() <= bound * (1 + np.abs(now.contact_rate).max())
    weight = np.trace(mass_matrix(bicycle, y[:9])[:3, :3]) / 3 * size
    assert np.abs(force - now.force.ravel()).max() <= bound * weight


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
@pytest.mark.parametrize("bicycle", BICYCLES.values(), ids=BICYCLES)
@given(state=states)
def test_accelerations_and_forces_are_those_of_the_full_system(bicycle: Any, surface: Any, state: dict) -> None:
    compare(bicycle, surface, riding(bicycle, surface, state))


def cosines(bicycle: Bicycle, y: np.ndarray) -> np.ndarray:
    """Cosines between each wheel's tangent at its contact and the line between the contacts: (rear, front)."""
    c = constants(bicycle)
    both = kernel.wheels(y[:9], c)
    points, tangents = [], []
    for (centre, x, _, z, radius), angle in zip(both, (y[20], y[23]), strict=True):
        x, z = np.array(x), np.array(z)
        points.append(np.array(centre) + radius * (-np.sin(angle) * x - np.cos(angle) * z))
        tangents.append(-np.cos(angle) * x + np.sin(angle) * z)
    line = points[1] - points[0]
    return np.array(tangents) @ line / np.linalg.norm(line)


# Where the steering axis meets the ground at the rear contact, steering by a right angle puts the
# contacts side by side as the rear wheel sees them.
CASTOR = replace(BENCHMARK, wheelbase=0.5, trail=-0.5, steer_axis_tilt=0.0)


def steered(bicycle: Bicycle, surface: Surface, steer: float) -> np.ndarray:
    """Integration state from rough values: side by side, pitch does not bring the wheels to the ground."""
    height = evaluate(surface, np.array(0.3), np.array(-0.2))[0] + bicycle.front_wheel_radius
    q = np.array([0.3, -0.2, height, 2.0, 0.05, 0.0, steer, 0.0, 0.0])
    qd = np.array([1.0, 2.0, 0.0, 0.5, 0.7, 0.0, -1.1, 12.0, 9.0])
    y = np.concatenate([q, qd, contact_parameters(bicycle, surface, q)])
    c = constants(bicycle)
    assert project(y, surface.function.real, surface.parameters, c, aligned(c))
    return y


@pytest.mark.parametrize("offset", [0.0, 1e-15, -1e-9, 1e-5, -1e-3])
@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
@pytest.mark.parametrize(("bicycle", "wheel"), [(BENCHMARK, 1), (CASTOR, 0)], ids=["front wheel", "rear wheel"])
def test_a_wheel_square_to_the_line_of_contacts_is_no_singularity(
    bicycle: Bicycle, wheel: int, surface: Surface, offset: float
) -> None:
    def cosine(steer: float) -> float:
        return cosines(bicycle, steered(bicycle, surface, steer))[wheel]

    square = float(brentq(cosine, 1.0, 2.2, xtol=1e-15))  # pyright: ignore[reportArgumentType]
    at_root = cosines(bicycle, steered(bicycle, surface, square))
    # The root is found to the round-off of such an angle and of a projected state.
    assert abs(at_root[wheel]) < 1e-13
    assert abs(at_root[1 - wheel]) > 0.9
    compare(bicycle, surface, steered(bicycle, surface, square + offset))


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
@given(state=states, seed=st.integers(0, 2**32 - 1))
def test_projection_is_the_smallest_change(surface: Any, state: dict, seed: int) -> None:
    y = riding(BENCHMARK, surface, state)
    c = constants(BENCHMARK)
    where = (surface.function.real, surface.parameters)
    before = y + 1e-6 * np.random.default_rng(seed).standard_normal(24)
    after = before.copy()
    assert project(after, *where, c, aligned(c))
    q, qd, p = after[:9], after[9:18], after[18:]
    seen = observe(BENCHMARK, surface, q[None], qd[None])
    condition = conditioning(BENCHMARK, surface, after)
    # Where the projection stops, a few roundings of the coordinates, and as much again in measuring.
    assert np.abs(seen.gap).max() < 2e-15 * (5 + np.abs(q[:3]).sum()) + 10 * ROUND_OFF
    assert np.abs(seen.slip).max() < 15 * ROUND_OFF * condition * (1 + np.abs(qd).max())
    found = p.copy()
    assert kernel.find_contacts(q, found, *where, c)
    assert np.abs(found - p).max() < 15 * ROUND_OFF * condition

    jacobian, rows = velocity_rows(BENCHMARK, surface, after), np.empty((2, 9))
    kernel.normal_rows(q, p, *where, c, jacobian, rows)
    change = q - before[:9]
    along = rows.T @ np.linalg.lstsq(rows.T, change, rcond=None)[0]
    # What is not along the gradients is what they turn by on the way: 1e-6 a few times, squared, by
    # curvatures of contact and ground, at the most 1 / (1 / r - 2 alpha) of some 1e2.
    assert np.abs(change - along).max() < 1e-9
    # Least kinetic energy: M change lies in the span of the rows.
    step = np.linalg.solve(mass_matrix(BENCHMARK, q), jacobian.T)
    expected = -step @ np.linalg.solve(jacobian @ step, jacobian @ before[9:18])
    assert np.abs(qd - before[9:18] - expected).max() < 15 * ROUND_OFF * condition * (1 + np.abs(qd).max())

    again = after.copy()
    assert project(again, *where, c, aligned(c))
    assert np.abs(again - after).max() < 15 * ROUND_OFF * condition * (1 + np.abs(qd).max())
