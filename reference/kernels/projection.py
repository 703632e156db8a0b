"""Projection of a state onto contact and rolling by the smallest change.

Positions take the step of least norm along the gradients of the gaps. Velocities take the step of least kinetic
energy: minimal 1/2 d^T M d with J (qd + d) = 0 has the form of the equations of motion for accelerations (the
principle of least constraint), with the slip in place of beta and no other load, so `reduction`
solves it.
"""

from __future__ import annotations

from . import contact
from .compilation import jit, jit_inline
from .dynamics import wheels
from .linear import solve_three
from .pose import angle_rates, angular_velocity, pose, to_aligned, to_inertial
from .reduction import build, solve
from .vector import add, combine, cross, dot, scale, subtract


@jit_inline
def _gap_gradient(here, normal, rho):
    """Return the gradient of a gap in (yaw, lean, pitch, steer); the rear wheel does not move with steer.

    ``normal`` has components along (u, y, s).
    """
    moment = cross(rho, normal)
    return dot(here.z, moment), dot(here.ahead, moment), moment[1], moment[2]


@jit
def _project_positions(y, function, parameters, c, a):
    """Bring gaps and contact equations to round-off in place; return True on success."""
    # A gap is a difference of coordinates, rounded a few times.
    round_off = 2e-15 * (5 + abs(y[0]) + abs(y[1]) + abs(y[2]))
    for _ in range(10):
        rear, front = wheels(y, c)
        at_rear = contact.equations(*rear[:2], *rear[3:], y[18], y[19], y[20], function, parameters)
        at_front = contact.equations(*front[:2], *front[3:], y[21], y[22], y[23], function, parameters)
        step1, step2 = (
            solve_three(at_rear.jacobian, at_rear.residual),
            solve_three(at_front.jacobian, at_front.residual),
        )
        worst = 0.0
        for i in range(3):
            worst += abs(step1[i]) + abs(step2[i])
            y[18 + i] -= step1[i]
            y[21 + i] -= step2[i]
        if not worst < 1e300:
            return False
        # Newton's method leaves an error of the square of this step, as does the gap, at its closest approach.
        if worst < 1e-8 and abs(at_rear.gap) + abs(at_front.gap) < round_off:
            return True
        here = pose(y[3], y[4], y[5], y[6], y[20], y[23], a)
        g1 = _gap_gradient(here, to_aligned(here, *at_rear.normal), here.rear.rho)
        g2 = _gap_gradient(here, to_aligned(here, *at_front.normal), here.front.rho)
        m11 = 1.0 + g1[0] * g1[0] + g1[1] * g1[1] + g1[2] * g1[2]
        m12 = dot(at_rear.normal, at_front.normal) + g1[0] * g2[0] + g1[1] * g2[1] + g1[2] * g2[2]
        m22 = 1.0 + g2[0] * g2[0] + g2[1] * g2[1] + g2[2] * g2[2] + g2[3] * g2[3]
        det = m11 * m22 - m12 * m12
        u, v = (at_rear.gap * m22 - at_front.gap * m12) / det, (m11 * at_front.gap - m12 * at_rear.gap) / det
        for i in range(3):
            y[i] -= u * at_rear.normal[i] + v * at_front.normal[i]
            y[3 + i] -= u * g1[i] + v * g2[i]
        y[6] -= v * g2[3]
    return False


@jit
def _project_rates(y, a):
    """Remove the slip from the rates in place."""
    here = pose(y[3], y[4], y[5], y[6], y[20], y[23], a)
    rear, front, zero = here.rear, here.front, 0 * y[0]
    w = angular_velocity(here, y[12], y[13], y[14])
    velocity = to_aligned(here, y[9], y[10], y[11])
    slip = add(velocity, combine(1.0, cross(w, rear.rho), rear.radius * y[16], rear.t))
    w2 = (w[0], w[1], w[2] + y[15])
    slip2 = add(velocity, combine(1.0, cross(w2, front.rho), front.radius * y[17], front.t))
    moment2 = cross(slip, here.s2)
    moment = add(cross(slip, here.s1), moment2)
    system = build(here, a, scale(-a.mass, slip), moment, moment2[2], zero, zero, subtract(slip2, slip))
    turn, steer, rear_spin, front_spin = solve(system)
    origin = add(slip, combine(1.0, cross(turn, rear.rho), rear.radius * rear_spin, rear.t))
    change, angles = to_inertial(here, origin), angle_rates(here, turn)
    for i in range(3):
        y[9 + i] -= change[i]
        y[12 + i] += angles[i]
    y[15] += steer
    y[16] += rear_spin
    y[17] += front_spin


@jit
def project(y, function, parameters, c, a):
    """Move y = (q, qd, contact parameters), (24,), to contact and rolling in place; return True on success.

    ``c`` and ``a`` are the `kinematics.Constants` and the result of `pose.aligned` for them.
    """
    if not _project_positions(y, function, parameters, c, a):
        return False
    _project_rates(y, a)
    return True
