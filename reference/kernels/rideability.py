"""Whether circular motions can be ridden: margins of what makes them impossible, and the friction that they need.

A motion can be ridden where five margins are positive:

    normal force of the rear and of the front wheel         in weights, less `PUSHED`
    least clearance of the rear and of the front rim        `rim`, less round-off
    distance of the wheels from each other                  minus `wheel_overlap`, plus its round-off

Each margin is continuous along a curve of motions near its zero. What is zero but for round-off is a negative margin of
a force or of a clearance: a wheel that the ground does not push, and a rim that grazes the ground, cannot be ridden.
Wheels that just touch each other can.
"""

from __future__ import annotations

import math

import numpy as np

from . import rim
from .compilation import jit
from .dynamics import wheels
from .surface_call import evaluate_surface
from .wheel_overlap import TOUCHING, find_overlap, measure_overlaps

MARGINS = 5
# Forces in weights have the residual of a solution, 1e-12, times the condition of its equations, about 1e3.
PUSHED = 1e-9
# Round-off of a bound of the clearance, 1e-16 times the slope of the ground: 1e6 and more are no ground to ride on.
_GRAZING = 1e-9
_EPSILON = 2.0**-52
# The clearance is a height over r (1 - cos d), and d is at least `rim._NEAR` = 1e-5. A height has the round-off of some
# operations with coordinates.
_VERSINE, _OPERATIONS = 0.5e-10, 4


@jit
def _forces(u, k, function, parameters):
    """Return the normal and the tangential force on wheel ``k``, in weights."""
    _, fx, fy, _, _, _ = evaluate_surface(function, u[10 + 3 * k], u[11 + 3 * k], parameters)
    length = np.sqrt(1 + fx * fx + fy * fy)
    x, y, z = u[16 + 3 * k], u[17 + 3 * k], u[18 + 3 * k]
    normal = (z - fx * x - fy * y) / length
    tx, ty, tz = x + normal * fx / length, y + normal * fy / length, z - normal / length
    return normal, np.sqrt(tx * tx + ty * ty + tz * tz)


@jit
def _rim_margin(wheel, angle, ground, function, parameters):
    """Return the least clearance of a rim with its contact at ``angle``, or a bound of it, less round-off."""
    centre, x, _, z, radius = wheel
    bound = rim.bound(centre, x, z, radius, angle, ground, function, parameters) - _GRAZING
    if bound > 0:
        return bound
    least, _ = rim.least_clearance(centre, x, z, radius, angle, True, ground.samples, function, parameters)
    size = radius + abs(centre[0]) + abs(centre[1]) + abs(centre[2])
    return least - max(_GRAZING, _OPERATIONS * _EPSILON * size / (radius * _VERSINE))


@jit
def fill_margins(full, ground, function, parameters, c, margins, friction):
    """Fill margins (n, 5) and friction (n, 2) of the motions ``full`` (n, 22), see `steady`; ``ground`` a `RimSearch`.

    The friction of a wheel is its tangential over its normal force: the coefficient that rolling needs; inf where the
    ground does not push.
    """
    overlaps, q = measure_overlaps(c), np.zeros(9)
    for n in range(len(full)):
        u = full[n]
        q[0], q[1], q[2], q[4], q[5], q[6] = u[0], u[1], u[2], u[3], u[4], u[5]
        both = wheels(q, c)
        for k in range(2):
            normal, tangential = _forces(u, k, function, parameters)
            margins[n, k] = normal - PUSHED
            friction[n, k] = tangential / normal if normal > PUSHED else math.inf
            margins[n, 2 + k] = _rim_margin(both[k], u[12 + 3 * k], ground, function, parameters)
        margins[n, 4] = TOUCHING - find_overlap(u[5], overlaps)
