"""Starts of many rides in compiled code: motions disturbed and projected onto the constraints, and linearised.

Compiled code decides only what is clear. Where a state cannot be reached, a rim or a wheel is not clear, or the
equations may be singular, there is no result, and the functions that raise the errors (`dae.consistent_state`,
`regularity.require_inertia`, `rim.require_clear_rims`, `wheel_overlap.require_separate_wheels`) have to be asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .bicycle import Bicycle
from .circular import CircularMotion
from .fall import fall_criterion
from .inputs import NO_INPUTS, Inputs
from .kernels.integrate import SIZE
from .kernels.reduced import VARIABLES
from .kernels.start import StartRequests, fill_starts
from .kinematics import REAR_ANGLE
from .simulate import group_by_ground, ride_setups
from .surface import Surface

_NO_CHANGE = (0.0,) * 7


@dataclass(frozen=True, eq=False)
class StartRequest:
    """A motion to start from, and how it is disturbed.

    Attributes
    ----------
    bicycle : Bicycle
    surface : Surface
    motion : CircularMotion or None
        None for a straight upright start.
    inputs : Inputs
    place : tuple of float
        x and y of D of an upright start [m].
    rear_rate : float
        Of an upright start [rad/s].
    change : tuple of float or None
        Added to x, y, lean, steer, lean rate, steer rate and rear rate [m, rad, rad/s]; None for an undisturbed start.
    """

    bicycle: Bicycle
    surface: Surface
    motion: CircularMotion | None
    inputs: Inputs = NO_INPUTS
    place: tuple[float, float] = (0.0, 0.0)
    rear_rate: float = 0.0
    change: tuple[float, float, float, float, float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class StartState:
    """A state that a ride starts from.

    Attributes
    ----------
    undisturbed : tuple of ndarray, shapes (9,)
        Coordinates and rates before the change.
    q, qd : ndarray, shape (9,)
        Coordinates and rates.
    jacobian : ndarray, shape (7, 7)
        Of the reduced equations at the undisturbed state, see `velodrome.reference.stability.linearise`.
    """

    undisturbed: tuple[np.ndarray, np.ndarray]
    q: np.ndarray
    qd: np.ndarray
    jacobian: np.ndarray


def compute_starts(requests: Sequence[StartRequest]) -> list[StartState | None]:
    """Compute the states of many starts.

    Parameters
    ----------
    requests : sequence of StartRequest
        They may differ in everything; those on ground with the same height function share a call of compiled code.

    Returns
    -------
    list of StartState or None
        In the order of the requests. None where something may be wrong with a start. A start has the same bits whatever
        the other ones and their order are.
    """
    found: dict[int, StartState | None] = {}
    for indices in group_by_ground(requests):
        found |= zip(indices, _compute_group([requests[i] for i in indices]), strict=True)
    return [found[i] for i in range(len(requests))]


def _compute_group(requests: Sequence[StartRequest]) -> list[StartState | None]:
    """Compute starts on grounds with the same height function."""
    n = len(requests)
    states = np.array([_initial_state(request) for request in requests])
    undisturbed, jacobians, certain = np.empty((n, SIZE)), np.empty((n, VARIABLES, VARIABLES)), np.empty(n, bool)
    function = requests[0].surface.function
    try:
        fill_starts(
            ride_setups(requests, np.array([fall_criterion(request.bicycle) for request in requests], float)),
            _pack(requests),
            function.real,
            function.complex,
            undisturbed,
            states,
            jacobians,
            certain,
        )
    except ZeroDivisionError:  # compiled code raises it for complex numbers, where real ones give inf
        return [None] if n == 1 else [_compute_group([request])[0] for request in requests]
    return [
        StartState(
            (undisturbed[i, :9].copy(), undisturbed[i, 9:18].copy()),
            states[i, :9].copy(),
            states[i, 9:18].copy(),
            jacobians[i].copy(),
        )
        if certain[i]
        else None
        for i in range(n)
    ]


def _initial_state(request: StartRequest) -> np.ndarray:
    """Return the state (24,) that compiled code starts from."""
    y = np.zeros(SIZE)
    if request.motion is None:
        y[:2], y[9 + REAR_ANGLE] = request.place, request.rear_rate
    else:
        y[:9], y[9:18] = request.motion.state()
        y[18:] = request.motion.contact.ravel()
    return y


def _pack(requests: Sequence[StartRequest]) -> StartRequests:
    return StartRequests(
        upright=np.array([request.motion is None for request in requests]),
        disturbed=np.array([request.change is not None for request in requests]),
        changes=np.array([request.change or _NO_CHANGE for request in requests]),
    )
