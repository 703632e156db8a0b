"""Check that an engine's reports agree with its coordinates.

Body poses, contact points, gaps, slip and energies follow from the coordinates and rates. What an engine reports of
them must agree with these, and its rates must be the derivatives of its coordinates. The tolerance follows from
quantities that are measured anyway: reports, rates and coordinates of one computation approximate one motion, so none
of them has a much larger error than the others. With E(t) the largest error of the coordinates against the reference up
to the time t, relative to the size of the motion, a report may differ by

    size of the quantity x (noise + ROOM x E(t)),    noise = error of the start + relative error that a step may add

and at the start, where E is 0, by the noise alone. Joints that drift and velocities that an integrator leaves off their
constraints are errors of the engine's method, and occur together with errors of its coordinates of the same order.

The rates are compared with the coordinates by quadrature: q[k+1] - q[k] minus the integral of the polynomial through
six samples of the rates, both as differences from the reference's, which has the same quadrature error. The rest may be
as large as the quadrature's own error, estimated by its changes with four and with two samples, plus
size x (noise + ROOM x E(t)) at the ends of an output interval, plus the same times the motion's fastest rate over the
interval, since velocities have this error. A fault smaller than this tolerance is not detected.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ...engines.engine import REFERENCE, Trajectory
from ...reference.bicycle import BODIES, Bicycle
from ...reference.contact import observe
from ...reference.kinematics import COORDINATES, FRONT_ANGLE, REAR_ANGLE, WHEELS, YAW, body_positions, body_quaternions
from ...reference.surface import Surface
from .kernels.quadrature import integrate_samples
from .kernels.worst import find_worst, find_worst_vector
from .limits import START_ERROR

# Largest ratio of two errors of one computation. A method of order 1 leaves in its first steps as much between rates
# and coordinates as in the coordinates themselves (1.0). The engines here need 1.2, and at most 0.5 in any report.
ROOM = 4.0
# Largest step noise that an engine may claim.
LARGEST_NOISE = 1e-6
_SAMPLES = 6  # samples per polynomial; the quadrature's error is of seventh order in the output interval
_EPS = float(np.finfo(float).eps)
_FEWEST = 4  # least number of samples of a ride that shows the quadrature's error

_WHEELS = tuple(f"{wheel}_wheel" for wheel in WHEELS)
# Coordinates that are defined up to whole turns.
TURNING = [YAW, REAR_ANGLE, FRONT_ANGLE]


def evaluate_ride(trajectory: Trajectory, bicycle: Bicycle, surface: Surface) -> Trajectory:
    """Return a ride with the poses, contact points, gaps, slip and energies that follow from its coordinates and rates.

    Where a wheel has no closest approach, its contact point, gap and slip are NaN. Forces stay the engine's.
    """
    observed = observe(bicycle, surface, trajectory.q, trajectory.qd)
    point, gap, slip = (
        _replace_by_nan(values, observed.lost) for values in (observed.point, observed.gap, observed.slip)
    )
    return replace(
        trajectory,
        body_position=body_positions(bicycle, trajectory.q),
        body_quaternion=body_quaternions(bicycle, trajectory.q),
        contact_point=point,
        gap=gap,
        slip=slip,
        kinetic_energy=observed.kinetic_energy,
        potential_energy=observed.potential_energy,
    )


def _replace_by_nan(values: np.ndarray, lost: np.ndarray) -> np.ndarray:
    return np.where(lost.reshape(-1, *[1] * (values.ndim - 1)), np.nan, values) if lost.any() else values


@dataclass(frozen=True)
class Mismatch:
    """Difference of an engine's report from its coordinates, at the sample where it is largest relative to its limit.

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
        Time of the sample [s].
    """

    quantity: str
    part: str
    difference: float
    limit: float
    unit: str
    time: float

    @property
    def holds(self) -> bool:
        """Whether the report agrees within its limit."""
        return self.difference <= self.limit

    @property
    def share(self) -> float:
        """Difference relative to its limit."""
        if self.difference == 0:
            return 0.0
        return self.difference / self.limit if self.limit > 0 else np.inf

    def as_json(self) -> dict[str, Any]:
        """Return the fields as JSON values."""
        return asdict(self)


def describe_mismatch(report: Mapping[str, Any]) -> str:
    """Describe in words a mismatch given by `Mismatch.as_json`: what differs from what, by how much and when."""
    part, unit = report["part"].replace("_", " "), report["unit"].removeprefix("1")
    if report["quantity"] == "qd":
        subject, expected = f"the rate of its {part}", "the derivative of that coordinate"
    else:
        name = report["quantity"].removeprefix("body_").replace("_", " ")
        subject = f"its {name}" + (f" of the {part}" if part else "")
        expected = "what follows from its coordinates"
    difference, limit = (f"{report[key]:.2g} {unit}".rstrip() for key in ("difference", "limit"))
    return f"{subject} is {difference} from {expected} at {report['time']:.4g} s, limit {limit}"


def find_mismatches(
    reported: Trajectory, followed: Trajectory, exact: Trajectory | None, size: float, step_noise: float
) -> list[Mismatch]:
    """Compare an engine's reports and rates with its coordinates.

    Parameters
    ----------
    reported : Trajectory
        The engine's ride, up to its fall.
    followed : Trajectory
        The same ride as returned by `evaluate_ride`.
    exact : Trajectory or None
        The reference, sampled at the same times as far as both go. Without it no rates are compared, and reports only
        at the start, except for the reference itself.
    size : float
        Size of the motion: radius of its circle, or wheelbase [m].
    step_noise : float
        Relative error that a step may add beyond its method.

    Returns
    -------
    list of Mismatch
        One per report that is given, and one for the rates of rides with four samples or more.
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
    found = list(_compare_reports(reported, followed, noise + ROOM * error, size))
    if exact is None or samples < _FEWEST:
        return found
    return [*found, _compare_rates(reported, exact.first(samples), (noise + ROOM * error[1:, None]) * sizes)]


