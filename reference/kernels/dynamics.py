"""Mass matrix, bias forces and rolling rows of the bicycle (Xiong et al. 2020, Eqs. 6-8).

With D on the steering axis, every angular coordinate turns its assembly about D, so for axis a_k

    velocity of a point D + r:   v_D + sum_k rate_k a_k x r
    mass matrix:                 M[x, k] = a_k x S,   M[k, l] = a_k . I a_l   (S, I about D)
    bias:                        h[x] = b x S + w x (w x S) + m g z
                                 h[k] = a_k . (I b + w x I w + spin w x axle + S x g z)

The material velocity of both contact points, v_D + w x rho + spin_rate axle x d = 0 (three
rows per wheel), combines the four rolling constraints and the time derivatives of the two gaps. Its own
time derivative, J qdd + gamma = 0, contains the contact's motion along the rim, ddot = w x d + r adot t.

The equations of motion are  M qdd + h = J^T F,  J qdd + gamma = 0,  with F the force of the ground on
each wheel in inertial axes: the six Lagrange multipliers. The generalised forces Q of the inputs
(`velodrome.reference.inputs`) are part of h as -Q.
"""

from __future__ import annotations

import numpy as np

from . import contact
from .compilation import jit
from .kinematics import angular_velocities, frames
from .linear import factorise, solve, solve_factorised
from .rim import find_contact
from .vector import add, combine, cross, dot, scale

# Dependent and independent generalised speeds of a consistent state.
DEPENDENT = np.array([0, 1, 2, 3, 5, 8])
INDEPENDENT = np.array([4, 6, 7])


@jit
def inertia_times(ixx, iyy, izz, ixz, x, y, z, v):
    """Multiply an inertia tensor with axes x, y, z by a vector."""
    vx, vy, vz = dot(x, v), dot(y, v), dot(z, v)
    return add(combine(ixx * vx + ixz * vz, x, ixz * vx + izz * vz, z), scale(iyy * vy, y))


@jit
def mass_and_bias(q, qd, c, mass, bias):
    """Fill the mass matrix (9, 9) and the bias forces (9,) of M qdd + h = forces; h includes the inputs."""
    a_lean, x_r, y_r, z_r, s, x_h, y_h, z_h = frames(q[3], q[4], q[5], q[6], c)
    w1, w2, b1, b2 = angular_velocities(a_lean, y_r, s, qd[3], qd[4], qd[5], qd[6])
    zero = 0 * q[3]
    up = (zero, zero, 1 + zero)
    s1 = combine(c.s1x, x_r, c.s1z, z_r)
    s2 = combine(c.s2x, x_h, c.s2z, z_h)
    total = add(s1, s2)
    mass[:] = 0
    for i in range(3):
        mass[i, i] = c.m1 + c.m2
    axes = (up, a_lean, y_r)
    for k in range(3):
        axis = axes[k]
        column = cross(axis, total)
        turned2 = inertia_times(c.i2xx, c.i2yy, c.i2zz, c.i2xz, x_h, y_h, z_h, axis)
        turned = add(inertia_times(c.i1xx, c.i1yy, c.i1zz, c.i1xz, x_r, y_r, z_r, axis), turned2)
        for i in range(3):
            mass[3 + k, i] = column[i]
        for j in range(k + 1):
            mass[3 + k, 3 + j] = dot(axes[j], turned)
        mass[6, 3 + k] = dot(s, turned2)
        mass[7, 3 + k] = c.spin_rear * dot(axis, y_r)
        mass[8, 3 + k] = c.spin_front * dot(axis, y_h)
    column = cross(s, s2)
    for i in range(3):
        mass[6, i] = column[i]
    mass[6, 6] = dot(s, inertia_times(c.i2xx, c.i2yy, c.i2zz, c.i2xz, x_h, y_h, z_h, s))
    mass[7, 7] = c.spin_rear
    mass[8, 8] = c.spin_front
    for i in range(9):
        for j in range(i):
            mass[j, i] = mass[i, j]

    force = add(cross(b1, s1), cross(w1, cross(w1, s1)))
    force = add(force, add(cross(b2, s2), cross(w2, cross(w2, s2))))
    weight = scale(c.gravity, up)
    t1 = add(inertia_times(c.i1xx, c.i1yy, c.i1zz, c.i1xz, x_r, y_r, z_r, b1), cross(s1, weight))
    momentum = inertia_times(c.i1xx, c.i1yy, c.i1zz, c.i1xz, x_r, y_r, z_r, w1)
    t1 = add(t1, cross(w1, combine(1.0, momentum, c.spin_rear * qd[7], y_r)))
    t2 = add(inertia_times(c.i2xx, c.i2yy, c.i2zz, c.i2xz, x_h, y_h, z_h, b2), cross(s2, weight))
    momentum = inertia_times(c.i2xx, c.i2yy, c.i2zz, c.i2xz, x_h, y_h, z_h, w2)
    t2 = add(t2, cross(w2, combine(1.0, momentum, c.spin_front * qd[8], y_h)))
    moment = add(t1, t2)
    for i in range(3):
        bias[i] = force[i]
        bias[3 + i] = dot(axes[i], moment)
    bias[2] += (c.m1 + c.m2) * c.gravity
    bias[6] = dot(s, t2) - (c.steer_torque - c.steer_damping * qd[6])
    bias[7] = c.spin_rear * dot(y_r, b1) - c.rear_wheel_torque
    bias[8] = c.spin_front * dot(y_h, b2)


