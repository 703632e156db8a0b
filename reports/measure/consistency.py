"""Whether what an engine says of itself agrees with its coordinates.

Poses, contact points, gaps, slip and energies follow from the coordinates and rates; what an engine reports of them,
and its rates as derivatives of its coordinates, must agree. How closely follows from what is measured anyway: the
reports, rates and coordinates of one computation approximate one motion, so none of them is much further off than the
others. With E(t) the largest error of the coordinates against the reference up to the time t, relative to the motion's
size, a report may differ by

    size of the quantity x (noise + ROOM x E(t)),    noise = error of the start + relative error that a step may add

and nothing but noise at the start, where E is 0: joints that drift and velocities that an integrator leaves off their
constraints are errors of the engine's method, and come with errors of its coordinates of the same order.

The rates are held against the coordinates by quadrature: q[k+1] - q[k] less the integral of the polynomial through six
samples of the rates, both as differences from the reference's, which has the same quadrature error. What is left may be
the quadrature's own error, taken as its changes with four and with two samples, and size x (noise + ROOM x E(t)) at
the ends of an output interval and times the motion's fastest rate along it, by which velocities err.
So a fault that is smaller than what the engine's own error leaves open is not told from it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ...engines.engine import REFERENCE, Trajectory
from ...reference.bicycle import BODIES, Bicycle
from ...reference.contact import observe
from ...reference.kinematics import COORDINATES, FRONT_ANGLE, REAR_ANGLE, WHEELS, YAW, body_positions, body_quaternions
from ...reference.surface import Surface
from .limits import START_ERROR

# Ratio of two errors of one computation. A method of order 1 leaves in its first steps as much between rates and
# coordinates as in the coordinates themselves (1.0); the engines here need 1.2, and no more than 0.5 in any report.
ROOM = 4.0
# An engine cannot claim more room than this by its step noise.
LARGEST_NOISE = 1e-6
_SAMPLES = 6  # of the quadrature: its error goes with the seventh power of the output interval
_FEWEST = 4  # samples of a ride from which the quadrature's error can be seen

_WHEELS = tuple(f"{wheel}_wheel" for wheel in WHEELS)
# Known up to whole turns.
TURNING = [YAW, REAR_ANGLE, FRONT_ANGLE]


def evaluate_ride(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> Trajectory:
    """The ride with poses, contact points, gaps, slip and energies as they follow from its coordinates and rates.

    Where a wheel has no closest approach its contact point, gap and slip are NaN; forces stay the engine's.
    """
    seen = observe(bicycle, surface, trajectory.q, trajectory.qd)
    lost = np.zeros(len(trajectory.q), bool) if seen.found else _lost(trajectory, bicycle, surface)
    point, gap, slip = (_without(values, lost) for values in (seen.point, seen.gap, seen.slip))
    return replace(
        trajectory,
        body_position=body_positions(bicycle, trajectory.q),
        body_quaternion=body_quaternions(bicycle, trajectory.q),
        contact_point=point,
        gap=gap,
        slip=slip,
        kinetic_energy=seen.kinetic_energy,
        potential_energy=seen.potential_energy,
    )


def _lost(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> np.ndarray:
    """Samples in which a closest approach could not be computed, shape (n,)."""
    states = zip(trajectory.q, trajectory.qd, strict=True)
    return np.array([not observe(bicycle, surface, q[None], qd[None]).found for q, qd in states])


def _without(values: np.ndarray, lost: np.ndarray) -> np.ndarray:
    return np.where(lost.reshape(-1, *[1] * (values.ndim - 1)), np.nan, values) if lost.any() else values


@dataclass(frozen=True)
class Mismatch:
    """How far a report of an engine is from what follows from its coordinates, where it is furthest in its limit.

    Attributes
    ----------
    quantity : str
        Field of `velodrome.engines.engine.Trajectory`; ``qd`` for rates that are not the coordinates' derivatives.
    part : str
        Body, wheel or coordinate; empty for an energy.
    difference, limit : float
        In ``unit``.
    unit : str
    time : float
        Of the sample [s].
    """

    quantity: str
    part: str
    difference: float
    limit: float
    unit: str
    time: float

    @property
    def holds(self) -> bool:
        """Whether the report agrees."""
        return self.difference <= self.limit

    @property
    def share(self) -> float:
        """The difference in units of its limit."""
        if self.difference == 0:
            return 0.0
        return self.difference / self.limit if self.limit > 0 else np.inf

    def as_json(self) -> dict[str, Any]:
        """Fields as JSON values."""
        return asdict(self)


def describe_mismatch(report: Mapping[str, Any]) -> str:
    """Say in words what of an engine's reports differs from what, by how much and when, from `Mismatch.as_json`."""
    part, unit = report["part"].replace("_", " "), report["unit"].removeprefix("1")
    if report["quantity"] == "qd":
        what, other = f"the rate of its {part}", "the derivative of that coordinate"
    else:
        what = "its " + report["quantity"].removeprefix("body_").replace("_", " ") + (f" of the {part}" if part else "")
        other = "what follows from its coordinates"
    difference, limit = (f"{report[key]:.2g} {unit}".rstrip() for key in ("difference", "limit"))
    return f"{what} is {difference} from {other} at {report['time']:.4g} s, limit {limit}"


