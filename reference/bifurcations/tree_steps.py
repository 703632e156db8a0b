"""Steps of the classical Runge-Kutta method of order 4 on a tree of bodies under the forces of rolling.

The rear frame's rotation is R_n exp(u) with u = 0 at the beginning of a step, and u' = dexp^-1(u) w with w the angular
velocity in the frame's axes (Munthe-Kaas 1999), as in MuJoCo from its release 4.0 on. All other coordinates and the
velocities (that of D, w, the hinges' rates) are added as numbers. Forces of rolling hold the accelerations of the
contacts at -2 s v - s^2 gap along the normal, v their slip and approach, so that what a step leaves of them decays.

The map of a step is that of all 15 variables of the heading frame: x, y, z, lean, pitch, steer and the nine rates.

References
----------
H. Munthe-Kaas: High order Runge-Kutta methods on manifolds. Applied Numerical Mathematics 29 (1999) 115-127.
"""

from __future__ import annotations

import numpy as np

from ..dae import contact_parameters
from ..kernels.dynamics import find_contacts, mass_and_bias, rolling
from ..kinematics import FRONT_ANGLE, LEAN, PITCH, REAR_ANGLE, STEER, YAW, constants
from ..stability import independent
from .near_circles import family_tangent, linearise_variables, state_of_variables
from .shooting import Flow
from .step_map import SteppedCircle, solve_stepped_circle
from .taylor import differentiate

_WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
_STAGES = (0.0, 0.5, 0.5, 1.0)  # each begins from the stage before
_HINGES = [REAR_ANGLE, STEER, FRONT_ANGLE]
_KEPT = [0, 1, 2, LEAN, PITCH, STEER]  # coordinates in the heading frame
_REAR_RATE_OF_ALL = len(_KEPT) + REAR_ANGLE
_ALONG = 1e-3  # change of the rear rate for the family's tangent [rad/s]; the error is of sixth order


def step_runge_kutta(flow: Flow, state: np.ndarray, step: float, stabilisation: float) -> np.ndarray:
    """Return the 15 variables, complex, after a step of the classical method of order 4 on a tree of bodies."""
    q, qd = np.zeros(9, complex), state[len(_KEPT) :]
    q[_KEPT] = state[: len(_KEPT)]
    rotation, velocities = _rotation(q), _tree_velocities(q, qd)
    turns: list[np.ndarray] = []
    moving: list[np.ndarray] = []
    changing: list[np.ndarray] = []
    turn, stage_q, stage_velocities = np.zeros(3, complex), q, velocities
    for share in _STAGES:
        if share:
            turn = share * step * turns[-1]
            stage_q = _move(q, rotation, share * step * moving[-1], turn)
            stage_velocities = velocities + share * step * changing[-1]
        stage_qd = _coordinate_rates(stage_q, stage_velocities)
        acceleration = _accelerate(flow, stage_q, stage_qd, stabilisation)
        turns.append(_inverse_tangent(turn, stage_velocities[3:6]))
        moving.append(stage_velocities)
        changing.append(_tree_accelerations(stage_q, stage_qd, acceleration))
    turn, moved, gained = (
        step * np.einsum("s,si->i", _WEIGHTS, np.array(stages)) for stages in (turns, moving, changing)
    )
    end_q = _move(q, rotation, moved, turn)
    end_qd = _coordinate_rates(end_q, velocities + gained)
    cosine, sine = np.cos(end_q[YAW]), np.sin(end_q[YAW])
    back = np.array([[cosine, sine], [-sine, cosine]])
    end_q[:2], end_qd[:2] = back @ end_q[:2], back @ end_qd[:2]
    return np.concatenate([end_q[_KEPT], end_qd])


def solve_runge_kutta_circle(
    flow: Flow, q: np.ndarray, qd: np.ndarray, step: float, stabilisation: float
) -> SteppedCircle:
    """Solve for the circle of the classical method of order 4 on a tree of bodies.

    Parameters
    ----------
    flow : Flow
    q, qd : ndarray, shape (9,)
        Of a circular motion with the rear rate, at yaw 0.
    step : float
        [s].
    stabilisation : float
        Rate s at which gaps and slip decay [1/s].

    Returns
    -------
    SteppedCircle
        In the 15 variables.

    Raises
    ------
    ValueError
        If Newton's method does not converge, or a wheel has no contact.
    """
    circle = independent(q, qd)
    along = family_tangent(linearise_variables(flow, circle).jacobian)

    def place(change: float) -> np.ndarray:
        there, rates = state_of_variables(flow, circle + change * along)
        return np.concatenate([there[_KEPT], rates])

    tangent = differentiate(place, _ALONG)
    start = np.concatenate([q[_KEPT], qd])
    return solve_stepped_circle(
        lambda state: step_runge_kutta(flow, state, step, stabilisation), start, tangent, _REAR_RATE_OF_ALL, step
    )


