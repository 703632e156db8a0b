"""The effect of MuJoCo's settings on a wheel that should roll: a table with one choice of settings in a row.

`settings_study` varies one setting at a time and measures creep, energy and the cost of a step; `drift_study`
simulates long rides and measures the drift of radius, energy and wheel rate with confidence intervals. Both only
compute; the laws behind them are measured in `laws`.
"""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import mujoco
import numpy as np
from scipy.stats import t as student

from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import Problem, Trajectory
from velodrome.engines.mujoco import default, exact_contact, multipliers, native
from velodrome.engines.mujoco.engine import MujocoEngine
from velodrome.engines.mujoco.ride import set_start
from velodrome.engines.mujoco.settings import ContactSettings, MultiplierSettings, StepSettings
from velodrome.reference.contact import observe
from velodrome.reference.kernels.contact import tangents
from velodrome.reference.kernels.dynamics import wheels
from velodrome.reference.kinematics import REAR_ANGLE, constants
from velodrome.reports.measure import contact_acceleration

LADDER: tuple[MujocoEngine[Any], ...] = (default.ENGINE, native.ENGINE, exact_contact.ENGINE, multipliers.ENGINE)
NEEDS = {exact_contact.ENGINE.name: 1, multipliers.ENGINE.name: 2}
# The slip of a contact settles at the rate b; after five time constants 1 % of the initial slip is left.
SETTLING = 5.0
CONFIDENCE = 0.95
_BLOCKS = 10
_REPEATS = 3

# (engine, settings that differ from its own defaults): what a user would try, beginning with MuJoCo's defaults.
CHOICES: tuple[tuple[MujocoEngine[Any], dict[str, Any]], ...] = (
    (default.ENGINE, {}),
    (default.ENGINE, {"friction": 2.0}),
    (default.ENGINE, {"friction": 2.0, "integrator": "RK4"}),
    (native.ENGINE, {"step": 0.002, "time_constant": 0.005, "impratio": 1.0}),
    (native.ENGINE, {"step": 0.002, "time_constant": 0.005}),
    (native.ENGINE, {"step": 0.002, "time_constant": 0.005, "impratio": 100.0}),
    (native.ENGINE, {"step": 0.002, "time_constant": 0.005, "cone": "pyramidal"}),
    (native.ENGINE, {"step": 0.002, "time_constant": 0.005, "noslip_iterations": 5}),
    (native.ENGINE, {"step": 0.002, "time_constant": 0.005, "impedance": (0.9, 0.99, 0.001, 0.5, 2.0)}),
    (native.ENGINE, {"step": 0.002, "time_constant": 0.005, "integrator": "RK4"}),
    (native.ENGINE, {"step": 0.002}),
    (native.ENGINE, {"step": 0.001}),
    (native.ENGINE, {"step": 0.001, "integrator": "RK4"}),
    (native.ENGINE, {"step": 0.0002}),
    (native.ENGINE, {"step": 0.00005}),
    (exact_contact.ENGINE, {"step": 0.001, "integrator": "implicitfast"}),
    (exact_contact.ENGINE, {"step": 0.002, "softness": 1.0}),
    (exact_contact.ENGINE, {"step": 0.002}),
    (multipliers.ENGINE, {"step": 0.002}),
)


@dataclass(frozen=True)
class Rate:
    """A drift rate.

    Attributes
    ----------
    value : float
        Mean slope, in the quantity's unit per second.
    half_width : float
        Half the width of the confidence interval of probability `CONFIDENCE`.
    """

    value: float
    half_width: float


@dataclass(frozen=True)
class Row:
    """Measurements of one choice of settings.

    Attributes
    ----------
    engine : str
    changed : dict
        Settings that differ from the engine's own.
    slip : float
        Mean slip of both wheels after settling [m/s].
    law : float or None
        Slip by the law, J' q' / b; None for a model without MuJoCo's contacts.
    energy_rate, radius_rate : Rate or None
        Drift of the total energy [W] and of the distance of D from the axis [m/s]; None where it fell at once.
    slip_power : float
        Mean power of the contact forces on the slipping wheels [W].
    step, step_cost : float
        Time step, and process CPU time of one step [s].
    ridden, asked : float
        Time ridden until a wheel had no ground left or the bicycle had left its circle, and requested time [s].
    needs : int
        What a user needs: 0 MuJoCo alone, 1 also the exact contacts, 2 also solved forces instead of contacts.
    """

    engine: str
    changed: dict[str, Any]
    slip: float
    law: float | None
    energy_rate: Rate | None
    radius_rate: Rate | None
    slip_power: float
    step: float
    step_cost: float
    ridden: float
    asked: float
    needs: int