def find_mismatches(
    reported: Trajectory, followed: Trajectory, exact: Trajectory | None, size: float, step_noise: float
) -> list[Mismatch]:
    """Hold an engine's reports and rates against its coordinates.

    Parameters
    ----------
    reported : Trajectory
        As the engine gave it, up to its fall.
    followed : Trajectory
        The same ride as `evaluate_ride` gives it.
    exact : Trajectory or None
        The reference, sampled at the same times as far as both go. Without one no rates are judged, and reports at
        the start only, but for the reference itself.
    size : float
        Of the motion: radius of its circle, or wheelbase [m].
    step_noise : float
        Relative error that a step may add beyond its method.

    Returns
    -------
    list of Mismatch
        One a report that is given, and one for the rates of four samples or more.
    """
    samples = len(reported.time) if exact is None else min(len(reported.time), len(exact.time))
    reported, followed = reported.first(samples), followed.first(samples)
    sizes = np.array([*3 * [size], *6 * [1.0]])
    if exact is not None:
        error = np.maximum.accumulate(np.abs(coordinate_differences(reported, exact) / sizes).max(axis=1))
    else:
        error = np.full(samples, 0.0 if reported.engine == REFERENCE else np.inf)
    error[0] = 0.0
    noise = START_ERROR + min(step_noise, LARGEST_NOISE)
    found = [_furthest(*report, reported.time) for report in _reports(reported, followed, noise + ROOM * error, size)]
    if exact is None or samples < _FEWEST:
        return found
    return [*found, _rates(reported, exact.first(samples), (noise + ROOM * error[1:, None]) * sizes)]


def largest_speed(trajectory: Trajectory) -> float:
    """Largest speed of D [m/s]."""
    return float(_lengths(trajectory.qd[:, :3]).max())


def coordinate_differences(trajectory: Trajectory, exact: Trajectory) -> np.ndarray:
    """Coordinates less those of another ride at least as long, (n, 9); whole turns of yaw and wheels do not count."""
    return _less_turns(trajectory.q - exact.q[: len(trajectory.q)])


def _less_turns(apart: np.ndarray) -> np.ndarray:
    apart[:, TURNING] -= 2 * np.pi * np.round(apart[:, TURNING] / (2 * np.pi))
    return apart


Report = tuple[str, tuple[str, ...], str, np.ndarray, np.ndarray]  # quantity, parts, unit, difference and limit (n, k)


