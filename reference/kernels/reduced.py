"""The equations of motion in seven independent variables, and their Jacobian (Xiong et al. 2020, Eqs. 15-17).

The state v = (x, y, lean, steer, lean_rate, steer_rate, spin), in the heading frame, has the vector field

    X(v) = (x' + yaw_rate y, y' - yaw_rate x, lean_rate, steer_rate, lean'', steer'', spin')

``spin`` is the rate of the rear wheel, or of the front wheel where the rear one stands or nearly does: a
pivoting motion has no rear rate from which its speed could be seen. Eigenvalues do not depend on the choice.

The dependent quantities are four positions w = (z, pitch, rim angles), given by the rows h of `circle` that bring
both rim points to the ground, and the speeds, given by rolling. A change dv of the positions in v changes w by
dw = -(dh/dw)^-1 dh/dv; with l the line between the contacts and c the columns of `reduction`, the angular velocity
and the other spin follow from

    w x l + steer_rate c_steer + rear_spin c_rear + front_spin c_front = 0

and the velocity of D from the rear wheel, v_D = -(w x rho + rear_spin r t). Each column of dX/dv takes one
complex step of this and of `lean`.
"""

from __future__ import annotations

import numpy as np

from .circle import STEP, rim_point
from .compilation import jit, jit_inline
from .lean import derivative
from .linear import solve, solve_three
from .pose import angular_velocity, pose, to_inertial
from .vector import add, combine, cross, scale, subtract

VARIABLES = 7
REAR, FRONT = 16, 17  # index of the spin in the state (q, qd, contact parameters)
_POSITIONS = np.array([0, 1, 4, 6, 2, 5, 20, 23])  # x, y, lean, steer | z, pitch, rim angles
_SPEEDS = np.array([13, 15])  # lean_rate, steer_rate


@jit
def telling_spin(rear, front):
    """Return the index in y of the spin to use: the rear wheel's unless it stands or nearly does."""
    return REAR if abs(rear) >= 0.2 * abs(front) else FRONT


@jit_inline
def _rim_points(y, function, parameters, a):
    here = pose(y[3], y[4], y[5], y[6], y[20], y[23], a)
    rear = rim_point(here, here.rear, y[0], y[1], y[2], function, parameters)
    return here, rear, rim_point(here, here.front, y[0], y[1], y[2], function, parameters)


@jit
def _ground_rows(y, function, parameters, a, out):
    """Fill ``out`` (4,) with the heights and dips of both rim points."""
    _, rear, front = _rim_points(y, function, parameters, a)
    out[0], out[1], out[2], out[3] = rear.height, rear.dip, front.height, front.dip


@jit
def _dependent_rates(y, function, parameters, a, out):
    """Fill ``out`` (4, 4): derivatives of z, pitch, rim angles in x, y, lean, steer; ``y`` complex (24,)."""
    rows = np.empty(4, np.complex128)
    matrix, sides = np.empty((4, 4)), np.empty((4, 4))
    for j in range(8):
        k = _POSITIONS[j]
        y[k] += complex(0.0, STEP)
        _ground_rows(y, function, parameters, a, rows)
        y[k] = y[k].real
        for i in range(4):
            if j < 4:
                sides[j, i] = -rows[i].imag / STEP
            else:
                matrix[i, j - 4] = rows[i].imag / STEP
    for j in range(4):
        solve(matrix.copy(), sides[j], 4)
        for i in range(4):
            out[i, j] = sides[j, i]


@jit
def complete(y, spin, function, parameters, a):
    """Fill the dependent speeds and the contact points of ``y`` (24,) in place; ``spin`` one of REAR, FRONT."""
    here, rear, front = _rim_points(y, function, parameters, a)
    y[18], y[19], y[21], y[22] = rear.xi, rear.eta, front.xi, front.eta
    zero = 0 * y[0]
    line = subtract(here.front.rho, here.rear.rho)
    c_rear, c_front = scale(-here.rear.radius, here.rear.t), scale(here.front.radius, here.front.t)
    given, other = (c_rear, c_front) if spin == REAR else (c_front, c_rear)
    steer = (-here.front.rho[1] * y[15], here.front.rho[0] * y[15], zero)
    known = add(combine(y[13], cross(here.ahead, line), y[spin], given), steer)
    turn, pitch = cross(here.z, line), (line[2], zero, -line[0])
    rows = (
        (turn[0], pitch[0], other[0]),
        (turn[1], pitch[1], other[1]),
        (turn[2], pitch[2], other[2]),
    )
    y[12], y[14], y[FRONT if spin == REAR else REAR] = solve_three(rows, scale(-1.0, known))
    w = angular_velocity(here, y[12], y[13], y[14])
    velocity = combine(-1.0, cross(w, here.rear.rho), -here.rear.radius * y[16], here.rear.t)
    y[9], y[10], y[11] = to_inertial(here, velocity)


@jit
def reduced_jacobian(y, spin, function, parameters, a, field, jacobian):
    """Fill X(v) (7,) and dX/dv (7, 7) at a state that touches the ground.

    ``y`` = (q, qd, contact parameters), (24,), at yaw 0; its dependent speeds and contact points need
    not be right. ``spin`` is one of REAR, FRONT, ``function`` the surface's for complex numbers, ``a`` the
    `Aligned` constants.
    """
    carried, z, rate = np.empty((4, 4)), y.astype(np.complex128), np.empty(24, np.complex128)
    _dependent_rates(z, function, parameters, a, carried)
    for j in range(VARIABLES):
        for i in range(24):
            z[i] = y[i]
        if j < 4:
            z[_POSITIONS[j]] += complex(0.0, STEP)
            for i in range(4):
                z[_POSITIONS[4 + i]] += complex(0.0, STEP * carried[i, j])
        else:
            z[spin if j == 6 else _SPEEDS[j - 4]] += complex(0.0, STEP)
        complete(z, spin, function, parameters, a)
        derivative(z, function, parameters, a, rate)
        column = (
            rate[0] + z[12] * z[1],
            rate[1] - z[12] * z[0],
            z[13],
            z[15],
            rate[13],
            rate[15],
            rate[spin],
        )
        for i in range(VARIABLES):
            field[i] = column[i].real
            jacobian[i, j] = column[i].imag / STEP
