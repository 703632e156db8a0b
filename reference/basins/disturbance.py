"""Disturbed starts from a stable circle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..circular import CircularMotion, Steady
from ..contact import observe
from ..simulate import RideStart
from ..stability import VARIABLES
from ..starts import StartRequest, compute_starts

_REAR_RATE = VARIABLES.index("rear_rate")
_TRIAL = 1.0  # change of the rear rate by which the energy's dependence on it is found [rad/s]; any would do
_ITERATIONS = 3  # the energy is quadratic in the rear rate: the second only removes round-off


def disturb(equations: Steady, motion: CircularMotion, changes: np.ndarray) -> list[RideStart | None]:
    """Return the starts of disturbed rides, which end where the bicycle falls.

    Parameters
    ----------
    equations : Steady
        Hands-free.
    motion : CircularMotion
    changes : ndarray, shape (n, 7)
        Added to the independent variables; the rest is solved, as for a scenario's perturbation.

    Returns
    -------
    list of RideStart or None
        None where the wheels do not reach the ground, a rim is inside it, or the equations may be singular.
    """
    bicycle, surface = equations.bicycle, equations.surface
    requests = [StartRequest(bicycle, surface, motion, change=tuple(change)) for change in changes.tolist()]
    return [
        None if state is None else RideStart(bicycle, surface, state.q, state.qd, until_fall=True)
        for state in compute_starts(requests)
    ]


def disturb_on_level(equations: Steady, motion: CircularMotion, changes: np.ndarray) -> list[RideStart | None]:
    """Return disturbed starts with the energy of the undisturbed motion: their rear rate is solved for.

    Parameters
    ----------
    equations, motion, changes
        As of `disturb`; the change of the rear rate is where the search begins.

    Returns
    -------
    list of RideStart or None
        None also where no rear rate near by gives the energy.
    """
    (still,) = disturb(equations, motion, np.zeros((1, len(VARIABLES))))
    wanted = start_energies([still])[0]
    changes = np.array(changes, float)
    trial = np.zeros(len(VARIABLES))
    trial[_REAR_RATE] = _TRIAL
    for _ in range(_ITERATIONS):
        below, here, above = (
            start_energies(disturb(equations, motion, changes + k * trial)) - wanted for k in (-1, 0, 1)
        )
        square, slope = (above + below) / 2 - here, (above - below) / 2
        with np.errstate(invalid="ignore", divide="ignore"):
            # The smaller root of here + slope s + square s^2, in the form without cancellation.
            root = -2 * here / (slope + np.sign(slope) * np.sqrt(slope**2 - 4 * square * here))
        changes[:, _REAR_RATE] += _TRIAL * root
    reached = np.all(np.isfinite(changes), axis=1)
    starts = disturb(equations, motion, np.where(reached[:, None], changes, 0.0))
    return [start if good else None for start, good in zip(starts, reached.tolist(), strict=True)]


def start_energies(starts: Sequence[RideStart | None]) -> np.ndarray:
    """Return the energies [J] of starts, shape (n,); nan where there is none."""
    energies = np.full(len(starts), np.nan)
    there = [(i, start) for i, start in enumerate(starts) if start is not None]
    if there:
        first = there[0][1]
        seen = observe(
            first.bicycle,
            first.surface,
            np.array([start.q for _, start in there]),
            np.array([start.qd for _, start in there]),
        )
        energies[[i for i, _ in there]] = seen.kinetic_energy + seen.potential_energy
    return energies