@jit
def wheels(q, c):
    """Return both wheels as ``((centre, x, axle, z, radius), ...)``, x and z the axes of the wheel's frame."""
    _, x_r, y_r, z_r, _, x_h, y_h, z_h = frames(q[3], q[4], q[5], q[6], c)
    origin = (q[0], q[1], q[2])
    rear = add(origin, combine(c.rear_x, x_r, c.rear_z, z_r))
    front = add(origin, combine(c.front_x, x_h, c.front_z, z_h))
    return (rear, x_r, y_r, z_r, c.rear_radius), (front, x_h, y_h, z_h, c.front_radius)


@jit
def rolling(q, qd, p, function, parameters, c, jacobian, gamma, p_rate):
    """Fill the six velocity rows (6, 9), their bias (6,), the contact parameters' rates (6,); return the gaps."""
    a_lean, _, y_r, _, s, _, _, _ = frames(q[3], q[4], q[5], q[6], c)
    w1, w2, b1, b2 = angular_velocities(a_lean, y_r, s, qd[3], qd[4], qd[5], qd[6])
    zero = 0 * q[3]
    origin_rate = (qd[0], qd[1], qd[2])
    axes = ((zero, zero, 1 + zero), a_lean, y_r)
    both = wheels(q, c)
    rotations = ((w1, b1, qd[7]), (w2, b2, qd[8]))
    gaps = (zero, zero)
    jacobian[:] = 0
    for k in range(2):
        centre, x, axle, z, radius = both[k]
        w, b, spin = rotations[k]
        row = 3 * k
        here = contact.equations(centre, x, z, radius, p[row], p[row + 1], p[row + 2], function, parameters)
        d, t = here.arm, here.tangent
        gaps = (here.gap, zero) if k == 0 else (gaps[0], here.gap)
        rho = (centre[0] + d[0] - q[0], centre[1] + d[1] - q[1], centre[2] + d[2] - q[2])
        carried = add(origin_rate, cross(w, rho))
        rates = contact.rates(here, carried, w)
        along = radius * rates[2]
        d_rate = combine(1.0, cross(w, d), along, t)
        rho_rate = combine(1.0, cross(w, rho), along, t)
        roll = cross(axle, d)
        turning = add(cross(cross(w, axle), d), cross(axle, d_rate))
        drift = add(add(cross(b, rho), cross(w, rho_rate)), scale(spin, turning))
        steer = cross(s, rho)
        for i in range(3):
            jacobian[row + i, i] = 1
            jacobian[row + i, 7 + k] = roll[i]
            if k == 1:
                jacobian[row + i, 6] = steer[i]
            gamma[row + i] = drift[i]
            p_rate[row + i] = rates[i]
        for j in range(3):
            column = cross(axes[j], rho)
            for i in range(3):
                jacobian[row + i, 3 + j] = column[i]
    return gaps