def _accelerate(flow: Flow, q: np.ndarray, qd: np.ndarray, stabilisation: float) -> np.ndarray:
    """Return the accelerations (9,) of the coordinates under the forces of rolling, off the constraints too."""
    bicycle, surface = flow.equations.bicycle, flow.equations.surface
    c, function, parameters = constants(bicycle, flow.equations.inputs), surface.function.complex, surface.parameters
    p = contact_parameters(bicycle, surface, np.real(q)).astype(complex)
    found = find_contacts(q, p, function, parameters, c)
    if not found:
        raise ValueError("a wheel has no contact there")
    mass, bias, rows = np.zeros((9, 9), complex), np.zeros(9, complex), np.zeros((6, 9), complex)
    gamma, contact_rates = np.zeros(6, complex), np.zeros(6, complex)
    mass_and_bias(q, qd, c, mass, bias)
    gaps = rolling(q, qd, p, function, parameters, c, rows, gamma, contact_rates)
    closing = 2 * stabilisation * (rows @ qd)
    for wheel in range(2):
        _, along_x, along_y, *_ = function(p[3 * wheel], p[3 * wheel + 1], parameters)
        normal = np.array([-along_x, -along_y, 1.0]) / np.sqrt(1 + along_x**2 + along_y**2)
        closing[3 * wheel : 3 * wheel + 3] += stabilisation**2 * gaps[wheel] * normal
    system = np.block([[mass, -rows.T], [rows, np.zeros((6, 6))]])
    return np.linalg.solve(system, np.concatenate([-bias, -gamma - closing]))[:9]


def _rotation(q: np.ndarray) -> np.ndarray:
    """Return the rear frame's rotation (3, 3), complex."""
    (cy, cl, cp), (sy, sl, sp) = np.cos(q[[YAW, LEAN, PITCH]]), np.sin(q[[YAW, LEAN, PITCH]])
    yawed = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    leant = np.array([[1, 0, 0], [0, cl, -sl], [0, sl, cl]])
    return yawed @ leant @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])


def _move(q: np.ndarray, rotation: np.ndarray, moved: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return coordinates (9,) that lie a way (9,) of the tree's velocities and a rotation exp(turn) ahead."""
    turned = rotation @ _exponential(turn)
    ahead = q.copy()
    ahead[:3] += moved[:3]
    ahead[_HINGES] += moved[6:]
    ahead[YAW] = np.arctan(-turned[0, 1] / turned[1, 1])
    ahead[LEAN] = np.arcsin(turned[2, 1])
    ahead[PITCH] = np.arctan(-turned[2, 0] / turned[2, 2])
    return ahead


def _spin_matrix(q: np.ndarray) -> np.ndarray:
    """Return the matrix from yaw, lean and pitch rates to the rear frame's angular velocity in its axes."""
    cl, cp, sl, sp = np.cos(q[LEAN]), np.cos(q[PITCH]), np.sin(q[LEAN]), np.sin(q[PITCH])
    return np.array([[-cl * sp, cp, 0], [sl, 0, 1], [cl * cp, sp, 0]])


def _tree_velocities(q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Return the velocity of D, the rear frame's angular velocity in its axes, and the hinges' rates."""
    return np.concatenate([qd[:3], _spin_matrix(q) @ qd[YAW : PITCH + 1], qd[_HINGES]])


def _coordinate_rates(q: np.ndarray, velocities: np.ndarray) -> np.ndarray:
    qd = np.zeros(9, complex)
    qd[:3], qd[_HINGES] = velocities[:3], velocities[6:]
    qd[YAW : PITCH + 1] = np.linalg.solve(_spin_matrix(q), velocities[3:6])
    return qd


def _tree_accelerations(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Return the derivatives of `_tree_velocities`."""
    cl, cp, sl, sp = np.cos(q[LEAN]), np.cos(q[PITCH]), np.sin(q[LEAN]), np.sin(q[PITCH])
    lean_rate, pitch_rate = qd[LEAN], qd[PITCH]
    change = np.array(
        [
            [sl * sp * lean_rate - cl * cp * pitch_rate, -sp * pitch_rate, 0],
            [cl * lean_rate, 0, 0],
            [-sl * cp * lean_rate - cl * sp * pitch_rate, cp * pitch_rate, 0],
        ]
    )
    spin = _spin_matrix(q) @ qdd[YAW : PITCH + 1] + change @ qd[YAW : PITCH + 1]
    return np.concatenate([qdd[:3], spin, qdd[_HINGES]])


def _exponential(turn: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) by a complex rotation vector; series in its square, which is below 0.1."""
    square = turn @ turn
    x, y, z = turn
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sine = 1 - square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72 * (1 - square / 110))))
    cosine = 0.5 - square / 24 * (1 - square / 30 * (1 - square / 56 * (1 - square / 90 * (1 - square / 132))))
    return np.eye(3) + sine * cross + cosine * (cross @ cross)


def _inverse_tangent(turn: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Return the derivative of a rotation vector from the angular velocity in the turned axes."""
    square = turn @ turn
    # (1 - (a/2) cot(a/2)) / a^2
    factor = 1 / 12 + square / 720 + square**2 / 30240 + square**3 / 1209600 + square**4 / 47900160
    once = np.cross(turn, spin)
    return spin + once / 2 + factor * np.cross(turn, once)
