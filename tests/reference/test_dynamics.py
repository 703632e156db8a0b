from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.literature import published
from velodrome.reference.bicycle import BODIES, Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state, dynamics, mass_matrix, residual
from velodrome.reference.kernels import dynamics as kernel
from velodrome.reference.kinematics import constants
from velodrome.reference.surface import Paraboloid, Plane

BICYCLE = Bicycle()
angle = st.floats(-1.3, 1.3)
coordinates = st.tuples(*[st.floats(-5, 5)] * 3, *[angle] * 6).map(np.array)
rates = st.tuples(*[st.floats(-10, 10)] * 9).map(np.array)
STEP = 1e-30


def _turn(axis: np.ndarray, angle: complex) -> np.ndarray:
    k = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def _body_jacobians(q: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray, np.ndarray, complex]]:
    """Independent of the kernels: mass, velocity and spin Jacobians, turned inertia, height of each body."""
    x, y, z = np.eye(3)
    yawed = _turn(z, q[3])
    leaned = yawed @ _turn(x, q[4])
    rear = leaned @ _turn(y, q[5])
    front = rear @ _turn(BICYCLE.steer_axis, q[6])
    shared = [z + 0 * q[3], yawed @ x, leaned @ y]
    steer, none = rear @ BICYCLE.steer_axis, np.zeros(3)
    bodies = []
    for body in BODIES:
        carrier = rear if body.startswith("rear") else front
        arm = carrier @ (BICYCLE.centre(body) - BICYCLE.reference_point)
        spins = [none] * 3 + shared + [steer if carrier is front else none, none, none]
        moves = [*np.eye(3), *(np.cross(axis, arm) for axis in spins[3:])]
        axes = carrier
        if body.endswith("wheel"):
            index = 7 if carrier is rear else 8
            spins[index] = carrier @ y
            axes = carrier @ _turn(y, q[index])
        turned = axes @ BICYCLE.inertia(body) @ axes.T
        bodies.append((BICYCLE.body_mass(body), np.array(moves).T, np.array(spins).T, turned, q[2] + arm[2]))
    return bodies


def _mass(q: np.ndarray) -> Any:
    return sum(m * v.T @ v + w.T @ inertia @ w for m, v, w, inertia, _ in _body_jacobians(q))  # pyright: ignore


def _potential(q: np.ndarray) -> complex:
    return BICYCLE.gravity * sum(m * height for m, _, _, _, height in _body_jacobians(q))


@given(coordinates)
def test_mass_matrix_is_that_of_four_bodies(q: np.ndarray) -> None:
    assert np.allclose(mass_matrix(BICYCLE, q), _mass(q), rtol=0, atol=1e-12)  # entries up to 94


@given(coordinates, rates)
def test_bias_forces_are_lagranges(q: np.ndarray, qd: np.ndarray) -> None:
    """h = (dM/dt) qd - d(qd M qd / 2)/dq + dV/dq, derivatives by the complex step."""
    slopes, gradient = np.empty((9, 9, 9)), np.empty(9)
    for k in range(9):
        z = q.astype(complex)
        z[k] += 1j * STEP
        slopes[k] = np.imag(_mass(z)) / STEP
        gradient[k] = _potential(z).imag / STEP
    expected = np.einsum("kij,k,j->i", slopes, qd, qd) - 0.5 * np.einsum("kij,i,j->k", slopes, qd, qd) + gradient
    mass, bias = np.empty((9, 9)), np.empty(9)
    kernel.mass_and_bias(q, qd, constants(BICYCLE), mass, bias)
    # Terms of size (94 kg m^2) (10 rad/s)^2, some dozens of them.
    assert np.allclose(bias, expected, rtol=0, atol=1e-14 * (1e3 + 100 * qd @ qd * 10))


@given(coordinates, rates)
def test_energies_are_those_of_four_bodies(q: np.ndarray, qd: np.ndarray) -> None:
    seen = kernel.energies(q, qd, constants(BICYCLE))
    assert seen[0] == pytest.approx(0.5 * qd @ _mass(q) @ qd, rel=1e-12, abs=1e-12)
    assert seen[1] == pytest.approx(_potential(q), abs=1e-11)


@given(
    st.tuples(st.floats(-0.8, 0.8), angle, st.floats(-1, 1), st.floats(-1, 1)),
    st.sampled_from([0.0, 0.005, 0.05, 0.2]),
    st.tuples(*[st.floats(-3, 3)] * 2, st.floats(-30, 30)),
)
def test_rolling_bias_is_the_rate_of_the_rolling_rows(state: tuple, alpha: float, speeds: tuple) -> None:
    """gamma = (dJ/dt) qd along qd and the contact's own motion: the complex step in time."""
    lean, steer, x, y = state
    surface, c = Paraboloid(alpha), constants(BICYCLE)
    q, qd = consistent_state(BICYCLE, surface, (x, y), lean, steer, speeds)
    now = dynamics(BICYCLE, surface, q, qd)
    p, rate = now.contact.ravel(), now.contact_rate.ravel()
    jacobian, gamma = np.empty((6, 9)), np.empty(6)
    kernel.rolling(q, qd, p, surface.function.real, surface.parameters, c, jacobian, gamma, np.empty(6))
    later = np.empty((6, 9), complex)
    kernel.rolling(
        q + 1j * STEP * qd,
        qd.astype(complex),
        p + 1j * STEP * rate,
        surface.function.complex,
        surface.parameters,
        c,
        later,
        np.empty(6, complex),
        np.empty(6, complex),
    )
    scale = 1 + np.abs(qd).max() ** 2
    assert np.allclose(np.imag(later) / STEP @ qd, gamma, rtol=0, atol=1e-12 * scale)
    # and the accelerations keep the wheels rolling
    assert np.allclose(jacobian @ now.acceleration, -gamma, rtol=0, atol=1e-10 * scale)


