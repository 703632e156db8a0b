"""Contact of a knife edge with a surface (Xiong et al. 2020, Eqs. 1-5), as the point of closest approach.

A wheel of centre c, in-plane axes x, z and radius r has the rim point w = c + r e(a); the surface has
the point u = (xi, eta, f(xi, eta)), tangents g1 = (1, 0, fx), g2 = (0, 1, fy) and N = (-fx, -fy, 1).

    contact equations  (w - u) . g1 = 0,  (w - u) . g2 = 0,  t . N = 0
    gap                (w - u) . N / |N|
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .compilation import jit
from .kinematics import rim
from .linear import solve_three
from .surface_call import evaluate_surface
from .vector import cross, dot


class Contact(NamedTuple):
    """A wheel and the surface at given contact parameters (real or complex numbers, vectors as tuples)."""

    residual: Any  # of the three contact equations
    jacobian: Any  # of the residual with respect to (xi, eta, angle), by rows
    gap: Any
    normal: Any  # unit
    arm: Any  # d = r e, from the wheel's centre to the rim point
    radial: Any  # e
    tangent: Any  # t
    g1: Any
    g2: Any
    across: Any  # N, the normal that is not normalised
    hessian: Any  # (fxx, fxy, fyy)


@jit
def equations(centre, x, z, radius, xi, eta, angle, function, parameters):
    """Evaluate the contact equations of a wheel at its contact parameters; return a `Contact`."""
    f, fx, fy, fxx, fxy, fyy = evaluate_surface(function, xi, eta, parameters)
    e, t = rim(angle, x, z)
    d = (radius * e[0], radius * e[1], radius * e[2])
    w = (centre[0] + d[0] - xi, centre[1] + d[1] - eta, centre[2] + d[2] - f)
    one, zero = 1 + 0 * fx, 0 * fx
    g1, g2, n = (one, zero, fx), (zero, one, fy), (-fx, -fy, one)
    residual = (dot(w, g1), dot(w, g2), dot(t, n))
    jacobian = (
        (-(1 + fx * fx) + w[2] * fxx, -fx * fy + w[2] * fxy, radius * dot(t, g1)),
        (-fx * fy + w[2] * fxy, -(1 + fy * fy) + w[2] * fyy, radius * dot(t, g2)),
        (-(t[0] * fxx + t[1] * fxy), -(t[0] * fxy + t[1] * fyy), -dot(e, n)),
    )
    length = np.sqrt(1 + fx * fx + fy * fy)
    normal = (n[0] / length, n[1] / length, n[2] / length)
    return Contact(residual, jacobian, dot(w, normal), normal, d, e, t, g1, g2, n, (fxx, fxy, fyy))


@jit
def search(centre, x, z, radius, xi, eta, angle, function, parameters):
    """Solve the contact equations by Newton's method from a guess; return (xi, eta, angle, converged)."""
    for _ in range(50):
        here = equations(centre, x, z, radius, xi, eta, angle, function, parameters)
        step = solve_three(here.jacobian, here.residual)
        # Far from the contact a full step may wind around the rim, so a step is limited to half a radian.
        worst = max(abs(step[0]), abs(step[1]), radius * abs(step[2]))
        limit = 0.5 * radius
        damping = 1.0 if worst <= limit else limit / worst
        xi, eta, angle = xi - damping * step[0], eta - damping * step[1], angle - damping * step[2]
        # Convergence is quadratic: after a step of 1e-9 the error is at round-off, and one more
        # evaluation would bring nothing.
        if worst < 1e-9:
            return xi, eta, angle, True
    return xi, eta, angle, False


@jit
def first_guess(centre, x, z, radius, function, parameters):
    """Guess (xi, eta, angle): the rim point that lies deepest along the normal below the centre."""
    _, fx, fy, _, _, _ = evaluate_surface(function, centre[0], centre[1], parameters)
    n = (-fx, -fy, 1 + 0 * fx)
    # e = -sin(a) x - cos(a) z is deepest where it is opposite to the normal's part in the wheel's plane.
    angle = np.arctan2(dot(n, x).real, dot(n, z).real) + 0 * fx
    e, _ = rim(angle, x, z)
    return centre[0] + radius * e[0], centre[1] + radius * e[1], angle


@jit
def rates(here, velocity, w):
    """Compute the rates of (xi, eta, angle) on a `Contact`: jacobian rates = -(terms of the frame's motion).

    ``velocity`` is that of the rim point fixed in the frame, ``w`` the frame's angular velocity.
    """
    turn = dot(cross(w, here.tangent), here.across)
    step = solve_three(here.jacobian, (dot(velocity, here.g1), dot(velocity, here.g2), turn))
    return -step[0], -step[1], -step[2]


@jit
def tangents(axle, normal):
    """Return unit vectors (lateral, forward) of a contact: forward = axle x normal, lateral = normal x forward."""
    f = cross(axle, normal)
    length = np.sqrt(dot(f, f))
    forward = (f[0] / length, f[1] / length, f[2] / length)
    lateral = cross(normal, forward)
    return lateral, forward
