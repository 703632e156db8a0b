"""Watch over the rims of both wheels along a ride of any engine, see `rim`.

A contact is followed from look to look: the search starts from the last contact, moved with the wheel's centre.
It therefore does not jump to another place of the rim, and a second touch shows as a clearance that falls to zero.
"""

from __future__ import annotations

import math

import numpy as np

from . import contact
from .arrays import copy_array
from .compilation import jit
from .dynamics import wheels
from .rim import LIFTED, bound, deepest, find_contact, least_clearance, level_axes

_SMALL = 1 / 32  # of the ground's detail: distance that a wheel moves between two looks
# Samples of a ride closer than this part of the detail are joined by cubics: their error is less than 1e-3 of the
# ground's variation within its detail, (pi / 4)^4 / 384. Samples further apart are looked at without joining them.
_JOINED, _BETWEEN = 1 / 2, 1 / 8


@jit
def _look(centre, axle, radius, moved, last, held, ground, function, parameters):
    """Follow a wheel's contact to its present pose; return (contact parameters, whether it touches, clearance).

    ``last`` are the contact's parameters before the wheel's centre moved by ``moved``, and ``held`` whether it
    touched the ground then. The clearance is that of `least_clearance` or a positive bound of it, nan where no contact
    is found.
    """
    x, z = level_axes(axle)
    if held:
        xi, eta, angle = last[0] + moved[0], last[1] + moved[1], last[2]
        xi, eta, angle, found = contact.search(centre, x, z, radius, xi, eta, angle, function, parameters)
        if found:
            gap = contact.equations(centre, x, z, radius, xi, eta, angle, function, parameters).gap
            clearance = _clearance(centre, x, z, radius, angle, True, ground, function, parameters)
            # Where another place of the rim is now deeper, the wheel may have left the ground in the meantime.
            if gap < LIFTED * radius or (
                clearance <= 0 and _touches(centre, x, z, radius, ground, function, parameters)
            ):
                return (xi, eta, angle), True, clearance
    xi, eta, angle, found = find_contact(centre, x, z, radius, ground, function, parameters)
    if not found:
        return (xi, eta, angle), False, math.nan
    held = contact.equations(centre, x, z, radius, xi, eta, angle, function, parameters).gap < LIFTED * radius
    clearance = _clearance(centre, x, z, radius, angle, held, ground, function, parameters)
    return (xi, eta, angle), held, clearance


@jit
def _clearance(centre, x, z, radius, angle, held, ground, function, parameters):
    clearance = bound(centre, x, z, radius, angle, ground, function, parameters)
    if not clearance > 0:
        clearance, _ = least_clearance(centre, x, z, radius, angle, held, ground.samples, function, parameters)
    return clearance


@jit
def _touches(centre, x, z, radius, ground, function, parameters):
    distance, _ = deepest(centre, x, z, radius, ground.samples, function, parameters)
    return distance < LIFTED * radius


@jit
def watch(centre, axle, radii, clock, ground, function, parameters, clearance):
    """Look at the rims of two wheels at every `next`; yield whether nothing touches.

    This is a generator so that its arguments are unpacked only once. centre, axle (2, 3) are the wheels' poses, clock
    (2,) has the time in its first entry. Fills clearance (2, 2), the previous and the present one of each wheel, and
    the second entry of ``clock`` with the time of the previous look. The rims are looked at again only after a wheel
    has moved by a small part of the ground's detail.
    """
    at, seen, held = np.full((2, 3), np.inf), np.zeros((2, 3)), np.zeros(2, np.bool_)
    looked = -math.inf
    while True:
        far = 0.0
        for k in range(2):
            moved = 0.0
            for i in range(3):
                moved += (centre[k, i] - at[k, i]) ** 2
            far = max(far, moved)
        fine = True
        if not far < (_SMALL * ground.detail) ** 2:
            for k in range(2):
                last, held[k], now = _look(
                    (centre[k, 0], centre[k, 1], centre[k, 2]),
                    (axle[k, 0], axle[k, 1], axle[k, 2]),
                    radii[k],
                    (centre[k, 0] - at[k, 0], centre[k, 1] - at[k, 1]),
                    (seen[k, 0], seen[k, 1], seen[k, 2]),
                    held[k],
                    ground,
                    function,
                    parameters,
                )
                clearance[k, 0] = clearance[k, 1]
                clearance[k, 1] = now
                fine = fine and not now <= 0
                for i in range(3):
                    seen[k, i], at[k, i] = last[i], centre[k, i]
            clock[1] = looked
            looked = clock[0]
        yield fine


@jit
def _pose_between(q, qd, times, n, share, out):
    """Fill ``out`` (9,) with the coordinates at a fraction of the interval before sample n, by cubics."""
    interval, s, r = times[n] - times[n - 1], share, 1 - share
    for i in range(9):
        ends = (1 + 2 * s) * r * r * q[n - 1, i] + (1 + 2 * r) * s * s * q[n, i]
        out[i] = ends + interval * s * r * (r * qd[n - 1, i] - s * qd[n, i])


@jit
def first_touch(times, q, qd, ground, function, parameters, c):
    """Look at both rims along the samples (n, 9) of a ride.

    Returns ``(time, wheel)`` of the first look at which a rim touches a second place, the time by linear
    interpolation of the clearance; (inf, 0) if none does. Where samples are close, the ride between them is included.
    """
    at, seen, held = np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2, np.bool_)
    before, pose = np.full(2, np.nan), np.empty(9)
    looked = times[0]
    for n in range(q.shape[0]):
        looks = 1
        if n > 0:
            travel = math.sqrt((q[n, 0] - q[n - 1, 0]) ** 2 + (q[n, 1] - q[n - 1, 1]) ** 2)
            if travel < _JOINED * ground.detail:
                looks = 1 + int(travel / (_BETWEEN * ground.detail))
            else:
                held[:], before[:] = False, np.nan
        for look in range(1, looks + 1):
            share, now = 1.0, times[n]
            copy_array(q[n], pose)
            if look < looks:
                share = look / looks
                now = times[n - 1] + share * (times[n] - times[n - 1])
                _pose_between(q, qd, times, n, share, pose)
            both = wheels(pose, c)
            for k in range(2):
                centre, _, axle, _, radius = both[k]
                last, held[k], clearance = _look(
                    centre,
                    axle,
                    radius,
                    (centre[0] - at[k, 0], centre[1] - at[k, 1]),
                    (seen[k, 0], seen[k, 1], seen[k, 2]),
                    held[k],
                    ground,
                    function,
                    parameters,
                )
                if clearance <= 0:
                    share = before[k] / (before[k] - clearance) if 0 < before[k] < math.inf else 1.0
                    return looked + share * (now - looked), k
                before[k] = clearance
                for i in range(3):
                    seen[k, i], at[k, i] = last[i], centre[i]
            looked = now
    return math.inf, 0
