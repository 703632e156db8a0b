"""What one engine measures on one gated scenario, and by how much each quantity may move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np

from engines.admission import ride
from engines.convergence import observed_orders
from engines.engine import Engine, EngineError, Problem, Settings
from engines.identify import DISTURBANCES, STENCIL_WEIGHT, interval_of, jacobian_at
from engines.steady import steady_trajectory
from reference.kinematics import REAR_ANGLE, YAW
from reference.stability import growth_rate, linearise, sorted_eigenvalues
from reports.drift import quantities
from reports.fall import fell_at, until_fall
from reports.limits import Scale, eigenvalue_limits, noise, order_limit, ride_limits
from reports.metrics import position_errors
from reports.precision import match

from .runner import measure_one
from .start import Start

SHORT_HORIZON = 1.0  # of the first error and of the order [s]
# Of the order: coarser steps than the settings' own, whose errors stand further above noise, and an interval that
# four steps of common sizes divide [s].
FACTORS = (4.0, 2.0, 1.0)
ORDER_INTERVAL = 0.2


@dataclass(frozen=True)
class Sample:
    """One engine on one gated scenario.

    Attributes
    ----------
    values, limits : dict
        By quantity; None where the engine does not give it, or no figure could be told from noise.
    steps : int
        Of the ride.
    version : str
    settings : dict
        JSON values.
    """

    values: dict[str, float | None]
    limits: dict[str, float | None]
    steps: int
    version: str
    settings: dict[str, Any]


def sample(start: Start, engine: Engine, settings: Settings, watch: Callable[[float], None]) -> Sample:
    """Run an engine on a circular motion and measure it against the exact one.

    An engine that falls is measured up to its fall; it has no order and no eigenvalues.

    Parameters
    ----------
    start : Start
    engine : Engine
    settings : Settings
    watch : callable
        Called with the simulated time reached in the ride.

    Raises
    ------
    UnsuitableProblem
        If the engine is not made for such a motion.
    EngineError, ValueError
        If the engine does not run, or neither falls nor comes to the end.
    """
    problem, motion = start.problem, start.motion
    if motion is None:
        raise ValueError("only a circular motion can be gated: its exact solution is known")
    engine.check(problem, settings)
    trajectory = ride(engine, problem, settings, watch)
    fall = fell_at(trajectory, problem.bicycle, problem.surface)
    if trajectory.ended is not None and fall is None:
        raise EngineError(trajectory.ended)
    scale, steps, whole = _scale(start), trajectory.steps, float(trajectory.time[-1])
    exact = steady_trajectory(problem.bicycle, motion, problem.times)
    measured = measure_one(start, trajectory, exact)
    standing = until_fall(trajectory, problem.bicycle, problem.surface)
    scale = replace(scale, duration=float(standing.time[-1]))
    errors = position_errors(standing, exact)
    short = float(errors[min(int(np.searchsorted(problem.times, SHORT_HORIZON)), len(errors) - 1)])
    # As many as the part that is measured took.
    values = quantities(measured | {"steps": steps * scale.duration / whole}, short)
    limits: dict[str, float | None] = dict(
        ride_limits(scale, noise(scale, engine.step_noise(settings), steps, fall is not None))
    )
    if fall is None:
        for part in (_order(start, engine, settings), _eigenvalues(start, engine, settings, steps / scale.duration)):
            values |= {name: value for name, (value, _) in part.items()}
            limits |= {name: limit for name, (_, limit) in part.items()}
    values = {name: value if value is not None and np.isfinite(value) else None for name, value in values.items()}
    return Sample(values, limits, steps, engine.version, settings.model_dump(mode="json"))


def _scale(start: Start) -> Scale:
    problem = start.problem
    qd = problem.qd
    return Scale(
        radius=start.size,
        speed=float(np.hypot(qd[0], qd[1])),
        rear_rate=float(abs(qd[REAR_ANGLE])),
        growth_rate=start.growth_rate,
        duration=float(problem.times[-1]),
        gravity=problem.bicycle.gravity,
        height=problem.bicycle.rear_frame_z,
    )


Found = dict[str, tuple[float | None, float | None]]


def _order(start: Start, engine: Engine, settings: Settings) -> Found:
    """Order of convergence over the short horizon, with its limit."""
    short = replace(start.problem, times=ORDER_INTERVAL * np.arange(round(SHORT_HORIZON / ORDER_INTERVAL) + 1))
    try:
        ladder = [settings.refined(factor) for factor in FACTORS]
        rides = [ride(engine, short, refined, lambda _: None) for refined in ladder]
    except ValueError:  # settings without a step, or of a step at the end of its range or beside the interval
        return {"observed_order": (None, None)}
    samples = min(len(one.time) for one in rides)
    paths = [one.q[:samples, :3] for one in rides]
    first, second = (float(np.abs(b - a).max()) for a, b in pairwise(paths))
    scale = replace(_scale(start), duration=float(short.times[-1]))
    # The finest ride has the most steps.
    error = scale.radius * noise(scale, engine.step_noise(settings), rides[-1].steps)
    limit = order_limit(error, (first, second))
    return {"observed_order": (None if limit is None else observed_orders(paths)[-1], limit)}


def _eigenvalues(start: Start, engine: Engine, settings: Settings, rate: float) -> Found:
    """How far the engine's own eigenvalues are from the reference's, at ``rate`` steps a second.

    Those that decay within the interval of the flow from which they are measured are left out: little is left of
    them.
    """
    problem = start.problem
    motion = Problem(problem.bicycle, problem.surface, *start.undisturbed, problem.times)
    interval = interval_of(settings)
    jacobian = jacobian_at(engine, settings, motion, interval)
    exact = linearise(problem.bicycle, problem.surface, *start.undisturbed)
    scale = replace(_scale(start), duration=1.5 * interval)
    error = noise(scale, engine.step_noise(settings), ceil(rate * scale.duration))
    allowed = eigenvalue_limits(exact.jacobian, scale, error, DISTURBANCES, STENCIL_WEIGHT, interval)
    found = match(exact.eigenvalues, sorted_eigenvalues(jacobian))
    slow = np.real(exact.eigenvalues) > -1 / interval
    yaw_rate = float(start.undisturbed[1][YAW])
    growth = [growth_rate(problem.surface, values, yaw_rate) for values in (found, exact.eigenvalues)]
    limit = float(allowed[slow].max())
    return {
        "eigenvalue_error": (float(np.abs(found - exact.eigenvalues)[slow].max()), limit),
        "growth_rate_error": (growth[0] - growth[1], limit),
    }
