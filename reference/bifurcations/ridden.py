"""Whether a periodic orbit can be ridden: both wheels pushed, and both rims touching the ground once."""

from __future__ import annotations

import numpy as np

from ..kinematics import WHEELS
from ..normal_force import normal_forces
from ..simulate import simulate
from .orbits import PeriodicOrbit
from .shooting import Flow

_LOOKS = 65  # states over a period; forces change as smoothly as the lean does


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
    state = flow.moved_to(orbit.state).near
    bicycle, surface = flow.equations.bicycle, flow.equations.surface
    try:
        motion = simulate(bicycle, surface, state[:9], state[9:18], np.linspace(0.0, orbit.period, _LOOKS))
    except ValueError as error:  # a rim lies inside the ground at the start
        return (str(error),)
    if motion.ended is not None:
        return (motion.ended,)
    least = normal_forces(surface, motion.contact, motion.force).min(axis=0)
    return tuple(
        f"the ground would have to pull the {wheel} wheel: {force:.3g} N"
        for wheel, force in zip(WHEELS, least, strict=True)
        if not force > 0
    )