def largest_speed(trajectory: Trajectory) -> float:
    """Return the largest speed of D [m/s]."""
    return float(_lengths(trajectory.qd[:, :3]).max())


def coordinate_differences(trajectory: Trajectory, exact: Trajectory) -> np.ndarray:
    """Return a ride's coordinates (n, 9) minus those of another ride at least as long, without whole turns."""
    return _remove_turns(trajectory.q - exact.q[: len(trajectory.q)])


def _remove_turns(differences: np.ndarray) -> np.ndarray:
    differences[:, TURNING] -= 2 * np.pi * np.round(differences[:, TURNING] / (2 * np.pi))
    return differences


def _compare_reports(reported: Trajectory, followed: Trajectory, room: np.ndarray, size: float) -> Iterator[Mismatch]:
    """Yield the mismatch of each given report, with limits from the relative ``room`` (n,) of each sample."""
    speed = largest_speed(followed)
    # Velocities have the error of the coordinates times the motion's fastest rate.
    speed_scale = speed + size * float(np.abs(followed.qd[:, YAW:]).max())
    # Round-off: a few units in the last place of a position, and of the largest angle for an orientation.
    round_off = 16 * _EPS * (float(np.abs(followed.q).max()) + size)
    # Kinetic energy is quadratic in the speeds.
    energy_scale = 2 * speed_scale / speed if speed > 0 else 2.0
    energy = room * sum(
        np.abs(part) for part in (followed.kinetic_energy, followed.potential_energy) if part is not None
    )
    for name, parts, unit, limit in (
        ("body_position", BODIES, "m", (room, size, round_off)),
        ("body_quaternion", BODIES, "1", (room, 1.0, round_off)),
        ("contact_point", _WHEELS, "m", (room, size, round_off)),
        ("gap", _WHEELS, "m", (room, size, round_off)),
        ("slip", _WHEELS, "m/s", (room, speed_scale, round_off)),
        ("kinetic_energy", ("",), "J", (energy, energy_scale, 0.0)),
        ("potential_energy", ("",), "J", (energy, 1.0, 0.0)),
    ):
        given = getattr(reported, name)
        if given is not None:
            shape = (len(given), len(parts), -1)
            pair = (np.ascontiguousarray(values, float).reshape(shape) for values in (given, getattr(followed, name)))
            worst = find_worst_vector(*pair, name == "body_quaternion", *limit)
            yield _describe_worst(name, parts, unit, reported.time, worst)


def _lengths(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def _describe_worst(
    quantity: str, parts: Sequence[str], unit: str, time: np.ndarray, worst: tuple[int, int, float, float]
) -> Mismatch:
    """Return the mismatch of the sample and part with the largest difference relative to its limit.

    Values that are not finite are reported elsewhere: NaN counts as no difference here.
    """
    sample, part, difference, limit = worst
    return Mismatch(quantity, parts[part], difference, limit, unit, float(time[sample]))


def _compare_rates(reported: Trajectory, exact: Trajectory, room: np.ndarray) -> Mismatch:
    """Return the rate furthest from its coordinate's derivative, as means over output intervals.

    ``room`` (n - 1, 9) is the tolerance of the coordinates [m, rad].
    """
    time, q, qd = reported.time, coordinate_differences(reported, exact), reported.qd - exact.qd
    with np.errstate(over="ignore", invalid="ignore"):
        integral = _integrate_samples(time, qd, _SAMPLES)
        quadrature_error = sum(np.abs(integral - _integrate_samples(time, qd, fewer)) for fewer in (2, _SAMPLES - 2))
    rest = np.abs(_remove_turns(np.diff(q, axis=0) - integral))
    # Rates whose integrals overflow are the derivatives of no coordinates.
    overflowed = ~np.isfinite(quadrature_error + rest)
    quadrature_error, rest = np.where(overflowed, 0.0, quadrature_error), np.where(overflowed, np.inf, rest)
    round_off = 16 * _EPS * np.abs(reported.q).max(axis=0)
    interval = np.diff(time)[:, None]
    room = room * (1 + float(np.abs(reported.qd[:, YAW:]).max()) * interval)
    worst = find_worst(rest / interval, (room + round_off + quadrature_error) / interval)
    unit = "m/s" if worst[1] < 3 else "rad/s"
    return _describe_worst("qd", COORDINATES, unit, time[1:], worst)


def _integrate_samples(time: np.ndarray, values: np.ndarray, samples: int) -> np.ndarray:
    """Return the integrals (n - 1, k) between samples of the polynomials through the nearest ``samples`` samples."""
    integrals = np.empty((len(time) - 1, values.shape[1]))
    integrate_samples(np.ascontiguousarray(time), np.ascontiguousarray(values), samples, integrals)
    return integrals
