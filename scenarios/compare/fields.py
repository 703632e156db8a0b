"""Every stored number of one ride against the same engine's ride in another run, not the positions alone.

A field may move by what the state may (`velodrome.scenarios.compare.differences`), times the size that the motion
itself gives the field:

    positions, contact points, gaps     the circle's radius
    angles, quaternions                 1, and what a wheel turns in the whole ride where that is larger
    rates                               the rear wheel's; those of D its speed
    slip                                the speed of D
    contact forces                      the largest force, times the rear rate's square over that of a pendulum of
                                        the circle's radius: they follow accelerations, whose sensitivity to the
                                        state is the square of its fastest rate
    energies                            twice the total, since they are quadratic in the speeds

Yaw and the wheels' angles are compared up to whole turns, and quaternions up to their sign.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from ...engines.storage import trajectory_columns
from ...reference.bicycle import BODIES
from ...reference.kinematics import FRONT_ANGLE, REAR_ANGLE
from ...reports.measure import TURNING, Scale, to_number

Growth = Callable[[float], float]

# D's own coordinates are compared as a distance.
_LEFT_OUT = {"time": (0,), "q": (0, 1, 2)}


def field_differences(
    rides: tuple[Trajectory, Trajectory], scale: Scale, noise: Growth, reach: Growth
) -> dict[str, Any]:
    """How far each field of two rides is apart, and how far it may be.

    Parameters
    ----------
    rides : (Trajectory, Trajectory)
        The earlier and the later one, sampled at the same times as far as they go, and no further than they are to
        be compared.
    scale : Scale
        Its duration is that of the whole ride.
    noise, reach : callable
        Relative error of the state that is allowed at a time [s], without and with the share of the way ridden.

    Returns
    -------
    dict
        JSON values by field. One that both rides have: the ``column`` that is furthest beyond its limit or nearest to
        it, its ``unit``, its largest difference ``max`` (None where only one has a number) at ``max_at``, what is
        ``allowed`` there, from when on it ``exceeds_at`` [s] what is ``allowed_first``, and how many ``columns_beyond``
        do. One that a single ride has: ``only_in``, either "before" or "after". One that none has is missing.
    """
    samples = min(len(ride.time) for ride in rides)
    before, after = (ride.first(samples) for ride in rides)
    growth = np.array([[noise(t), reach(t)] for t in before.time.tolist()])
    found = {}
    for field, names in trajectory_columns():
        a, b = getattr(before, field), getattr(after, field)
        if a is None or b is None:
            if a is not b:
                found[field] = {"only_in": "after" if a is None else "before"}
            continue
        if field == "body_quaternion":
            b = _same_sign(a, b)
        if field == "q":
            b = _same_turns(a, b)
        kept = [j for j in range(len(names)) if j not in _LEFT_OUT.get(field, ())]
        if kept:
            apart = _apart(a.reshape(samples, -1), b.reshape(samples, -1))[:, kept]
            allowed = _allowed(field, before, scale, growth)[:, kept]
            found[field] = _worst([names[j] for j in kept], before.time, apart, allowed)
    return found


def _same_sign(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quaternions (n, k, 4) with the sign that is nearer to those of another ride: both are one orientation."""
    return np.where(np.sum(a * b, axis=-1, keepdims=True) < 0, -b, b)


def _same_turns(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Coordinates (n, 9) with the whole turns of yaw and wheels nearest to another ride's: both are one state."""
    turns = np.nan_to_num(np.round((a - b)[:, TURNING] / (2 * np.pi)), nan=0.0, posinf=0.0, neginf=0.0)
    alike = b.copy()
    alike[:, TURNING] += 2 * np.pi * turns
    return alike


def _apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Sizes of differences; none where both are the same or no number, infinite where one is no number."""
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):
        return np.where(same, 0.0, np.nan_to_num(np.abs(a - b), nan=np.inf))


def _allowed(field: str, ride: Trajectory, scale: Scale, growth: np.ndarray) -> np.ndarray:
    """What the columns of a field may differ by, shape (n, columns), in their units."""
    noise, reach = growth[:, :1], growth[:, 1:]
    turned = noise * scale.turned
    if field == "q":
        allowed = np.repeat(reach, 9, axis=1)
        allowed[:, [REAR_ANGLE, FRONT_ANGLE]] = np.maximum(reach, turned)
        return allowed
    if field == "qd":
        return reach * scale.rates
    if field == "body_quaternion":
        wheels = np.repeat(["wheel" in body for body in BODIES], 4)
        return np.where(wheels, np.maximum(reach, turned), reach)
    # Multipliers do not follow what steps add up to, they jump by what a single one leaves unconverged, and do so
    # from the first sample on: what the whole ride is allowed they are allowed anywhere.
    law = np.full_like(reach, reach[-1, 0]) if field == "contact_force" else reach
    return np.repeat(law * _size(field, ride, scale), getattr(ride, field)[0].size, axis=1)


def _size(field: str, ride: Trajectory, scale: Scale) -> float:
    """What the motion gives a field whose columns are all of one size, in the field's unit."""
    if field == "contact_force":
        assert ride.contact_force is not None
        largest = np.linalg.norm(ride.contact_force, axis=-1)
        # On a tight or slow circle a force turns with the bicycle faster than that.
        return max(scale.rear_rate**2 * scale.radius / scale.gravity, 1.0) * _largest(largest)
    if field in ("kinetic_energy", "potential_energy"):
        parts = [part for part in (ride.kinetic_energy, ride.potential_energy) if part is not None]
        return 2 * _largest(np.abs(np.sum([part[:1] for part in parts], axis=0)))
    return scale.speed if field == "slip" else scale.radius


def _largest(values: np.ndarray) -> float:
    """The largest number; none of a ride that has no number."""
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))


def _worst(names: list[tuple[str, str]], time: np.ndarray, apart: np.ndarray, allowed: np.ndarray) -> dict[str, Any]:
    """A field's entry, from differences and limits of shape (n, columns)."""
    beyond = apart > allowed
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(apart > 0, apart / allowed, 0.0)
    column = int(share.max(axis=0).argmax())
    sample = int(apart[:, column].argmax())
    most, begin = apart[sample, column], np.flatnonzero(beyond[:, column])
    first = int(begin[0]) if len(begin) else sample
    return {
        "column": names[column][0],
        "unit": names[column][1],
        "max": to_number(most),
        "max_at": float(time[sample]),
        "allowed": float(allowed[sample, column]),
        "exceeds_at": float(time[first]) if len(begin) else None,
        "allowed_first": float(allowed[first, column]),
        "columns_beyond": int(beyond.any(axis=0).sum()),
    }
