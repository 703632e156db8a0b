"""Clearance of the whole rim of a wheel, which shows whether it touches the ground beyond its contact.

The rim point w(a) = c + r e(a) lies h(a) = w_z - f(w_x, w_y) above the ground, and the whole rim is above the ground
if and only if h >= 0 all round. At the contact h and h' vanish, so with d the angle from there

    clearance   g(d) = (h(a + d) - h(a) - h'(a) sin d) / (r (1 - cos d)),   g(0) = -e . N - r t . H t

is smooth; N = (-fx, -fy, 1) and the Hessian H are taken at the rim point. The rim touches the ground only at its
contact if and only if g > 0 all round: g(0) > 0 means that the rim is more curved than the ground below
its contact. The gap h(a) of a soft or inexact contact, and its slope h'(a), are subtracted, so that this holds to
first order in the gap. A wheel in the air has no contact: it touches where h itself reaches zero, and h(a) is not
subtracted.

Bound. Let no eigenvalue of H exceed K within 2 r of the contact. Then f(w) <= f(u) + grad f . (w - u) + K |w - u|^2 / 2
horizontally, and with |w(a + d) - w(a)|^2 = 2 r^2 (1 - cos d)

    g(d) >= -e . N - K r

all round. This decides most cases from the contact alone. On a plane, K = 0, it is the cosine of the lean:
a wheel on a plane never touches twice. On the paraboloid, K = 2 alpha, it is the least clearance itself: there
H = K 1, so that g depends on d only through the horizontal part of (w(a + d) - w(a)), whose square is at most
the whole and equals it where that chord is level; from any point of a rim, some chord is level.

Otherwise the rim is sampled. A height field can have a contact in every cell; the samples are a quarter of the
ground's detail apart, and a minimum of the clearance between them is found by golden section.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from . import contact
from .compilation import jit
from .kinematics import rim
from .surface_call import evaluate_surface
from .vector import combine, cross, dot, scale

_GOLDEN = (math.sqrt(5) - 1) / 2
_SECTIONS = 40  # of an interval between samples: to about 1e-9 of it, the square root of round-off
# Angle within which the clearance is that at the contact: round-off over 1 - cos d would exceed its change there.
_NEAR = 1e-5
LIFTED = 1e-3  # gap, relative to the radius, above which a wheel is in the air


class RimSearch(NamedTuple):
    """How finely to search rims on a ground.

    Attributes
    ----------
    curved : bool
        False where no rim can touch twice, since the ground bends upwards nowhere.
    bends : ndarray, shape (k,)
        Bounds K of the ground's upward curvature, the largest eigenvalue of its Hessian, within a wheel's diameter of
        a point: entry i where the distance from the axis is i to i + 1 times ``width`` [1/m]; inf if unknown.
    width : float
        Width of the rings [m]; inf with a single entry for all the ground.
    detail : float
        Length within which the ground does not bend to and fro [m].
    samples : int
        Number of samples along a rim.
    """

    curved: bool
    bends: np.ndarray
    width: float
    detail: float
    samples: int


class Edge(NamedTuple):
    """A rim and the values at its contact from which the clearance along it is computed."""

    centre: Any
    radial: Any  # e at the contact
    tangent: Any
    radius: float
    slope: float  # h' / r at the contact
    base: float  # the contact's gap h, zero for a wheel in the air
    here: float  # g(0)


@jit
def level_axes(axle):
    """Return axes (x, z) of a wheel's plane, x level; nan where the wheel lies flat."""
    x = (axle[1], -axle[0], 0.0)
    length = np.sqrt(x[0] * x[0] + x[1] * x[1])
    x = scale(1 / length, x)
    return x, cross(x, axle)


@jit
def _make_edge(centre, x, z, radius, angle, held, samples, function, parameters):
    """Return the `Edge` of a rim whose contact is at ``angle``; ``held`` is False for a wheel in the air."""
    e, t = rim(angle, x, z)
    f, fx, fy, fxx, fxy, fyy = evaluate_surface(
        function, centre[0] + radius * e[0], centre[1] + radius * e[1], parameters
    )
    n = (-fx, -fy, 1.0)
    height = centre[2] + radius * e[2] - f
    bend = fxx * t[0] * t[0] + 2 * fxy * t[0] * t[1] + fyy * t[1] * t[1]
    # In the air the clearance has no limit at d = 0: the value at the first sample's distance is taken.
    lifted = 0.0 if held else height / (radius * (1 - math.cos(2 * math.pi / samples)))
    return Edge(centre, e, t, radius, dot(t, n), height if held else 0.0, lifted - dot(e, n) - radius * bend)


@jit
def _clearance(edge, c, s, function, parameters):
    """Return the clearance at the angle d from the contact, with cosine ``c`` and sine ``s``; inf without ground."""
    versine = s * s / (1 + c) if c > 0 else 1 - c
    if versine < 0.5 * _NEAR * _NEAR:
        return edge.here
    arm = combine(edge.radius * c, edge.radial, edge.radius * s, edge.tangent)
    f, _, _, _, _, _ = evaluate_surface(function, edge.centre[0] + arm[0], edge.centre[1] + arm[1], parameters)
    height = edge.centre[2] + arm[2] - f
    clearance = (height - edge.base - edge.radius * edge.slope * s) / (edge.radius * versine)
    return clearance if clearance == clearance else math.inf