@jit
def schur_complement(mass, jacobian, spread, schur):
    """With ``mass`` factorised, fill spread = (M^-1 J^T)^T (6, 9) and factorise J M^-1 J^T (6, 6)."""
    for i in range(6):
        for j in range(9):
            spread[i, j] = jacobian[i, j]
        solve_factorised(mass, spread[i], 9)
    for i in range(6):
        for j in range(i + 1):
            total = 0 * mass[0, 0]
            for k in range(9):
                total += jacobian[i, k] * spread[j, k]
            schur[i, j] = total
    factorise(schur, 6)


@jit
def accelerations(q, qd, p, function, parameters, c, qdd, force, p_rate):
    """Solve the 15 x 15 system: fill qdd (9,), the six multipliers (6,) and the contact rates (6,)."""
    mass, bias = np.empty((9, 9), q.dtype), np.empty(9, q.dtype)
    jacobian, spread = np.empty((6, 9), q.dtype), np.empty((6, 9), q.dtype)
    schur = np.empty((6, 6), q.dtype)
    mass_and_bias(q, qd, c, mass, bias)
    rolling(q, qd, p, function, parameters, c, jacobian, force, p_rate)
    factorise(mass, 9)
    solve_factorised(mass, bias, 9)  # minus the free acceleration
    schur_complement(mass, jacobian, spread, schur)
    for i in range(6):
        total = -force[i]  # gamma
        for k in range(9):
            total += jacobian[i, k] * bias[k]
        force[i] = total
    solve_factorised(schur, force, 6)
    for k in range(9):
        total = -bias[k]
        for i in range(6):
            total += spread[i, k] * force[i]
        qdd[k] = total


@jit
def residual(q, qd, qdd, p, force, function, parameters, c, out):
    """Evaluate all 21 equations (Eq. 8), scaled to order one: fill ``out`` (21,).

    Rows 0-8 the dynamics, divided by the weight; 9-14 the contact equations; 15-16 the gaps; 17-20
    the rolling constraints (lateral, forward of the rear, then the front wheel).
    """
    mass, bias = np.empty((9, 9), q.dtype), np.empty(9, q.dtype)
    jacobian, gamma, p_rate = np.empty((6, 9), q.dtype), np.empty(6, q.dtype), np.empty(6, q.dtype)
    mass_and_bias(q, qd, c, mass, bias)
    rolling(q, qd, p, function, parameters, c, jacobian, gamma, p_rate)
    weight = (c.m1 + c.m2) * c.gravity
    for i in range(9):
        total = bias[i]
        for k in range(9):
            total += mass[i, k] * qdd[k]
        for k in range(6):
            total -= jacobian[k, i] * force[k]
        out[i] = total / weight
    both = wheels(q, c)
    for k in range(2):
        centre, x, axle, z, radius = both[k]
        row = 3 * k
        here = contact.equations(centre, x, z, radius, p[row], p[row + 1], p[row + 2], function, parameters)
        for i in range(3):
            out[9 + row + i] = here.residual[i]
        out[15 + k] = here.gap
        lateral, forward = contact.tangents(axle, here.normal)
        for i in range(2):
            direction = lateral if i == 0 else forward
            total = 0 * q[0]
            for j in range(3):
                for m in range(9):
                    total += direction[j] * jacobian[row + j, m] * qd[m]
            out[17 + 2 * k + i] = total


@jit
def find_contacts(q, p, function, parameters, c):
    """Solve the contact equations at q from the guess in ``p`` (6,), in place; return True if both converged."""
    both = wheels(q, c)
    good = True
    for k in range(2):
        centre, x, _, z, radius = both[k]
        row = 3 * k
        p[row], p[row + 1], p[row + 2], found = contact.search(
            centre, x, z, radius, p[row], p[row + 1], p[row + 2], function, parameters
        )
        good = good and found
    return good


@jit
def guess_contacts(q, p, function, parameters, c):
    """Fill ``p`` (6,) with a guess from the wheels' poses alone."""
    both = wheels(q, c)
    for k in range(2):
        centre, x, _, z, radius = both[k]
        row = 3 * k
        p[row], p[row + 1], p[row + 2] = contact.first_guess(centre, x, z, radius, function, parameters)


