"""Measure a trajectory: errors against the reference, drift, slip and energy.

Poses, contact points, gaps, slip and energies are those that follow from its coordinates and rates. The engine's own
reports of them are compared with these, see `velodrome.reports.measure.consistency`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...engines.engine import Trajectory
from ...engines.releases import list_stated_adaptations
from ...reference.bicycle import Bicycle
from ...reference.fall import count_standing
from ...reference.inputs import NO_INPUTS, Inputs
from ...reference.kinematics import REAR_ANGLE, YAW
from ...reference.surface import Surface
from .balance import measure_work
from .consistency import evaluate_ride, find_mismatches, largest_speed
from .fall import fell_at, until_fall
from .friction import cone_is_left, divide_forces, separate_forces
from .limits import ROUND_OFF
from .quantities import QUANTITIES

SETTLED_SHARE = 0.2  # from here on contacts that start unsettled have settled, of any model here [s]


def compute_metrics(
    trajectory: Trajectory,
    reference: Trajectory | None,
    bicycle: Bicycle,
    surface: Surface,
    growth_rate: float,
    size: float,
    circular: bool,
    *,
    inputs: Inputs = NO_INPUTS,
    step_noise: float = ROUND_OFF,
    followed: Trajectory | None = None,
) -> dict[str, Any]:
    """Return the metrics of a trajectory, up to its fall if it falls.

    Parameters
    ----------
    trajectory : Trajectory
    reference : Trajectory or None
        The trajectory's reference, sampled at the same times (at least as long); None for the reference
        itself.
    bicycle : Bicycle
    surface : Surface
    growth_rate : float
        Largest real part of the motion's eigenvalues that symmetry does not fix [1/s].
    size : float
        Radius of the circle, or the wheelbase for a straight motion [m].
    circular : bool
        Whether the motion circles the z axis, so that radius and phase are defined.
    inputs : Inputs
        Those of the ride, whose work is no drift of the energy.
    step_noise : float
        Relative error that a step of the engine may add beyond its method.
    followed : Trajectory, optional
        The trajectory as returned by `velodrome.reports.measure.consistency.evaluate_ride`, if already computed.

    Returns
    -------
    dict
        The quantities of ``metrics.json`` as JSON values; None where an engine does not give what a
        quantity needs, or where the quantity is not defined.
    """
    reported = trajectory
    simulated = float(reported.time[-1] - reported.time[0])
    trajectory = evaluate_ride(reported, bicycle, surface) if followed is None else followed
    standing = count_standing(bicycle, surface, trajectory.q, trajectory.qd)
    fall = fell_at(trajectory, bicycle, surface, standing)
    trajectory = until_fall(trajectory, bicycle, surface, standing=standing)
    reported = reported.first(len(trajectory.time))
    reference = None if reference is None else until_fall(reference, bicycle, surface)
    result = _error_metrics(trajectory, reference)
    result |= _drift_metrics(trajectory, reference, circular)
    result |= _energy_metrics(trajectory, inputs)
    result |= _constraint_metrics(trajectory)
    result["adaptations"] = list_stated_adaptations(reported.settings)
    result["not_finite"] = reported.not_finite()
    found = find_mismatches(reported, trajectory, reference, size, step_noise)
    result["inconsistent_reports"] = [mismatch.as_json() for mismatch in found if not mismatch.holds]
    friction, least = _measure_forces(trajectory, trajectory if reference is None else reference, surface)
    result |= friction
    result |= {
        "steps": trajectory.steps,
        "unconverged_steps": trajectory.unconverged_steps,
        "largest_residual": trajectory.largest_residual,
        "cpu_time": trajectory.cpu_time,
        "real_time_factor": simulated / trajectory.cpu_time if trajectory.cpu_time > 0 else None,
        "min_normal_force": least,
        "fell_at": fall,
        "ended": None if trajectory.fall is not None else trajectory.ended,
    }
    result["horizon"] = None if reference is None else find_horizon(trajectory, reference, growth_rate, size)
    return {name: _replace_non_finite(value) for name, value in result.items()}


def flatten_metrics(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """Return metrics as columns: ``position_error`` becomes ``position_error_max`` and ``_end``, a list one text."""
    found: dict[str, Any] = {}
    for name, value in metrics.items():
        if isinstance(value, Mapping):
            found |= {f"{name}_{part}": number for part, number in value.items()}
        elif name in QUANTITIES and QUANTITIES[name].parts:
            found |= {f"{name}_{part}": None for part in QUANTITIES[name].parts}
        elif isinstance(value, list):
            found[name] = ", ".join(part if isinstance(part, str) else part["quantity"] for part in value) or None
        else:
            found[name] = value
    return found


def to_number(value: float) -> float | None:
    """Return a number as JSON can hold it: None if it is not finite."""
    return float(value) if np.isfinite(value) else None


def _replace_non_finite(value: Any) -> Any:
    """Replace numbers that are not finite, which JSON cannot hold, by None."""
    if isinstance(value, dict):
        return {name: _replace_non_finite(part) for name, part in value.items()}
    if isinstance(value, list):
        return [_replace_non_finite(part) for part in value]
    return to_number(value) if isinstance(value, float) else value


def position_errors(trajectory: Trajectory, reference: Trajectory) -> np.ndarray:
    """Return the distance of D from the reference's at each sample, shape (n,) [m]."""
    n = _common_samples(trajectory, reference)
    return np.linalg.norm(trajectory.q[:n, :3] - reference.q[:n, :3], axis=1)