def test_basu_mandals_accelerations() -> None:
    """All nine accelerations of Table 1; x, y (both turned) and z are those of the rear wheel's centre."""
    table = published("basu_mandal2007")
    q, v, a = table["q"], table["qd"], table["qdd"]
    lean, rates = np.pi / 2 - q["psi"], (-v["psi"], v["psif"], v["betar"])
    state = consistent_state(BICYCLE, Plane(), (0.0, 0.0), lean, q["psif"], rates, yaw=q["theta"])
    found = dynamics(BICYCLE, Plane(), *state).acceleration
    expected = [a["theta"], -a["psi"], a["phi"], a["psif"], a["betar"], a["betaf"]]
    assert np.abs(found[3:] - expected).max() < 1e-11
    # The wheel's centre: the complex step of its velocity along the motion.
    c = constants(BICYCLE)

    def hub(coordinates: np.ndarray) -> np.ndarray:
        return np.array(kernel.wheels(coordinates, c)[0][0])

    def hub_velocity(coordinates: np.ndarray, speeds: np.ndarray) -> np.ndarray:
        # d/dt hub = sum_k (d hub / d q_k) speeds_k, real parts exact by a second complex step
        columns = []
        for k in range(9):
            z = coordinates.astype(complex)
            z[k] += 1j * STEP
            columns.append(np.imag(hub(z)) / STEP)
        return np.array(columns).T @ speeds

    q0, qd0 = state
    assert np.abs(hub_velocity(q0, qd0) - [-v["x"], -v["y"], v["z"]]).max() < 1e-11
    # Central differences of the velocity: error h^2 / 6 times its second derivative (some 1e3 m/s^3),
    # extrapolated once (h^4), and round-off 1e-15 / h.
    slopes = [
        (hub_velocity(q0 + h * qd0, qd0 + h * found) - hub_velocity(q0 - h * qd0, qd0 - h * found)) / (2 * h)
        for h in (2e-4, 1e-4)
    ]
    assert np.abs((4 * slopes[1] - slopes[0]) / 3 - [-a["x"], -a["y"], a["z"]]).max() < 1e-10


def test_symbrims_accelerations() -> None:
    """The state of Table 1 as Kane's method solves it, in axes with z down."""
    table = published("symbrim")
    q, u, acceleration = (np.array(table[name]) for name in ("q", "u", "udot"))
    state = consistent_state(BICYCLE, Plane(), (0.0, 0.0), q[3], -q[6], (u[3], -u[6], -u[5]), yaw=-q[2])
    now = dynamics(BICYCLE, Plane(), *state)
    turned = np.array([-1, 1, -1, -1, -1, -1])  # lean's axis is forward either way
    order = [3, 4, 5, 7, 6, 8]
    # Printed with 15 digits; rates of some 10 solved to round-off.
    assert np.abs(now.contact_rate[0, :2] * [1, -1] - u[:2]).max() < 1e-12
    assert np.abs(state[1][order] * turned - u[2:]).max() < 1e-12
    assert np.abs(now.acceleration[order] * turned - acceleration[2:]).max() < 1e-11


def test_static_wheel_loads() -> None:
    loads = published("meijaard2007")["static_normal_force"]
    q, qd = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, (0.0, 0.0, 0.0))
    force = dynamics(BICYCLE, Plane(), q, qd).force
    assert np.allclose(force[:, 2], [loads["rear"], loads["front"]], rtol=0, atol=1e-11)
    assert np.abs(force[:, :2]).max() < 1e-11


@given(st.tuples(st.floats(-0.8, 0.8), angle), st.sampled_from([0.0, 0.2]), st.floats(-25, 25))
def test_accelerations_solve_all_21_equations(state: tuple, alpha: float, rear_rate: float) -> None:
    surface = Paraboloid(alpha)
    q, qd = consistent_state(BICYCLE, surface, (0.5, -0.4), state[0], state[1], (0.4, -0.3, rear_rate), yaw=0.7)
    now = dynamics(BICYCLE, surface, q, qd)
    rows = residual(BICYCLE, surface, q, qd, now.acceleration, now.contact.ravel(), now.force.ravel())
    assert np.abs(rows).max() < 1e-12 * (1 + rear_rate**2)


def test_ideal_contacts_do_no_work() -> None:
    """Power of inertia and gravity is zero, so that of the six contact forces is."""
    surface = Paraboloid(0.2)
    q, qd = consistent_state(BICYCLE, surface, (0.9, 0.3), 0.3, 0.4, (0.5, 0.5, 9.0))
    now = dynamics(BICYCLE, surface, q, qd)
    mass, bias = np.empty((9, 9)), np.empty(9)
    kernel.mass_and_bias(q, qd, constants(BICYCLE), mass, bias)
    forces = mass @ now.acceleration + bias
    assert abs(qd @ forces) < 1e-11 * np.abs(qd * forces).max() * 9
    seen = observe(BICYCLE, surface, q[None], qd[None])
    assert np.abs(seen.slip).max() < 1e-13