@jit
def normal_rows(q, p, function, parameters, c, jacobian, rows):
    """Fill ``rows`` (2, 9), the gradients of the gaps: normals times the velocity rows ``jacobian`` (6, 9)."""
    both = wheels(q, c)
    for k in range(2):
        centre, x, _, z, radius = both[k]
        row = 3 * k
        here = contact.equations(centre, x, z, radius, p[row], p[row + 1], p[row + 2], function, parameters)
        for j in range(9):
            rows[k, j] = 0
            for i in range(3):
                rows[k, j] += here.normal[i] * jacobian[row + i, j]


@jit
def settle(q, p, function, parameters, c):
    """Move both wheels to the ground by height and pitch alone (q and p in place); return True on success.

    Newton's method; the gap's gradient is the normal velocity row, since the contact is a closest
    approach. One iteration beyond convergence makes the complex step exact.
    """
    jacobian, rows = np.empty((6, 9), q.dtype), np.empty((2, 9), q.dtype)
    gamma, p_rate, still = np.empty(6, q.dtype), np.empty(6, q.dtype), np.zeros(9, q.dtype)
    converged = False
    for _ in range(50):
        if not find_contacts(q, p, function, parameters, c):
            return False
        gaps = rolling(q, still, p, function, parameters, c, jacobian, gamma, p_rate)
        normal_rows(q, p, function, parameters, c, jacobian, rows)
        det = rows[0, 2] * rows[1, 5] - rows[0, 5] * rows[1, 2]
        dz = (gaps[0] * rows[1, 5] - gaps[1] * rows[0, 5]) / det
        dpitch = (rows[0, 2] * gaps[1] - rows[1, 2] * gaps[0]) / det
        worst = max(abs(dz), abs(dpitch))
        damping = 1.0 if worst <= 0.3 else 0.3 / worst
        q[2] -= damping * dz
        q[5] -= damping * dpitch
        if converged:
            return find_contacts(q, p, function, parameters, c)
        converged = worst < 1e-9
    return False


@jit
def complete_velocity(q, qd, p, function, parameters, c):
    """Solve for the six dependent speeds from the lean, steer and rear-wheel rates (qd in place)."""
    jacobian, square = np.empty((6, 9), q.dtype), np.empty((6, 6), q.dtype)
    gamma, p_rate, rhs = np.empty(6, q.dtype), np.empty(6, q.dtype), np.empty(6, q.dtype)
    rolling(q, qd, p, function, parameters, c, jacobian, gamma, p_rate)
    for i in range(6):
        rhs[i] = 0
        for k in INDEPENDENT:
            rhs[i] -= jacobian[i, k] * qd[k]
        for j in range(6):
            square[i, j] = jacobian[i, DEPENDENT[j]]
    solve(square, rhs, 6)
    for j in range(6):
        qd[DEPENDENT[j]] = rhs[j]


@jit
def energies(q, qd, c):
    """Return kinetic and potential energy, the latter zero at z = 0 [J]."""
    mass, bias = np.empty((9, 9), q.dtype), np.empty(9, q.dtype)
    mass_and_bias(q, qd, c, mass, bias)
    kinetic = 0 * q[0]
    for i in range(9):
        for j in range(9):
            kinetic += 0.5 * qd[i] * mass[i, j] * qd[j]
    _, x_r, _, z_r, _, x_h, _, z_h = frames(q[3], q[4], q[5], q[6], c)
    moment = c.s1x * x_r[2] + c.s1z * z_r[2] + c.s2x * x_h[2] + c.s2z * z_h[2]
    return kinetic, c.gravity * ((c.m1 + c.m2) * q[2] + moment)


@jit
def find_contacts_from_pose(q, p, ground, function, parameters, c):
    """Fill ``p`` (6,) with the contacts where both rims are deepest at q; return True if both were found."""
    both = wheels(q, c)
    good = True
    for k in range(2):
        centre, x, _, z, radius = both[k]
        row = 3 * k
        p[row], p[row + 1], p[row + 2], found = find_contact(centre, x, z, radius, ground, function, parameters)
        good = good and found
    return good