def orientation_errors(trajectory: Trajectory, reference: Trajectory) -> np.ndarray:
    """Return the angle between the rear frames at each sample, shape (n,) [rad]."""
    n = _common_samples(trajectory, reference)
    a, b = trajectory.body_quaternion[:n, 0], reference.body_quaternion[:n, 0]
    # 2 asin(|a - +-b| / 2) resolves small angles; the arc cosine of a product does not.
    chord = np.minimum(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    return 4 * np.arcsin(np.minimum(chord / 2, 1.0))


def rate_error(trajectory: Trajectory, reference: Trajectory) -> float | None:
    """Return the largest difference of any of the nine rates from the reference's, relative to the motion's sizes.

    Rates of D are relative to the reference's largest speed, the others to its largest angular rate. None where the
    reference stands still.
    """
    n = _common_samples(trajectory, reference)
    sizes = np.array([largest_speed(reference)] * 3 + [float(np.abs(reference.qd[:, YAW:]).max())] * 6)
    moving = sizes > 0
    difference = np.abs(trajectory.qd[:n] - reference.qd[:n])[:, moving]
    return float((difference / sizes[moving]).max()) if moving.any() else None


def _measure_forces(
    trajectory: Trajectory, rolling: Trajectory, surface: Surface
) -> tuple[dict[str, float | None], float | None]:
    """Return the friction that rolling needs by the reference's forces, and when the engine first has too little.

    Also the least normal force [N], negative where the ground would have to pull, which no contact can do.
    """
    result: dict[str, float | None] = dict.fromkeys(("required_friction", "friction", "friction_left_at"))
    result["friction"] = trajectory.friction
    own = separate_forces(trajectory, surface)
    needed = own if rolling is trajectory else separate_forces(rolling, surface)
    if needed is not None:
        result["required_friction"] = float(divide_forces(*needed).max())
        if trajectory.friction is not None:
            result["friction_left_at"] = cone_is_left(trajectory.friction, rolling, surface)
    return result, None if own is None else float(own[0].min())


def find_horizon(trajectory: Trajectory, reference: Trajectory, growth_rate: float, size: float) -> float | None:
    """Return the time up to which the comparison is meaningful [s]; None where the motion amplifies no error.

    An error grows like e0 exp(growth_rate t), e0 = C h^p. e0 is taken as the largest value that the samples allow while
    the error is small relative to the motion. The horizon is the time at which this law reaches the motion's size.
    """
    if growth_rate <= 0:
        return None
    error = position_errors(trajectory, reference)
    time = trajectory.time[: len(error)]
    small = (error > 0) & (error < 1e-2 * size)
    if not small.any():
        # The error is large from the start, or there is no error at all.
        return 0.0 if error.max() > 0 else None
    seed = float(np.max(np.log(error[small]) - growth_rate * time[small]))
    law = max(0.0, float(np.log(size) - seed) / growth_rate)
    # Other causes may act faster than the law: an engine's own drift, a fall.
    beyond = np.flatnonzero(error >= size)
    return min(law, float(time[beyond[0]])) if len(beyond) else law


def _common_samples(trajectory: Trajectory, reference: Trajectory) -> int:
    n = min(len(trajectory.time), len(reference.time))
    if not np.array_equal(trajectory.time[:n], reference.time[:n]):
        raise ValueError(f"{trajectory.engine} and {reference.engine} are not sampled at the same times")
    return n


def _largest_and_last(values: np.ndarray) -> dict[str, float]:
    return {"max": float(values.max()), "end": float(values[-1])}


def _error_metrics(trajectory: Trajectory, reference: Trajectory | None) -> dict[str, Any]:
    names = ["position_error", "orientation_error", "rate_error", "rear_rate_error", "contact_force_error"]
    names += ["contact_force_error_at", "settled_force_error"]
    result: dict[str, Any] = dict.fromkeys(names)
    if reference is None:
        return result
    n = _common_samples(trajectory, reference)
    rate = np.abs(trajectory.qd[:n, REAR_ANGLE] - reference.qd[:n, REAR_ANGLE])
    result["position_error"] = _largest_and_last(position_errors(trajectory, reference))
    result["orientation_error"] = _largest_and_last(orientation_errors(trajectory, reference))
    result["rate_error"] = rate_error(trajectory, reference)
    result["rear_rate_error"] = float(rate.max())
    if trajectory.contact_force is not None and reference.contact_force is not None:
        difference = np.linalg.norm(trajectory.contact_force[:n] - reference.contact_force[:n], axis=2)
        # Relative to the largest force of the reference.
        largest = np.linalg.norm(reference.contact_force[:n], axis=2).max()
        result["contact_force_error"] = float(difference.max() / largest)
        # Contacts that start unsettled have their largest error in the first sample, which is not typical of the ride.
        if difference.max() > 0:
            result["contact_force_error_at"] = float(trajectory.time[difference.max(axis=1).argmax()])
        settled = trajectory.time[:n] >= SETTLED_SHARE
        if settled.any():
            result["settled_force_error"] = float(difference[settled].max() / largest)
    return result


def _slope(time: np.ndarray, values: np.ndarray) -> float:
    """Return the slope of the least-squares line, in the values' unit per second."""
    centred = time - time.mean()
    return float(centred @ (values - values.mean()) / (centred @ centred))


def _drift_metrics(trajectory: Trajectory, reference: Trajectory | None, circular: bool) -> dict[str, float | None]:
    """Return the rates at which radius, phase and rear-wheel rate drift from the reference's."""
    names = ("radius_drift_rate", "phase_drift_rate", "rear_rate_drift_rate")
    result: dict[str, float | None] = dict.fromkeys(names)
    if reference is None or _common_samples(trajectory, reference) < 2:
        return result
    n = _common_samples(trajectory, reference)
    time = trajectory.time[:n]
    result["rear_rate_drift_rate"] = _slope(time, trajectory.qd[:n, REAR_ANGLE] - reference.qd[:n, REAR_ANGLE])
    if circular:
        here, there = trajectory.q[:n, :2], reference.q[:n, :2]
        radius = np.hypot(here[:, 0], here[:, 1]) - np.hypot(there[:, 0], there[:, 1])
        phase = np.arctan2(here[:, 1], here[:, 0]) - np.arctan2(there[:, 1], there[:, 0])
        result["radius_drift_rate"] = _slope(time, radius)
        result["phase_drift_rate"] = _slope(time, np.unwrap(phase))
    return result


def _energy_metrics(trajectory: Trajectory, inputs: Inputs) -> dict[str, float | None]:
    """Return the changes of the energy less the work of the inputs, none smaller than the error of that work."""
    assert trajectory.kinetic_energy is not None
    assert trajectory.potential_energy is not None
    done = measure_work(trajectory, inputs)
    energy = trajectory.kinetic_energy + trajectory.potential_energy - done.work
    size = abs(energy[0])
    slope = _slope(trajectory.time, energy) if len(energy) > 1 else None
    if slope is not None and done.error > 0:
        # A disturbance within +-b over a duration T changes the slope of a least-squares line by at most 3 b / T.
        known = abs(slope) > 3 * done.error / float(trajectory.time[-1] - trajectory.time[0])
        slope = slope if known else None
    return {
        "energy_drift": max(float(np.abs(energy - energy[0]).max()), done.error) / size if size > 0 else None,
        "energy_drift_rate": slope,
        "energy_variation": 100 * max(float(np.ptp(energy)), done.error) / size if size > 0 else None,
    }


def _constraint_metrics(trajectory: Trajectory) -> dict[str, float]:
    assert trajectory.gap is not None
    assert trajectory.slip is not None
    speed = np.linalg.norm(trajectory.slip, axis=2)
    return {
        "max_gap": float(np.abs(trajectory.gap).max()),
        "max_slip": float(speed.max()),
        "mean_slip": float(speed.mean()),
    }
