"""Comparison of all stored fields of one ride with the same engine's ride in another run.

A field may differ by the relative error allowed of the state (`velodrome.scenarios.compare.differences`), times the
size that the motion gives the field:

    positions, contact points, gaps     the circle's radius
    angles, quaternions                 1, or the angle that a wheel turns in the whole ride if that is larger
    rates                               the rear wheel's rate; for those of D its speed
    slip                                the speed of D
    contact forces                      the largest force, times the square of the rear rate over that of a pendulum
                                        of the circle's radius: forces depend on accelerations, whose sensitivity to
                                        the state is the square of its fastest rate
    energies                            twice the total, since they are quadratic in the speeds

Yaw and the wheels' angles are compared up to whole turns, and quaternions up to their sign.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from ...engines.storage import trajectory_columns
from ...reference.bicycle import BODIES
from ...reference.kinematics import FRONT_ANGLE, REAR_ANGLE
from ...reports.measure import TURNING, Scale, to_number

Growth = Callable[[float], float]

# The coordinates of D are compared as a distance.
_LEFT_OUT = {"time": (0,), "q": (0, 1, 2)}


@dataclass(frozen=True)
class FieldDifference:
    """Difference of a field that both rides have.

    Attributes
    ----------
    column : str
        Column that is furthest beyond its limit, or nearest to it.
    unit : str
    max : float or None
        Largest difference in the column; None where only one ride has a number.
    max_at : float
        Time of the largest difference [s].
    allowed : float
        Difference allowed at this time.
    exceeds_at : float or None
        First time at which the difference is larger than allowed [s]; None if it is nowhere.
    allowed_first : float
        Difference allowed at that time.
    columns_beyond : int
        Number of columns with differences larger than allowed.
    """

    column: str
    unit: str
    max: float | None
    max_at: float
    allowed: float
    exceeds_at: float | None
    allowed_first: float
    columns_beyond: int

    def as_json(self) -> dict[str, Any]:
        """Return the difference as a JSON object."""
        return asdict(self)


@dataclass(frozen=True)
class FieldOfOneRun:
    """A field that only one run has: ``before`` or ``after``."""

    only_in: str

    def as_json(self) -> dict[str, Any]:
        """Return the field as a JSON object."""
        return asdict(self)


def field_differences(
    rides: tuple[Trajectory, Trajectory], scale: Scale, noise: Growth, reach: Growth
) -> dict[str, FieldDifference | FieldOfOneRun]:
    """Compare each field of two rides with its limit.

    Parameters
    ----------
    rides : (Trajectory, Trajectory)
        The earlier and the later ride, sampled at the same times, up to the time until which they are compared.
    scale : Scale
        Its duration is that of the whole ride.
    noise, reach : callable
        Relative error of the state allowed at a time [s], without and with the fraction of the distance ridden.

    Returns
    -------
    dict
        Differences by field; fields that neither ride has are missing.
    """
    samples = min(len(ride.time) for ride in rides)
    before, after = (ride.first(samples) for ride in rides)
    growth = np.array([[noise(t), reach(t)] for t in before.time.tolist()])
    found: dict[str, FieldDifference | FieldOfOneRun] = {}
    for field, names in trajectory_columns():
        a, b = getattr(before, field), getattr(after, field)
        if a is None or b is None:
            if a is not b:
                found[field] = FieldOfOneRun("after" if a is None else "before")
            continue
        if field == "body_quaternion":
            b = _match_signs(a, b)
        if field == "q":
            b = _match_turns(a, b)
        columns = [j for j in range(len(names)) if j not in _LEFT_OUT.get(field, ())]
        if columns:
            apart = _absolute_differences(a.reshape(samples, -1), b.reshape(samples, -1))[:, columns]
            allowed = _allowed_differences(field, before, scale, growth)[:, columns]
            found[field] = _worst_column([names[j] for j in columns], before.time, apart, allowed)
    return found


def _match_signs(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Choose the signs of quaternions (n, k, 4) that are nearer to another ride's; both are the same orientation."""
    return np.where(np.sum(a * b, axis=-1, keepdims=True) < 0, -b, b)


def _match_turns(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Shift yaw and wheel angles of coordinates (n, 9) by whole turns to those nearest to another ride's."""
    turns = np.nan_to_num(np.round((a - b)[:, TURNING] / (2 * np.pi)), nan=0.0, posinf=0.0, neginf=0.0)
    shifted = b.copy()
    shifted[:, TURNING] += 2 * np.pi * turns
    return shifted


def _absolute_differences(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return absolute differences; zero where both numbers are equal or both nan, infinite where only one is nan."""
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):
        return np.where(same, 0.0, np.nan_to_num(np.abs(a - b), nan=np.inf))


def _allowed_differences(field: str, ride: Trajectory, scale: Scale, growth: np.ndarray) -> np.ndarray:
    """Return the allowed differences of a field's columns, shape (n, columns), in their units."""
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
    # Errors of multipliers do not accumulate over steps: they have the size of what one step leaves unconverged, from
    # the first sample on. They may therefore differ everywhere by what is allowed at the end.
    law = np.full_like(reach, reach[-1, 0]) if field == "contact_force" else reach
    return np.repeat(law * _field_size(field, ride, scale), getattr(ride, field)[0].size, axis=1)


def _field_size(field: str, ride: Trajectory, scale: Scale) -> float:
    """Return the size that the motion gives a field whose columns are all of one size, in the field's unit."""
    if field == "contact_force":
        assert ride.contact_force is not None
        magnitudes = np.linalg.norm(ride.contact_force, axis=-1)
        # On a tight or slow circle a force turns with the bicycle faster than that.
        return max(scale.rear_rate**2 * scale.radius / scale.gravity, 1.0) * _largest_finite(magnitudes)
    if field in ("kinetic_energy", "potential_energy"):
        parts = [part for part in (ride.kinetic_energy, ride.potential_energy) if part is not None]
        return 2 * _largest_finite(np.abs(np.sum([part[:1] for part in parts], axis=0)))
    return scale.speed if field == "slip" else scale.radius


def _largest_finite(values: np.ndarray) -> float:
    """Return the largest finite number; 0 if there is none."""
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))


def _worst_column(
    names: list[tuple[str, str]], time: np.ndarray, apart: np.ndarray, allowed: np.ndarray
) -> FieldDifference:
    """Make a field's difference from the differences and limits of its columns, shape (n, columns)."""
    beyond = apart > allowed
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(apart > 0, apart / allowed, 0.0)
    column = int(share.max(axis=0).argmax())
    sample = int(apart[:, column].argmax())
    most, begin = apart[sample, column], np.flatnonzero(beyond[:, column])
    first = int(begin[0]) if len(begin) else sample
    return FieldDifference(
        column=names[column][0],
        unit=names[column][1],
        max=to_number(most),
        max_at=float(time[sample]),
        allowed=float(allowed[sample, column]),
        exceeds_at=float(time[first]) if len(begin) else None,
        allowed_first=float(allowed[first, column]),
        columns_beyond=int(beyond.any(axis=0).sum()),
    )
