"""The leading error of generalized alpha and of Newmark's methods on rigid bodies: their modified equation.

A method of order p rides, but for terms beyond all orders, a modified vector field X + h^p X_p + O(h^(p + 1)) (Hairer,
Lubich and Wanner 2006, chapter IX). Here the coordinates x are the bodies' positions and Euler parameters; joints and
gaps are constrained in x, and slip is zero in the method's own velocities v. With the accelerations A with which the
method fulfils the equations of motion (Arnold and Bruels 2007), a smooth solution x has

    v = x^(1) + c_v h^2 x^(3) + O(h^3),    A = x^(2) + c_a h^2 x^(4) + O(h^3)

in terms of its derivatives. So x moves as the bodies do under the additional forces of inertia -c_a h^2 M x^(4) and
those of the additional velocities c_v h^2 x^(3), on wheels that slip by -c_v h^2 times the slip of x^(3), with
derivatives along the exact motion. X_2 follows from the reference's equations with these loads.

References
----------
E. Hairer, C. Lubich, G. Wanner: Geometric Numerical Integration. 2nd edition, Springer, 2006.
M. Arnold, O. Bruels: Convergence of the generalized-alpha scheme for constrained mechanical systems. Multibody System
Dynamics 18 (2007) 185-202.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..bicycle import BODIES
from ..dae import bordered_parts
from ..kernels.dynamics import DEPENDENT, INDEPENDENT
from ..kernels.flow import take_steps
from ..kernels.pose import aligned
from ..kinematics import YAW, angular_velocities, body_positions, body_velocities, constants, rotations
from ..surface import evaluate
from .shooting import Flow
from .taylor import differentiate, expand_on_circle

# Circle of complex times on which a ride is expanded [s]: at 19 rad/s, of the fastest wheel, the terms left out are
# (0.04 x 19)^16 / 16! = 1e-15, and round-off of a fourth derivative of positions of 20 m is 24 x 20 eps / 0.04^4.
_RADIUS, _FLOW_STEPS = 0.04, 8
# Between looks at slip along the ride [s]: the stencil's error is (0.01 x 7)^6 / 140 at the fastest weave.
_AHEAD = 0.01
_FRAMES = [0, 1, 0, 1]  # the frame of each body, in the order of `BODIES`


class SecondOrderMethod(NamedTuple):
    """The coefficients c_v and c_a of a method of second order."""

    velocity: float
    acceleration: float


class FieldError(NamedTuple):
    """The leading error of a method at a state.

    Attributes
    ----------
    field : ndarray, shape (7,)
        X_2, for variables whose rates are the derivatives of the coordinates.
    rear_rate : float
        What the method's own rear rate differs by from the derivative of the wheel's angle, over h^2.
    """

    field: np.ndarray
    rear_rate: float


def second_order_error(flow: Flow, variables: np.ndarray, method: SecondOrderMethod) -> FieldError:
    """Compute the leading error of generalized alpha or a method of Newmark on bodies with Euler parameters.

    Parameters
    ----------
    flow : Flow
    variables : ndarray, shape (7,)
        Independent variables, near those of the flow.
    method : SecondOrderMethod

    Returns
    -------
    FieldError
    """
    bicycle, surface, inputs = flow.equations.bicycle, flow.equations.surface, flow.equations.inputs
    state = flow.moved_to(variables).near
    q, qd, p = state[:9], state[9:18], state[18:]
    jolt = _differentiate_bodies(flow, state)
    slip = _slip(flow, state, jolt)
    slip_rate = differentiate(lambda t: _slip_after(flow, state, t), _AHEAD)

    mass, _, rows, _ = bordered_parts(bicycle, surface, q, qd, p, inputs)
    speeds = np.zeros(9)
    speeds[DEPENDENT] = np.linalg.solve(rows[:, DEPENDENT], -method.velocity * slip)

    # Bias forces and gamma are quadratic in the rates: central differences of them are exact.
    (_, more, _, gamma_more), (_, less, _, gamma_less) = (
        bordered_parts(bicycle, surface, q, qd + sign * speeds, p, inputs) for sign in (1, -1)
    )
    load = -(more - less) / 2 - _inertia_load(flow, state, jolt, method)
    side = -(gamma_more - gamma_less) / 2 - method.velocity * slip_rate
    system = np.block([[mass, -rows.T], [rows, np.zeros((6, 6))]])
    acceleration = np.linalg.solve(system, np.concatenate([load, side]))[:9]

    x, y = q[0], q[1]
    field = np.array([speeds[0] + speeds[YAW] * y, speeds[1] - speeds[YAW] * x, 0.0, 0.0, *acceleration[INDEPENDENT]])
    axle = rotations(bicycle, q)[0][:, 1]
    own = method.velocity * float(axle @ (jolt.turned[2] - jolt.turned[0]))
    return FieldError(field, own)


class _BodyDerivatives(NamedTuple):
    """Third and fourth derivatives of bodies' coordinates, those of Euler parameters p as G p^(n) in the bodies' axes.

    G is the matrix of angular velocity in the body's axes, w = G p'.
    """

    third: np.ndarray  # of the centres of mass (4, 3)
    fourth: np.ndarray
    turn_third: np.ndarray  # G p^(3) (4, 3)
    turn_fourth: np.ndarray
    spin: np.ndarray  # w (4, 3)
    turned: np.ndarray  # G p^(3) in inertial axes (4, 3)


def _state_after(flow: Flow, state: np.ndarray, time: complex) -> np.ndarray:
    """Return the state (24,) after a time, which may be complex."""
    surface, c = flow.equations.surface, constants(flow.equations.bicycle, flow.equations.inputs)
    y = state.astype(complex)
    take_steps(y, complex(time), _FLOW_STEPS, surface.function.complex, surface.parameters, aligned(c))
    return y


def _differentiate_bodies(flow: Flow, state: np.ndarray) -> _BodyDerivatives:
    bicycle = flow.equations.bicycle
    offsets = np.array([bicycle.centre(body) - bicycle.reference_point for body in BODIES])

    def bodies(times: np.ndarray) -> np.ndarray:
        states = np.array([_state_after(flow, state, time) for time in times])
        q, qd = states[:, :9], states[:, 9:18]
        turned = rotations(bicycle, q)
        centres = q[:, None, :3] + np.einsum("nbij,bj->nbi", turned[:, _FRAMES], offsets)
        spins = np.einsum("nbji,nbj->nbi", turned, angular_velocities(bicycle, q, qd))
        return np.concatenate([centres, spins], axis=1).reshape(len(times), -1)

    series = [values.reshape(8, 3) for values in expand_on_circle(bodies, _RADIUS, range(5))]
    third, fourth = 6 * series[3][:4], 24 * series[4][:4]
    w, first, second, more = series[0][4:], series[1][4:], 2 * series[2][4:], 6 * series[3][4:]
    # With p^(n) = p a_n as quaternions, a_1 = w / 2 and a_(n + 1) = a_n' + (w / 2) a_n; G p^(n) is twice a_n's vector.
    size, mixed = np.sum(w * w, axis=1, keepdims=True), np.sum(w * first, axis=1, keepdims=True)
    vector = second / 2 + np.cross(w, first) / 4 - size * w / 8
    scalar = -0.75 * mixed
    rate = more / 2 + np.cross(w, second) / 4 - (2 * mixed * w + size * first) / 8
    turn_third, turn_fourth = 2 * vector, 2 * rate + np.cross(w, vector) + scalar * w
    turned = np.einsum("bij,bj->bi", rotations(bicycle, state[:9]), turn_third)
    return _BodyDerivatives(third, fourth, turn_third, turn_fourth, w, turned)


def _slip(flow: Flow, state: np.ndarray, jolt: _BodyDerivatives) -> np.ndarray:
    """Return the slip (6,) of both wheels in inertial axes with x^(3) in the place of the velocity."""
    bicycle, surface = flow.equations.bicycle, flow.equations.surface
    centres, points = body_positions(bicycle, state[:9])[2:], state[18:].reshape(2, 3)[:, :2]
    height, along_x, along_y = evaluate(surface, points[:, 0], points[:, 1])[:, :3].T
    arms = np.column_stack([points, height]) - centres
    normals = np.column_stack([-along_x, -along_y, np.ones(2)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    velocity = jolt.third[2:] + np.cross(jolt.turned[2:], arms)
    return (velocity - normals * np.sum(velocity * normals, axis=1, keepdims=True)).ravel()


def _slip_after(flow: Flow, state: np.ndarray, time: float) -> np.ndarray:
    later = np.real(_state_after(flow, state, time))
    return _slip(flow, later, _differentiate_bodies(flow, later))


def _inertia_load(flow: Flow, state: np.ndarray, jolt: _BodyDerivatives, method: SecondOrderMethod) -> np.ndarray:
    """Return the generalised forces (9,) of the additional accelerations and velocities, on the side of the inertia."""
    bicycle = flow.equations.bicycle
    q = np.repeat(state[None, :9], 9, axis=0)
    unit = np.eye(9)
    partial = body_velocities(bicycle, q, unit)
    turning = np.einsum("nbji,nbj->nbi", rotations(bicycle, q), angular_velocities(bicycle, q, unit))
    load = np.zeros(9)
    for b, body in enumerate(BODIES):
        inertia = bicycle.inertia(body)
        w, changed = jolt.spin[b], jolt.turn_third[b]
        moment = np.cross(changed, inertia @ w) + np.cross(w, inertia @ changed)
        load += bicycle.body_mass(body) * method.acceleration * (partial[:, b] @ jolt.fourth[b])
        load += turning[:, b] @ (method.acceleration * (inertia @ jolt.turn_fourth[b]) + method.velocity * moment)
    return load
