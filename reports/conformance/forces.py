"""Whether contact forces act on the wheels, in inertial axes and in newtons, and are as large as the reference's.

Two rules hold. Forces must be nearer to the reference's than to any misinterpretation of them, such as the wrong sign
or axes, whatever the engine's error. And they may differ from the reference's by no more than the ride's own error
allows: four times their change by twice the step, or, for contacts with friction and for rides that are wrong
themselves, the error of the coordinates times the square of the motion's fastest rate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ...reference.kinematics import WHEELS, rotations
from ...reference.surface import unit_normals
from ..measure import ride_limits, step_force
from .explain import EXPLAINED, explains, fit_factor, fit_lag, size_of
from .report import ConformanceCheck, make_check, skip_check
from .rides import Ride

CLAIM = "its contact forces are those of the ground on the wheels, in inertial axes and newtons"
_SETTLED = 0.5  # share of the ride after which contacts have settled
_ROOM = 4.0  # factor on the ride's own error
_COARSE = 1e-2  # limit, relative to the weight, from which on the report says what it hides
_LIMIT = (
    "forces must be nearer to the reference's than to any misinterpretation of them, and differ by no more than the "
    "noise and four times their change by twice the step, or four times the ride's own error"
)


def check_forces(ride: Ride, coarse: Ride | None, ride_every_step: Callable[[], Ride | None]) -> ConformanceCheck:
    """Check the contact forces: their direction, axes and unit, and their values.

    Parameters
    ----------
    ride : Ride
    coarse : Ride or None
        The same ride with twice the step, if the engine has one.
    ride_every_step : callable
        Simulates the same ride with output at every step; returns None if the engine cannot.
    """
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
    largest, limit = _largest_difference(ride, given - right), _force_limit(ride, coarse)
    wrong, observations = [], [f"off by {largest:.2g} of the weight, limit {limit:.2g}"]
    misread = f"they are off by {off:.2g} of themselves, and by {distances[what]:.2g} if they are {what}"
    if distances[what] <= off / 2:
        wrong = [misread]
    elif not largest <= limit:
        means = _mean_difference(ride_every_step())
        if means <= limit:
            observations.append(
                f"they ring from step to step: the means of two steps are off by {means:.2g} of the weight"
            )
        else:
            wrong = [*observations, *_explain_forces(ride, given, right, late)]
    elif distances[what] < off:
        wrong = [misread]
    if limit > _COARSE:
        observations.append(
            f"errors of up to {limit:.2g} of the weight could not be told: the ride's own error hides them"
        )
    return make_check(name, CLAIM, wrong, observations, _LIMIT)


def _explain_forces(ride: Ride, given: np.ndarray, right: np.ndarray, late: np.ndarray) -> Iterator[str]:
    """Explain wrong forces by a factor or an offset, of all of them or of a part, or by a lag."""
    given_late, right_late = given[late], right[late]
    parts: list[tuple[str, tuple[Any, ...]]] = [("they look", (...,))]
    parts += [(f"those of the {wheel} wheel look", (slice(None), i)) for i, wheel in enumerate(WHEELS)]
    parts += [(f"their {letter} components look", (..., i)) for i, letter in enumerate("xyz")]
    for what, part in parts:
        factor = fit_factor(given_late[part], right_late[part])
        if factor is not None:
            guess = right_late.copy()
            guess[part] *= factor
            if explains(given_late, guess, right_late):
                yield f"{what} scaled by {factor:.6g}"
                return
    offset = (given_late - right_late).mean(axis=0)
    if explains(given_late, right_late + offset, right_late):
        for wheel, vector in zip(WHEELS, offset, strict=True):
            if size_of(vector) > EXPLAINED * size_of(offset):
                shown = np.where(np.abs(vector) > 0.01 * size_of(vector), vector, 0.0)
                words = ", ".join(f"{value:.3g}" for value in shown)
                yield f"those of the {wheel} wheel look shifted by ({words}) N"
        return
    lag = fit_lag(given, right, ride.trajectory.time)
    if lag is not None:
        yield f"they look {abs(lag):.3g} s {'late' if lag > 0 else 'early'}"


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
    yield "with x and y swapped", right[..., [1, 0, 2]]
    for i, wheel in enumerate(WHEELS):
        own = np.arange(2)[:, None] == i
        yield f"zero at the {wheel} wheel", np.where(own, 0.0, right)
        yield f"mirrored in x and y at the {wheel} wheel", np.where(own, right * [-1, -1, 1], right)


def _in_contact_axes(ride: Ride, right: np.ndarray) -> np.ndarray:
    problem, point = ride.motion.problem, ride.exact.contact_point
    assert point is not None
    normal = unit_normals(problem.surface, point[..., 0], point[..., 1])
    axle = rotations(problem.bicycle, ride.exact.q)[:, 2:, :, 1]
    forward = np.cross(axle, normal)
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    lateral = np.cross(normal, forward)
    return np.stack([np.sum(right * axis, axis=-1) for axis in (lateral, forward, normal)], axis=-1)


def _largest_difference(ride: Ride, differences: np.ndarray) -> float:
    """Return the largest difference of forces (n, 2, 3) after contacts have settled, relative to the weight."""
    bicycle, time = ride.motion.problem.bicycle, ride.trajectory.time[: len(differences)]
    weight = bicycle.gravity * bicycle.mass
    settled = differences[time >= _SETTLED * ride.trajectory.time[-1]]
    return float(np.linalg.norm(settled, axis=-1).max(initial=0.0)) / weight


def _mean_difference(ride: Ride | None) -> float:
    """Return by how much the means of forces of two successive steps are off, relative to the weight.

    A method without damping, such as the trapezoidal rule, keeps a difference of the forces at the start forever, with
    a sign that changes from step to step. The means are those of a method that has it not.
    """
    if ride is None or ride.trajectory.contact_force is None or ride.exact.contact_force is None:
        return np.inf
    differences = ride.trajectory.contact_force - ride.exact.contact_force
    return _largest_difference(ride, (differences[1:] + differences[:-1]) / 2)


def _force_limit(ride: Ride, coarse: Ride | None) -> float:
    """Return the difference from the reference's forces that the ride's own error allows, relative to the weight.

    Forces follow accelerations, so that the error of a ride limits that of its forces. Where twice the step changes the
    coordinates by as much as they are off, the forces' own change by twice the step is a closer limit.
    """
    noise, scale = ride.noise, ride.motion.scale
    noise_limit = ride_limits(scale, noise, step_force(scale, ride.step_noise, ride.step))["contact_force_error"]
    # A method's own error that vanishes with the step.
    if coarse is not None and ride.trajectory.friction is None and coarse.trajectory.contact_force is not None:
        n = min(len(ride.q), len(coarse.q))
        change = float(np.abs((ride.q[:n] - coarse.q[:n]) / ride.motion.sizes).max())
        if ride.error <= noise + _ROOM * change:
            forces = ride.trajectory.contact_force, coarse.trajectory.contact_force
            assert forces[0] is not None
            return noise_limit + _ROOM * _largest_difference(ride, forces[0][:n] - forces[1][:n])
    return noise_limit + ride_limits(scale, _ROOM * ride.error)["contact_force_error"]