@dataclass(frozen=True)
class DriftRow:
    """Drifts of a long ride from the circle it started on, per second."""

    engine: str
    settings: dict[str, Any]
    radius: Rate  # [m/s]
    energy: Rate  # [W]
    rear_rate: Rate  # [rad/s^2]
    slip: float  # mean [m/s]
    ridden: float  # [s]
    ended: str | None


def drift_rate(time: np.ndarray, values: np.ndarray, blocks: int = _BLOCKS) -> Rate:
    """Compute the slope of a series with its confidence interval.

    The slopes of equal parts are taken as independent measurements, so oscillations and changes of the
    drift itself contribute to the uncertainty; a line fitted to all samples would ignore them.

    Parameters
    ----------
    time, values : ndarray, shape (n,)
        At least three samples per block.
    blocks : int
    """
    slopes = [
        np.polynomial.Polynomial.fit(t, v, 1).convert().coef[1]
        for t, v in zip(np.array_split(time, blocks), np.array_split(values, blocks), strict=True)
    ]
    spread = np.std(slopes, ddof=1) / np.sqrt(blocks)
    return Rate(float(np.mean(slopes)), float(student.ppf((1 + CONFIDENCE) / 2, blocks - 1) * spread))


def slip_power(problem: Problem, trajectory: Trajectory) -> np.ndarray:
    """Compute the power of the contact forces on the slipping wheels for each sample, shape (n,) [W]."""
    seen = observe(problem.bicycle, problem.surface, trajectory.q, trajectory.qd)
    power, c = np.zeros(len(trajectory.time)), constants(problem.bicycle)
    assert trajectory.contact_force is not None
    for n, q in enumerate(trajectory.q):
        for k, wheel in enumerate(wheels(q, c)):
            directions = np.array(tangents(wheel[2], tuple(seen.normal[n, k])))
            power[n] += (directions @ trajectory.contact_force[n, k]) @ seen.slip[n, k]
    return power


def plain_step_cost(problem: Problem, integrator: str, step: float = 0.002, steps: int = 5000) -> float:
    """Measure the process CPU time of MuJoCo's own step of the same tree, without ground and callbacks [s]."""
    settings = MultiplierSettings.model_validate({"integrator": integrator, "step": step})
    model, data = set_start(problem, settings, "nothing")
    mujoco.mj_step(model, data, 100)
    start = process_time()
    mujoco.mj_step(model, data, steps)
    return (process_time() - start) / steps


def _ignore_progress(_: float) -> None:
    pass


def is_settled(trajectory: Trajectory, settings: StepSettings) -> np.ndarray:
    """Return which samples come after the contacts' own transient, shape (n,)."""
    rate = settings.damping if isinstance(settings, ContactSettings) else 2 * getattr(settings, "stabilisation", 20.0)
    return trajectory.time > SETTLING / rate


def _cut_to_circle(trajectory: Trajectory) -> Trajectory:
    """Return the part before the bicycle is half a radius off its circle, or its lean has changed by 0.5 rad."""
    radius = np.hypot(trajectory.q[:, 0], trajectory.q[:, 1])
    off = (np.abs(radius - radius[0]) > 0.5 * radius[0]) | (np.abs(trajectory.q[:, 4] - trajectory.q[0, 4]) > 0.5)
    return trajectory.first(int(np.argmax(off))) if off.any() else trajectory


def _time_rides(engine: MujocoEngine[Any], problem: Problem, settings: StepSettings) -> tuple[Trajectory, float]:
    """Return the ride and the smallest CPU time of a step [s] over `_REPEATS` rides; other load only adds to it."""
    rides = [ride_engine(engine, problem, settings, _ignore_progress) for _ in range(_REPEATS)]
    return rides[0], min(ride.cpu_time / ride.steps for ride in rides)


