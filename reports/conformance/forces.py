"""Whether contact forces act on the wheels, in inertial axes and in newtons.

The forces of an engine with soft contacts differ from the reference's. The check therefore uses no tolerance: the
forces must be nearer to the reference's than to any misinterpretation of them, such as the wrong sign or axes.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...reference.kinematics import rotations
from ...reference.surface import unit_normals
from ..measure import ride_limits
from .explain import fit_factor, fit_lag, size_of
from .report import ConformanceCheck, make_check, skip_check
from .rides import Ride

CLAIM = "its contact forces are those of the ground on the wheels, in inertial axes and newtons"
_SETTLED = 0.5  # share of the ride after which contacts have settled
_ROOM = 4.0  # factor on the ride's own error


def check_forces(ride: Ride) -> ConformanceCheck:
    """Check the direction, axes and unit of the contact forces."""
    name = f"forces on {ride.motion.name}"
    if ride.trajectory.contact_force is None or ride.exact.contact_force is None:
        return skip_check(name, CLAIM, "it gives none")
    late = ride.trajectory.time >= _SETTLED * ride.trajectory.time[-1]
    given, right = ride.trajectory.contact_force, ride.exact.contact_force
    off = size_of((given - right)[late]) / size_of(right[late])
    distances = {
        what: size_of((given - guess)[late]) / size_of(right[late]) for what, guess in _misread_forces(ride, right)
    }
    what = min(distances, key=lambda reading: distances[reading])
    wrong = []
    if distances[what] < off:
        wrong = [f"they are off by {off:.2g} of themselves, and by {distances[what]:.2g} if they are {what}"]
    elif off > _force_limit(ride):
        factor, lag = fit_factor(given[late], right[late]), fit_lag(given, right, ride.trajectory.time)
        if factor is not None:
            wrong = [f"they look scaled by {factor:.6g}"]
        elif lag is not None:
            wrong = [f"they look {abs(lag):.3g} s {'late' if lag > 0 else 'early'}"]
    return make_check(
        name,
        CLAIM,
        wrong,
        [f"off by {off:.2g} of themselves"],
        "forces must be nearer to the reference's than to any misinterpretation of them, and no factor or lag may "
        "explain nine tenths of their difference",
    )


def _misread_forces(ride: Ride, right: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield misinterpretations of forces: a description, and the reference's forces so misinterpreted."""
    yield "those of the wheels on the ground, with the wrong sign", -right
    yield "those of the other wheel", right[:, ::-1]
    yield "in the contact's own axes (lateral, forward, normal)", _in_contact_axes(ride, right)
    yield "in kilonewtons", right / 1000
    yield "without their tangential part", np.where(np.arange(3) == 2, right, 0.0)
    for axis, letter in enumerate("xyz"):
        mirror = np.ones(3)
        mirror[axis] = -1
        yield f"mirrored in {letter}", mirror * right
    yield "zero", 0 * right


def _in_contact_axes(ride: Ride, right: np.ndarray) -> np.ndarray:
    problem, point = ride.motion.problem, ride.exact.contact_point
    assert point is not None
    normal = unit_normals(problem.surface, point[..., 0], point[..., 1])
    axle = rotations(problem.bicycle, ride.exact.q)[:, 2:, :, 1]
    forward = np.cross(axle, normal)
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    lateral = np.cross(normal, forward)
    return np.stack([np.sum(right * axis, axis=-1) for axis in (lateral, forward, normal)], axis=-1)


def _force_limit(ride: Ride) -> float:
    """Return the relative difference of forces that the ride's own error allows."""
    limits = ride_limits(ride.motion.scale, ride.noise + _ROOM * ride.error)
    return limits["contact_force_error"]
