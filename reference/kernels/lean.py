"""The right-hand side of the equations of motion with the six rolling constraints eliminated exactly.

Vectors have components along (u, y, s) of `pose`. With w the angular velocity of the rear frame and
w + steer_rate s that of the front frame, S and I first moments and inertia about D, rho the contact
from D, t and e the rim's tangent and radial unit vectors there (axle x e = t, axle x t = -e):

rolling     v_D + w x rho + spin r t = 0 at each contact, and its time derivative, with adot the rate of the
            rim angle and j = steer_rate w x s the part of the front frame's acceleration that depends on rates
            alone,
                a_D + alpha x rho + spin' r t + beta = 0                                    (rear)
                beta = w x (w x rho + (adot + spin) r t) - adot spin r e
                a_D + alpha x rho + steer'' s x rho + spin' r t + beta = 0                  (front)
                beta = the same with the front frame's w, and + j x rho

contact     the contact point on the surface moves with the rim point, V = v_D + w x rho, so that (xi', eta') =
            horizontal part of V + r adot t; and t . N = 0 is preserved if, with H the surface's Hessian,

                adot (e . N + r t . H t) = (w x t) . N - t . H V

loads       force    w x (w x S) + mass (g z - beta), S of both assemblies, the front one's + j x S
            moment   w x (I w + spin J axle) + S x (g z - beta), of both, the front one's + I j
            minus the inputs, steer_torque - steer_damping steer_rate about s and rear_wheel_torque on the rear spin

`reduction` solves for the accelerations.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .compilation import jit, jit_inline
from .pose import angle_rates, angular_velocity, pose, times, to_aligned, to_inertial
from .reduction import build, front_force, solve
from .surface_call import evaluate_surface
from .vector import add, combine, cross, dot, scale, subtract


@jit_inline
def _contact_rates(here, wheel, velocity, w, xi, eta, function, parameters):
    """Return the rates of (xi, eta, rim angle); ``velocity`` is that of the rim point fixed in its frame."""
    _, fx, fy, fxx, fxy, fyy = evaluate_surface(function, xi, eta, parameters)
    t, r = wheel.t, wheel.radius
    normal = subtract(here.z, combine(fx, here.x, fy, here.y))
    tx, ty, vx, vy = dot(here.x, t), dot(here.y, t), dot(here.x, velocity), dot(here.y, velocity)
    hx, hy = fxx * tx + fxy * ty, fxy * tx + fyy * ty
    rate = (dot(cross(w, t), normal) - hx * vx - hy * vy) / (dot(wheel.e, normal) + r * (hx * tx + hy * ty))
    return vx + r * rate * tx, vy + r * rate * ty, rate


@jit_inline
def _rate_acceleration(wheel, w, carried, spin, rate):
    """Return the acceleration of the contact's material point that depends on rates alone; ``carried`` is w x rho."""
    r = wheel.radius
    return combine(1.0, cross(w, combine(1.0, carried, r * (rate + spin), wheel.t)), -r * rate * spin, wheel.e)


class Motion(NamedTuple):
    """Quantities from which a state's accelerations and forces are computed."""

    here: Any
    w: Any
    rear_rates: Any  # of the contact parameters
    front_rates: Any
    beta: Any  # of the rear wheel
    force: Any  # of inertia and weight at alpha = 0, z = 0, a_D = -beta
    system: Any


@jit_inline
def _build_motion(y, function, parameters, a):
    """Set up the equations at y = (q, qd, contact parameters); ``a`` the `Aligned` constants."""
    here = pose(y[3], y[4], y[5], y[6], y[20], y[23], a)
    steer, rear_spin, front_spin = y[15], y[16], y[17]
    w = angular_velocity(here, y[12], y[13], y[14])
    w2 = (w[0], w[1], w[2] + steer)
    j = (steer * w[1], -steer * w[0], 0 * steer)
    velocity = to_aligned(here, y[9], y[10], y[11])

    rear, front = here.rear, here.front
    carried, carried2 = cross(w, rear.rho), cross(w2, front.rho)
    rates = _contact_rates(here, rear, add(velocity, carried), w, y[18], y[19], function, parameters)
    rates2 = _contact_rates(here, front, add(velocity, carried2), w2, y[21], y[22], function, parameters)
    beta = _rate_acceleration(rear, w, carried, rear_spin, rates[2])
    beta2 = add(_rate_acceleration(front, w2, carried2, front_spin, rates2[2]), cross(j, front.rho))

    # Weight and the frame's acceleration -beta act in the same way.
    fall = combine(a.gravity, here.z, -1.0, beta)
    force = add(cross(w, cross(w, here.s1)), add(cross(w2, cross(w2, here.s2)), cross(j, here.s2)))
    force = combine(1.0, force, a.mass, fall)
    spun, spun2 = times(here.i1, w), combine(1.0, times(here.i2, w2), a.spin_front * front_spin, here.left)
    moment = add(cross(w, (spun[0], spun[1] + a.spin_rear * rear_spin, spun[2])), cross(here.s1, fall))
    moment2 = add(add(times(here.i2, j), cross(w2, spun2)), cross(here.s2, fall))
    front_load = a.spin_front * dot(here.left, j)
    steer_load = moment2[2] - (a.steer_torque - a.steer_damping * steer)
    b = subtract(beta2, beta)
    system = build(here, a, force, add(moment, moment2), steer_load, a.rear_wheel_torque, front_load, b)
    return Motion(here, w, rates, rates2, beta, force, system)


@jit
def derivative(y, function, parameters, a, out):
    """Fill out = dy/dt (24,) of y = (q, qd, contact parameters); ``a`` the `Aligned` constants."""
    now = _build_motion(y, function, parameters, a)
    here = now.here
    alpha, steer, rear, front = solve(now.system)
    roll = scale(a.rear_radius * rear, here.rear.t)
    origin = to_inertial(here, add(now.beta, add(cross(alpha, here.rear.rho), roll)))
    # alpha without the part that depends on the angles' rates: yaw_rate z x w + lean_rate pitch_rate a_lean x y_r
    alpha = subtract(alpha, combine(y[12], cross(here.z, now.w), y[13] * y[14], here.above))
    for i in range(9):
        out[i] = y[9 + i]
    out[9], out[10], out[11] = -origin[0], -origin[1], -origin[2]
    out[12], out[13], out[14] = angle_rates(here, alpha)
    out[15], out[16], out[17] = steer, rear, front
    out[18], out[19], out[20] = now.rear_rates
    out[21], out[22], out[23] = now.front_rates


@jit
def contact_forces(y, function, parameters, a, force):
    """Fill ``force`` (6,): the ground's force on the rear and the front wheel, inertial axes."""
    now = _build_motion(y, function, parameters, a)
    here, s2 = now.here, now.here.s2
    alpha, steer, rear, front = solve(now.system)
    on_front = front_force(now.system, alpha, steer, rear, front)
    arm = combine(1.0, add(here.s1, s2), -a.mass, here.rear.rho)
    both = add(now.force, add(cross(alpha, arm), (-steer * s2[1], steer * s2[0], 0 * steer)))
    on_rear = subtract(combine(1.0, both, -a.mass * a.rear_radius * rear, here.rear.t), on_front)
    force[0], force[1], force[2] = to_inertial(here, on_rear)
    force[3], force[4], force[5] = to_inertial(here, on_front)