def ride_row(engine: MujocoEngine[Any], changed: dict[str, Any], problem: Problem) -> Row:
    """Simulate one choice of settings on a circular motion and measure it.

    Raises
    ------
    EngineError
        If there is no settled sample.
    """
    settings = engine.settings(**changed)
    whole, step_cost = _time_rides(engine, problem, settings)
    part = _cut_to_circle(whole)
    settled = is_settled(part, settings)
    seen = observe(problem.bicycle, problem.surface, part.q, part.qd)
    sizes = np.linalg.norm(seen.slip, axis=2)
    # A ride that falls before it settles is measured in its second half.
    chosen = settled if settled.sum() > 1 else part.time >= part.time[-1] / 2
    law = None
    if isinstance(settings, ContactSettings) and engine is not exact_contact.ENGINE:
        acceleration = contact_acceleration(problem.bicycle, problem.surface, part.q[chosen], part.qd[chosen])
        law = float(np.linalg.norm(acceleration, axis=2).mean() / settings.damping)
    long_enough = chosen.sum() >= 3 * _BLOCKS
    assert part.kinetic_energy is not None
    assert part.potential_energy is not None
    energy, time = (part.kinetic_energy + part.potential_energy)[chosen], part.time[chosen]
    radius = np.hypot(part.q[chosen, 0], part.q[chosen, 1])
    return Row(
        engine=engine.name,
        changed=changed,
        slip=float(sizes[chosen].mean()),
        law=law,
        energy_rate=drift_rate(time, energy) if long_enough else None,
        radius_rate=drift_rate(time, radius) if long_enough else None,
        slip_power=float(slip_power(problem, part)[chosen].mean()),
        step=settings.step,
        step_cost=step_cost,
        ridden=float(part.time[-1]),
        asked=float(problem.times[-1]),
        needs=NEEDS.get(engine.name, 0),
    )


def settings_study(
    problem: Problem,
    choices: Iterable[tuple[MujocoEngine[Any], dict[str, Any]]] = CHOICES,
    progress: Callable[[str], None] = lambda _: None,
) -> list[Row]:
    """Simulate a circular motion with each choice of settings.

    Parameters
    ----------
    problem : Problem
        Starts on the motion; two seconds, sampled every 10 ms, are enough.
    choices : iterable of (MujocoEngine, dict)
    progress : callable
        Called with the name of each engine before it runs.

    Returns
    -------
    list of Row
    """
    rows = []
    for engine, changed in choices:
        progress(engine.name)
        rows.append(ride_row(engine, changed, problem))
    return rows


def drift_row(engine: MujocoEngine[Any], changed: dict[str, Any], problem: Problem) -> DriftRow:
    """Simulate a circular motion for long and measure drifts while it is still on its circle."""
    settings = engine.settings(**changed)
    whole = ride_engine(engine, problem, settings, _ignore_progress)
    part = _cut_to_circle(whole)
    chosen = is_settled(part, settings)
    if chosen.sum() < 3 * _BLOCKS:
        chosen = np.ones(len(part.time), bool)
    assert part.kinetic_energy is not None
    assert part.potential_energy is not None
    time, energy = part.time[chosen], (part.kinetic_energy + part.potential_energy)[chosen]
    seen = observe(problem.bicycle, problem.surface, part.q[chosen], part.qd[chosen])
    return DriftRow(
        engine=engine.name,
        settings=whole.settings,
        radius=drift_rate(time, np.hypot(part.q[chosen, 0], part.q[chosen, 1])),
        energy=drift_rate(time, energy),
        rear_rate=drift_rate(time, part.qd[chosen, REAR_ANGLE]),
        slip=float(np.linalg.norm(seen.slip, axis=2).mean()),
        ridden=float(part.time[-1]),
        ended=whole.ended,
    )


def drift_study(
    problem: Problem, engines: Sequence[MujocoEngine[Any]] = LADDER, progress: Callable[[str], None] = lambda _: None
) -> list[DriftRow]:
    """Simulate a circular motion with every model of the ladder at its own settings.

    Parameters
    ----------
    problem : Problem
        Its times give the duration.
    engines : sequence of MujocoEngine
    progress : callable
        Called with the name of each engine before it runs.
    """
    rows = []
    for engine in engines:
        progress(engine.name)
        rows.append(drift_row(engine, {}, problem))
    return rows
