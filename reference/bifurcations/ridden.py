"""Whether a periodic orbit can be ridden: both wheels pushed, and both rims touching the ground once."""

from __future__ import annotations

import numpy as np

from ..kinematics import WHEELS
from ..normal_force import normal_forces
from ..simulate import PreciseMotion, simulate
from .orbits import PeriodicOrbit
from .shooting import Flow

_LOOKS = 64  # states over a period; forces change as smoothly as the lean does


def ride_orbit(flow: Flow, orbit: PeriodicOrbit, samples: int) -> list[PreciseMotion]:
    """Ride a period of an orbit with the reference, leg by leg, since a disturbance may grow large in a period.

    Parameters
    ----------
    flow : Flow
        Near the orbit, see `Flow.moved_to`.
    orbit : PeriodicOrbit
    samples : int
        Number of intervals between samples in a period, at least.

    Returns
    -------
    list of PreciseMotion
        A ride for each leg, from yaw 0 to the start of the next one.

    Raises
    ------
    ValueError
        If it cannot be ridden, with the reason.
    """
    bicycle, surface = flow.equations.bicycle, flow.equations.surface
    looks, motions = -(-samples // len(orbit.states)) + 1, []
    for start, duration in zip(orbit.states, orbit.durations, strict=True):
        state = flow.moved_to(start).near
        # A rim that lies inside the ground at the start is an error, too.
        motion = simulate(bicycle, surface, state[:9], state[9:18], np.linspace(0.0, duration, looks))
        if motion.ended is not None:
            raise ValueError(motion.ended)
        motions.append(motion)
    return motions


def explain_orbit(flow: Flow, orbit: PeriodicOrbit) -> tuple[str, ...]:
    """Explain why an orbit cannot be ridden: one text for each obstacle, none if it can.

    The reference rides one period.

    Parameters
    ----------
    flow : Flow
        Near the orbit, see `Flow.moved_to`.
    orbit : PeriodicOrbit

    Returns
    -------
    tuple of str
    """
    try:
        motions = ride_orbit(flow, orbit, _LOOKS)
    except ValueError as error:
        return (str(error),)
    surface = flow.equations.surface
    forces = [normal_forces(surface, motion.contact, motion.force) for motion in motions]
    least = np.concatenate(forces).min(axis=0)
    return tuple(
        f"the ground would have to pull the {wheel} wheel: {force:.3g} N"
        for wheel, force in zip(WHEELS, least, strict=True)
        if not force > 0
    )