def _reports(reported: Trajectory, followed: Trajectory, room: np.ndarray, size: float) -> Iterator[Report]:
    """Differences of the reports that are given, and their limits from the relative ``room`` of each sample."""
    room = room[:, None]
    speed = largest_speed(followed)
    # Velocities err by the error of coordinates times the motion's fastest rate.
    moving = speed + size * float(np.abs(followed.qd[:, YAW:]).max())
    parts = (followed.kinetic_energy, followed.potential_energy)
    energy = np.sum([np.abs(part) for part in parts if part is not None], axis=0)[:, None]
    turned = np.minimum(*(_lengths(reported.body_quaternion + sign * followed.body_quaternion) for sign in (-1, 1)))
    # A position is known to a few units in its last place, an orientation to those of the largest angle.
    last = 16 * np.finfo(float).eps * (np.abs(followed.q).max() + size)
    yield "body_position", BODIES, "m", _lengths(reported.body_position - followed.body_position), size * room + last
    yield "body_quaternion", BODIES, "1", turned, room + last
    for name, unit, scale in (("contact_point", "m", size), ("gap", "m", size), ("slip", "m/s", moving)):
        given, found = getattr(reported, name), getattr(followed, name)
        if given is not None:
            apart = np.abs(given - found) if name == "gap" else _lengths(given - found)
            yield name, _WHEELS, unit, apart, scale * room + last
    # Kinetic energy is quadratic in the speeds.
    faster = 2 * moving / speed if speed > 0 else 2.0
    for name, scale in (("kinetic_energy", faster * energy), ("potential_energy", energy)):
        given = getattr(reported, name)
        if given is not None:
            yield name, ("",), "J", np.abs(given - getattr(followed, name))[:, None], scale * room


def _lengths(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def _furthest(
    quantity: str, parts: tuple[str, ...], unit: str, apart: np.ndarray, limit: np.ndarray, time: np.ndarray
) -> Mismatch:
    """The sample and part furthest in its limit; a difference to what is no number is said elsewhere and is none."""
    apart = np.minimum(np.where(np.isnan(apart), 0.0, apart), np.finfo(float).max)
    limit = np.broadcast_to(limit, apart.shape)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        share = np.where(apart > 0, apart / limit, 0.0)
    sample, part = np.unravel_index(np.argmax(share), apart.shape)
    return Mismatch(
        quantity, parts[part], float(apart[sample, part]), float(limit[sample, part]), unit, float(time[sample])
    )


def _rates(reported: Trajectory, exact: Trajectory, room: np.ndarray) -> Mismatch:
    """The rate furthest from its coordinate's derivative, means over output intervals; ``room`` (n - 1, 9) [m, rad]."""
    time, q, qd = reported.time, coordinate_differences(reported, exact), reported.qd - exact.qd
    with np.errstate(over="ignore", invalid="ignore"):
        way = _integrals(time, qd, _SAMPLES)
        unsure = sum(np.abs(way - _integrals(time, qd, fewer)) for fewer in (2, _SAMPLES - 2))
    left = np.abs(_less_turns(np.diff(q, axis=0) - way))
    # Rates whose integrals overflow are nobody's derivatives.
    overflowed = ~np.isfinite(unsure + left)
    unsure, left = np.where(overflowed, 0.0, unsure), np.where(overflowed, np.inf, left)
    last = 16 * np.finfo(float).eps * np.abs(reported.q).max(axis=0)
    interval = np.diff(time)[:, None]
    room = room * (1 + float(np.abs(reported.qd[:, YAW:]).max()) * interval)
    found = _furthest("qd", COORDINATES, "rad/s", left / interval, (room + last + unsure) / interval, time[1:])
    return replace(found, unit="m/s") if found.part in COORDINATES[:3] else found


def _integrals(time: np.ndarray, values: np.ndarray, samples: int) -> np.ndarray:
    """Integrals from sample to sample of the polynomials through the nearest so many samples, (n - 1, k)."""
    n, interval = len(time), np.diff(time)
    samples = min(samples, n)
    first = np.clip(np.arange(n - 1) - (samples // 2 - 1), 0, n - samples)
    nearest = first[:, None] + np.arange(samples)
    nodes = (time[nearest] - time[:-1, None]) / interval[:, None]
    moments = 1 / np.arange(1, samples + 1)
    # On an even grid all stencils but those at the ends are one.
    _, kinds, kind = np.unique(np.round(nodes, 9), axis=0, return_index=True, return_inverse=True)
    powers = nodes[kinds, None, :] ** np.arange(samples)[:, None]
    weights = np.linalg.solve(powers, np.broadcast_to(moments, (len(kinds), samples))[..., None])[..., 0]
    return interval[:, None] * np.einsum("ks,ksj->kj", weights[kind.reshape(-1)], values[nearest])
