"""Accelerations of a rolling bicycle: nine unknowns and six constraints reduced to three unknowns.

In the notation of `lean`, the rear contact eliminates a_D = -(alpha x rho + rear spin' r t + beta). The
remaining unknowns are alpha and z = (steer'', rear spin', front spin'), and the remaining constraint is the front one
minus the rear one; with l the line between the contacts and b the front beta minus the rear one,

    alpha x l + sum_k z_k c_k + b = 0,    c = (s x rho_front, -r t of the rear, r t of the front)

Its part along l gives the spin' whose |c . l| is the larger (a wheel's is zero where its plane is orthogonal
to l; both are zero only where the wheels stand side by side, facing the same way), its part across l gives
alpha = lambda l + (sum_k z_k c_k + b) x l / l^2. Lambda, steer'' and one spin' remain free.

Jourdain's principle: the equations of the six unknowns (alpha, z), projected onto the three free ones,
are symmetric and positive definite. The matrix of the six, with a_D inserted, consists of

    alpha   K = I about the rear contact = I + 2 (m . rho) 1 - m rho^T - rho m^T,  m = mass rho / 2 - S
    steer   I_front s - rho x (s x S_front)
    rear    J y + (mass rho - S) x r t
    front   J times the front axle

The multiplier of the constraint is the force on the front wheel.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .compilation import jit_inline
from .pose import times
from .vector import add, combine, cross, dot, scale, subtract


class Unknown(NamedTuple):
    """One of the scalar accelerations steer'', rear spin', front spin'."""

    c: Any  # its column in the constraint
    with_alpha: Any  # its columns and diagonal of the mass matrix (the entry of the two spins with each other is zero)
    with_steer: Any
    inertia: Any
    load: Any  # generalised load, on the side of the inertia


class System(NamedTuple):
    """Equations of the six unknowns and their constraint."""

    k: Any
    load: Any
    steer: Any
    rear: Any
    front: Any
    line: Any
    b: Any


@jit_inline
def build(here, a, force, moment, steer_load, rear_torque, front_load, b):
    """Build the `System`.

    Loads are those of inertia and weight, at alpha = 0, z = 0 and a_D = -beta: ``force`` and ``moment``
    about D of the whole bicycle, ``steer_load`` about the steering axis, ``front_load`` about the front axle. The
    input on the steering is part of ``steer_load``, that on the rear wheel is ``rear_torque``.
    """
    rho, s2, i1, i2 = here.rear.rho, here.s2, here.i1, here.i2
    total = add(here.s1, s2)
    m = combine(0.5 * a.mass, rho, -1.0, total)
    x, y, z = m[0] * rho[0], m[1] * rho[1], m[2] * rho[2]
    k = (
        i1[0] + i2[0] + 2 * (y + z),
        i1[1] + i2[1] + 2 * (x + z),
        i1[2] + i2[2] + 2 * (x + y),
        i1[3] + i2[3] - m[0] * rho[1] - m[1] * rho[0],
        i1[4] + i2[4] - m[0] * rho[2] - m[2] * rho[0],
        i1[5] + i2[5] - m[1] * rho[2] - m[2] * rho[1],
    )
    zero = 0 * rho[0]
    swing = (-s2[1], s2[0], zero)  # s x S_front
    roll = scale(a.rear_radius, here.rear.t)
    with_alpha = cross(combine(a.mass, rho, -1.0, total), roll)
    steer = Unknown(
        c=(-here.front.rho[1], here.front.rho[0], zero),
        with_alpha=subtract((i2[4], i2[5], i2[2]), cross(rho, swing)),
        with_steer=i2[2],
        inertia=i2[2],
        load=steer_load,
    )
    rear = Unknown(
        c=scale(-1.0, roll),
        with_alpha=(with_alpha[0], with_alpha[1] + a.spin_rear, with_alpha[2]),
        with_steer=-dot(swing, roll),
        inertia=a.spin_rear + a.mass * a.rear_radius * a.rear_radius,
        load=-dot(roll, force) - rear_torque,
    )
    front = Unknown(
        c=scale(a.front_radius, here.front.t),
        with_alpha=scale(a.spin_front, here.left),
        with_steer=zero,
        inertia=a.spin_front,
        load=front_load,
    )
    return System(k, subtract(moment, cross(rho, force)), steer, rear, front, subtract(here.front.rho, rho), b)


@jit_inline
def _choose_spin(system):
    """Return (whether the rear spin is eliminated, the spin that is kept, the spin that is eliminated)."""
    rear, front = system.rear, system.front
    if abs(dot(front.c, system.line).real) < abs(dot(rear.c, system.line).real):
        return True, front, rear
    return False, rear, front


@jit_inline
def solve(system):
    """Return (alpha, steer'', rear spin', front spin')."""
    k, load, steer, _, _, line, b = system
    rear_goes, kept, gone = _choose_spin(system)
    # gone's acceleration is p0 + p1 steer'' + p2 kept'; alpha is lambda line + a0 + a1 steer'' + a2 kept'
    inverse = -1 / dot(gone.c, line)
    p0, p1, p2 = dot(b, line) * inverse, dot(steer.c, line) * inverse, dot(kept.c, line) * inverse
    short = scale(1 / dot(line, line), line)
    a0 = cross(combine(1.0, b, p0, gone.c), short)
    a1 = cross(combine(1.0, steer.c, p1, gone.c), short)
    a2 = cross(combine(1.0, kept.c, p2, gone.c), short)
    # loads of the six unknowns where the three free ones are zero
    load = add(load, combine(1.0, times(k, a0), p0, gone.with_alpha))
    steer_load = steer.load + dot(steer.with_alpha, a0) + gone.with_steer * p0
    kept_load = kept.load + dot(kept.with_alpha, a0)
    gone_load = gone.load + dot(gone.with_alpha, a0) + gone.inertia * p0
    # mass matrix times the unit motions of steer and of the kept spin, then projected
    k0 = times(k, line)
    k1 = add(times(k, a1), combine(1.0, steer.with_alpha, p1, gone.with_alpha))
    k2 = add(times(k, a2), combine(1.0, kept.with_alpha, p2, gone.with_alpha))
    gone1 = dot(gone.with_alpha, a1) + gone.with_steer + gone.inertia * p1
    gone2 = dot(gone.with_alpha, a2) + gone.inertia * p2
    m00, m01, m02 = dot(line, k0), dot(line, k1), dot(line, k2)
    m11 = dot(a1, k1) + dot(steer.with_alpha, a1) + steer.inertia + gone.with_steer * p1 + p1 * gone1
    m12 = dot(a2, k1) + dot(kept.with_alpha, a1) + kept.with_steer + p2 * gone1
    m22 = dot(a2, k2) + dot(kept.with_alpha, a2) + kept.inertia + p2 * gone2
    r0 = -dot(line, load)
    r1 = -(dot(a1, load) + steer_load + p1 * gone_load)
    r2 = -(dot(a2, load) + kept_load + p2 * gone_load)
    # L D L^T
    inverse = 1 / m00
    l01, l02 = m01 * inverse, m02 * inverse
    d1, s12 = m11 - l01 * m01, m12 - l01 * m02
    l12 = s12 / d1
    r1 -= l01 * r0
    z2 = (r2 - l02 * r0 - l12 * r1) / (m22 - l02 * m02 - l12 * s12)
    z1 = r1 / d1 - l12 * z2
    stretch = r0 * inverse - l01 * z1 - l02 * z2
    z3 = p0 + p1 * z1 + p2 * z2
    alpha = add(combine(stretch, line, 1.0, a0), combine(z1, a1, z2, a2))
    return (alpha, z1, z3, z2) if rear_goes else (alpha, z1, z2, z3)


@jit_inline
def front_force(system, alpha, steer, rear, front):
    """Return the constraint's multiplier, the front wheel's force: line x F and c . F are the equations' residuals."""
    rear_goes, _, gone = _choose_spin(system)
    rate = rear if rear_goes else front
    row = add(add(system.load, times(system.k, alpha)), scale(steer, system.steer.with_alpha))
    row = add(row, combine(rear, system.rear.with_alpha, front, system.front.with_alpha))
    across = scale(1 / dot(system.line, system.line), cross(row, system.line))
    residual = gone.load + dot(gone.with_alpha, alpha) + gone.with_steer * steer + gone.inertia * rate
    along = (residual - dot(gone.c, across)) / dot(gone.c, system.line)
    return combine(1.0, across, along, system.line)
