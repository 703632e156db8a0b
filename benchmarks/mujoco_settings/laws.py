"""Measurements of two laws behind MuJoCo's settings: creep over the contacts' rate, energy over the step."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np

from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import EngineError, Problem
from velodrome.engines.mujoco import exact_contact, native
from velodrome.engines.mujoco.ride import set_start
from velodrome.engines.mujoco.settings import ExactContactSettings, NativeSettings, TreeIntegrator
from velodrome.reference.kinematics import WHEELS
from velodrome.reports.measure import contact_acceleration

from .creep import settled_slip
from .study import drift_rate, is_settled, slip_power

INTEGRATORS: tuple[TreeIntegrator, ...] = get_args(TreeIntegrator)
Pair = tuple[float, float]


@dataclass(frozen=True)
class CreepRow:
    """The law of creep at one setting; in pairs the rear wheel comes first.

    Attributes
    ----------
    damping : float
        b [1/s].
    time_constant, step : float
        Time constant of the contacts, and step of the integration [s].
    impratio : float
    speed, radius : float
        Speed and circle of D [m/s, m].
    slip, law, whole_law : tuple of float
        Mean magnitude of the slip: measured, J' q' / b, and with softness and sinking [m/s].
    worst, whole_worst : tuple of float
        Largest relative deviation of a sample from J' q' / b and from the whole law.
    """

    damping: float
    time_constant: float
    step: float
    impratio: float
    speed: float
    radius: float
    slip: Pair
    law: Pair
    whole_law: Pair
    worst: Pair
    whole_worst: Pair


@dataclass(frozen=True)
class EnergyRow:
    """The energy that an integrator adds to wheels that hardly slip.

    Attributes
    ----------
    integrator : str
    step : float
        [s].
    gain : float
        Rate of the total energy minus the power of the contact forces on the remaining slip [W].
    """

    integrator: str
    step: float
    gain: float


def creep_row(problem: Problem, settings: NativeSettings) -> CreepRow:
    """Compare the slip of the native model with its law on a circular motion.

    Raises
    ------
    EngineError
        If the bicycle fell before its contacts had settled.
    """
    trajectory = ride_engine(native.ENGINE, problem, settings, lambda _: None)
    settled = is_settled(trajectory, settings)
    if trajectory.slip is None or not settled.any():
        raise EngineError(f"the wheels did not settle within {trajectory.time[-1]:g} s")
    model, _ = set_start(problem, settings, "planes")
    rear, front = (float(model.body(f"{wheel}_wheel").invweight0[0]) for wheel in WHEELS)
    missing = contact_acceleration(problem.bicycle, problem.surface, trajectory.q, trajectory.qd)
    both = missing / settings.damping, settled_slip(problem, trajectory, settings, (rear, front))
    slip, law, whole = (np.linalg.norm(part[settled], axis=2) for part in (trajectory.slip, *both))
    return CreepRow(
        damping=settings.damping,
        time_constant=settings.contact_time,
        step=settings.step,
        impratio=settings.impratio,
        speed=float(np.hypot(*problem.qd[:2])),
        radius=float(np.hypot(*problem.q[:2])),
        slip=_as_pair(slip.mean(axis=0)),
        law=_as_pair(law.mean(axis=0)),
        whole_law=_as_pair(whole.mean(axis=0)),
        worst=_as_pair(np.abs(slip / law - 1).max(axis=0)),
        whole_worst=_as_pair(np.abs(slip / whole - 1).max(axis=0)),
    )


def _as_pair(values: np.ndarray) -> Pair:
    return float(values[0]), float(values[1])


def creep_study(
    problems: Sequence[Problem],
    time_constants: Sequence[float],
    interval: float = 0.01,
    impratio: float = 100.0,
    shares: Sequence[int] = (2, 4),
) -> list[CreepRow]:
    """Compare the slip with the law of creep over time constants, on several motions.

    Parameters
    ----------
    problems : sequence of Problem
        Circular motions, sampled every ``interval``.
    time_constants : sequence of float
        Time constants of the contacts (solref) [s].
    interval : float
        Each step divides it [s].
    impratio : float
    shares : sequence of int
        Numbers of steps in a time constant, at least 2; no step exceeds 4 ms divided by them.
    """
    rows = []
    for problem in problems:
        for time_constant in time_constants:
            for share in shares:
                count = int(np.ceil(interval / min(time_constant, 0.004) * share * (1 - 1e-9)))
                settings = NativeSettings(step=interval / count, time_constant=time_constant, impratio=impratio)
                rows.append(creep_row(problem, settings))
    return rows


def energy_row(problem: Problem, integrator: TreeIntegrator, step: float) -> EnergyRow:
    """Measure the energy that an integrator adds on a circular motion, with exact contacts."""
    settings = ExactContactSettings(integrator=integrator, step=step)
    trajectory = ride_engine(exact_contact.ENGINE, problem, settings, lambda _: None)
    settled = is_settled(trajectory, settings)
    assert trajectory.kinetic_energy is not None
    assert trajectory.potential_energy is not None
    energy = trajectory.kinetic_energy + trajectory.potential_energy
    rate = drift_rate(trajectory.time[settled], energy[settled]).value
    return EnergyRow(integrator, step, rate - float(slip_power(problem, trajectory)[settled].mean()))


def energy_study(
    problem: Problem, steps: Sequence[float], integrators: Sequence[TreeIntegrator] = INTEGRATORS
) -> list[EnergyRow]:
    """Measure the energy that integrators add, over steps that divide the problem's interval."""
    return [energy_row(problem, integrator, step) for integrator in integrators for step in steps]