@jit
def _least_between(edge, low, high, function, parameters):
    """Return (clearance, d) at the minimum of the clearance in an interval that has one minimum."""
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_a = _clearance(edge, math.cos(a), math.sin(a), function, parameters)
    at_b = _clearance(edge, math.cos(b), math.sin(b), function, parameters)
    for _ in range(_SECTIONS):
        if at_a < at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = _clearance(edge, math.cos(a), math.sin(a), function, parameters)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = _clearance(edge, math.cos(b), math.sin(b), function, parameters)
    return (at_a, a) if at_a < at_b else (at_b, b)


@jit
def bound(centre, x, z, radius, angle, ground, function, parameters):
    """Return a lower bound of the least clearance, -e . N - K r; -inf if K is unknown, nan if there is no ground."""
    e, _ = rim(angle, x, z)
    wx, wy = centre[0] + radius * e[0], centre[1] + radius * e[1]
    _, fx, fy, _, _, _ = evaluate_surface(function, wx, wy, parameters)
    distance = np.sqrt(wx * wx + wy * wy)
    if not distance < ground.bends.size * ground.width:
        return -math.inf
    return e[0] * fx + e[1] * fy - e[2] - ground.bends[int(distance / ground.width)] * radius


@jit
def least_clearance(centre, x, z, radius, angle, held, samples, function, parameters):
    """Return (clearance, d): the least clearance of the whole rim and its angle from the contact at ``angle``.

    A clearance far above zero is not refined, and may be an eighth of itself too large: only its sign matters.
    ``held`` is False for a wheel in the air. Returns (inf, 0) where the contact is off the ground.
    """
    edge = _make_edge(centre, x, z, radius, angle, held, samples, function, parameters)
    if not edge.here < math.inf:
        return math.inf, 0.0
    step = 2 * math.pi / samples
    turn_c, turn_s = math.cos(step), math.sin(step)
    c, s = 1.0, 0.0
    before, here = _clearance(edge, turn_c, -turn_s, function, parameters), edge.here
    least, where = here, 0.0
    for i in range(samples):
        c, s = c * turn_c - s * turn_s, s * turn_c + c * turn_s
        after = _clearance(edge, c, s, function, parameters) if i < samples - 1 else edge.here
        if here <= before and here <= after and here < math.inf:
            value, d = here, i * step
            # A parabola through three samples lies at most an eighth of this below the middle one.
            if here < max(before, after) - here:
                value, d = _least_between(edge, d - step, d + step, function, parameters)
            if value < least:
                least, where = value, d
        before, here = here, after
    return least, where


@jit
def deepest(centre, x, z, radius, samples, function, parameters):
    """Return (distance, angle): the least signed distance of a rim from the ground, to first order h / |N|.

    The distance is inf where the whole rim is off the ground.
    """
    step = 2 * math.pi / samples
    least, where = math.inf, 0.0
    for i in range(samples):
        distance = _ground_distance(centre, x, z, radius, i * step, function, parameters)
        if distance < least:
            least, where = distance, i * step
    low, high = where - step, where + step
    for _ in range(_SECTIONS):
        a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        at_a = _ground_distance(centre, x, z, radius, a, function, parameters)
        at_b = _ground_distance(centre, x, z, radius, b, function, parameters)
        if at_a < at_b:
            high = b
        else:
            low = a
        if min(at_a, at_b) < least:
            least, where = (at_a, a) if at_a < at_b else (at_b, b)
    return least, where


@jit
def _ground_distance(centre, x, z, radius, angle, function, parameters):
    e, _ = rim(angle, x, z)
    f, fx, fy, _, _, _ = evaluate_surface(function, centre[0] + radius * e[0], centre[1] + radius * e[1], parameters)
    distance = (centre[2] + radius * e[2] - f) / np.sqrt(1 + fx * fx + fy * fy)
    return distance if distance == distance else math.inf


@jit
def find_contact(centre, x, z, radius, ground, function, parameters):
    """Find the contact of a wheel from its pose alone; return (xi, eta, angle, found).

    It is the point where the rim is deepest. Newton's method from `contact.first_guess` nearly always finds it; if not,
    the rim is sampled.
    """
    xi, eta, angle = contact.first_guess(centre, x, z, radius, function, parameters)
    xi, eta, angle, found = contact.search(centre, x, z, radius, xi, eta, angle, function, parameters)
    if not ground.curved or (found and bound(centre, x, z, radius, angle, ground, function, parameters) > 0):
        return xi, eta, angle, found
    if found and _ground_distance(centre, x, z, radius, angle, function, parameters) < LIFTED * radius:
        clearance, _ = least_clearance(centre, x, z, radius, angle, True, ground.samples, function, parameters)
        if clearance > 0:
            return xi, eta, angle, True
    _, turn = deepest(centre, x, z, radius, ground.samples, function, parameters)
    e, _ = rim(turn, x, z)
    wx, wy = centre[0] + radius * e[0], centre[1] + radius * e[1]
    xi2, eta2, angle2, better = contact.search(centre, x, z, radius, wx, wy, turn, function, parameters)
    return (xi2, eta2, angle2, True) if better else (xi, eta, angle, found)
