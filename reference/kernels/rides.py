"""Precise rides of many starts, one after the other: from the coordinates and rates of a start to its samples.

A ride depends on nothing but its own start, so that it has the same bits alone and among others.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.np.unsafe.ndarray import to_fixed_tuple  # pyright: ignore[reportMissingImports]

from . import integrate
from .compilation import jit, jit_released
from .dynamics import find_contacts, guess_contacts, wheels
from .fall import FallCriterion
from .kinematics import Constants
from .rim import RimSearch, bound, deepest, least_clearance

CONSTANTS = len(Constants._fields)
# Further values of a ride's status, beside those of `integrate.dop853`: refused before the first step.
NO_CONTACT, NOT_CLEAR = -1, -2
TOUCHING = 1e-9  # [m] smallest depth of a rim in the ground that is reported
STEPS_A_CALL = 200  # between two reports of progress; a step takes about 6 us
_FIRST_STEP = 1e-3  # [s]


class RideSetups(NamedTuple):
    """What the rides of n starts on one kind of ground have of their own.

    Attributes
    ----------
    constants : ndarray, shape (n, 28)
        `kinematics.Constants` of the bicycles and inputs, in the order of their fields.
    parameters : ndarray, shape (n, k)
        Parameters of the ground.
    curved : ndarray, shape (n,), bool
        With the next ones the `rim.RimSearch` of every start.
    bends : ndarray, shape (m,)
        Those of all starts; those of start i are entries ``offsets[i]`` to ``offsets[i + 1]``.
    offsets : ndarray, shape (n + 1,), int
    widths, details : ndarray, shape (n,)
    samples : ndarray, shape (n,), int
    falls : ndarray, shape (n, 4)
        `fall.FallCriterion` of every start, 0 or 1 for ``watched``.
    """

    constants: Any
    parameters: Any
    curved: Any
    bends: Any
    offsets: Any
    widths: Any
    details: Any
    samples: Any
    falls: Any


class RideStates(NamedTuple):
    """Where the rides of n starts are, and their samples at m output times.

    Attributes
    ----------
    y : ndarray, shape (n, 24)
        Coordinates, rates and contact parameters.
    clock : ndarray, shape (n, 2)
        Time reached, and the next step [s].
    counts : ndarray, shape (n, 4), int
        Status, number of filled samples, steps and evaluations of the right-hand side.
    rows : ndarray, shape (n, m, 24)
        Samples of ``y``.
    force : ndarray, shape (n, m, 6)
        Contact forces [N].
    fallen : ndarray, shape (n, 2, 24)
        States just before and just after the fall of a ride that ended with one.
    at : ndarray, shape (n, 2)
        Their times [s].
    """

    y: Any
    clock: Any
    counts: Any
    rows: Any
    force: Any
    fallen: Any
    at: Any


@jit
def unpack_constants(row):
    """Return the `kinematics.Constants` in a row (28,) of an array."""
    return Constants(*to_fixed_tuple(row, CONSTANTS))  # pyright: ignore[reportCallIssue]


@jit
def unpack_rim_search(setups, i):
    """Return the `rim.RimSearch` of start i."""
    return RimSearch(
        setups.curved[i],
        setups.bends[setups.offsets[i] : setups.offsets[i + 1]],
        setups.widths[i],
        setups.details[i],
        setups.samples[i],
    )


@jit
def are_rims_clear(y, ground, function, parameters, c):
    """Return whether no rim lies inside the ground or touches it twice, with contacts ``y[18:]``."""
    both = wheels(y, c)
    for k in range(2):
        centre, x, _, z, radius = both[k]
        distance, _ = deepest(centre, x, z, radius, ground.samples, function, parameters)
        if distance < -TOUCHING:
            return False
        angle = y[20 + 3 * k]
        clearance = bound(centre, x, z, radius, angle, ground, function, parameters)
        if not clearance > 0:
            clearance, _ = least_clearance(centre, x, z, radius, angle, True, ground.samples, function, parameters)
        if not clearance > 0:
            return False
    return True


@jit_released
def begin_rides(first, last, setups, function, states):
    """Find the contacts at starts ``first`` to ``last``, whose coordinates and rates are in ``states.y``.

    Their status becomes `integrate.MORE`, or says why there is no ride.
    """
    for i in range(first, last):
        y, ground, c = states.y[i], unpack_rim_search(setups, i), unpack_constants(setups.constants[i])
        parameters = setups.parameters[i]
        states.clock[i, 0], states.clock[i, 1] = 0.0, _FIRST_STEP
        states.counts[i] = 0
        q, p = y[:9], y[18:]
        guess_contacts(q, p, function, parameters, c)
        if not find_contacts(q, p, function, parameters, c):
            states.counts[i, 0] = NO_CONTACT
        elif ground.curved and not are_rims_clear(y, ground, function, parameters, c):
            states.counts[i, 0] = NOT_CLEAR
        else:
            states.counts[i, 0] = integrate.MORE


@jit_released
def continue_rides(first, last, most_calls, times, tolerance, setups, function, states):
    """Continue the rides ``first`` to ``last`` by up to ``most_calls`` times `STEPS_A_CALL` steps each.

    Fills the forces of rides that have ended. See `integrate.dop853`.
    """
    for i in range(first, last):
        y, clock, counts, rows = states.y[i], states.clock[i], states.counts[i], states.rows[i]
        ground, parameters = unpack_rim_search(setups, i), setups.parameters[i]
        c, falls = unpack_constants(setups.constants[i]), setups.falls[i]
        fall = FallCriterion(falls[0], falls[1], falls[2], falls[3] > 0)
        calls = 0
        while counts[0] == integrate.MORE and calls < most_calls:
            status, index, t, h, steps, evaluations = integrate.dop853(
                y,
                times,
                counts[1],
                clock[0],
                clock[1],
                tolerance,
                STEPS_A_CALL,
                ground,
                fall,
                function,
                parameters,
                c,
                rows,
                states.fallen[i],
                states.at[i],
            )
            counts[0], counts[1], clock[0], clock[1] = status, index, t, h
            counts[2] += steps
            counts[3] += evaluations
            calls += 1
            if status != integrate.MORE:
                integrate.contact_forces(rows[:index], function, parameters, c, states.force[i])
