"""What one engine measures on one gated scenario, and by how much each quantity may move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import REFERENCE, Engine, EngineError, Problem, Settings, Trajectory, load_engine, why_failed
from ...reference.kinematics import YAW
from ...reference.stability import growth_rate, linearise, sorted_eigenvalues
from ...reference.surface import Surface
from ...reports.measure import (
    DISTURBANCES,
    LARGEST_NOISE,
    SAME_BITS,
    STENCIL_WEIGHT,
    Mismatch,
    Scale,
    describe_mismatch,
    eigenvalue_limits,
    eigenvalue_pairs,
    evaluate_ride,
    fell_at,
    find_mismatches,
    interval_of,
    jacobian_at,
    noise,
    observed_orders,
    order_limit,
    position_errors,
    required_friction,
    ride_limits,
    rms_force_error,
    state_error,
    step_force,
    until_fall,
)
from ..run import measure_one
from ..scenario import Gate, Start
from .exact import Exact, scale_of
from .verdict import BELOW_NOISE, HELD_CPU, RIDE_QUANTITIES, SHOWN

FoundEigenvalues = dict[str, tuple[float | None, float | None]]  # value and limit by quantity
Measured = tuple[FoundEigenvalues, dict[str, str]]  # and why there is no value

EIGENVALUE_QUANTITIES = ("eigenvalue_error", "growth_rate_error")
SHORT_HORIZON = 1.0  # of the first error and of the order [s]
# Of the order: coarser steps than the settings' own, whose errors stand further above noise, and an interval that
# four steps of common sizes divide [s].
FACTORS = (4.0, 2.0, 1.0)
ORDER_INTERVAL = 0.2
# Rides of an engine and of the reference in turn, where CPU time is held, and what the median of their ratios may
# grow by: of 29 engines and scenarios the medians of six runs lay within a factor of 1.7, with four jobs a core beside
# them.
_CPU_PAIRS = 7
CPU_FACTOR = 2.0


@dataclass(frozen=True)
class Sample:
    """One engine on one gated scenario.

    Attributes
    ----------
    values, limits : dict
        By quantity; None where the engine does not give it, or no figure could be told from noise.
    reasons : dict
        Why there is no figure, by quantity.
    steps : int
        Of the ride.
    step_noise : float
        As the engine has it with these settings.
    version : str
    settings : dict
        JSON values.
    """

    values: dict[str, float | None]
    limits: dict[str, float | None]
    reasons: dict[str, str]
    steps: int
    step_noise: float
    version: str
    settings: dict[str, Any]


def take_sample(
    start: Start,
    exact: Exact,
    gate: Gate,
    engine: Engine,
    settings: Settings,
    watch: Callable[[float], None],
    known_noise: float | None = None,
    hold_cpu: bool = False,
) -> Sample:
    """Run an engine on a gated scenario and measure it against the exact ride.

    Contacts, poses and energies are those that follow from its coordinates; what it reports of them must agree. An
    engine that falls is measured up to its fall; it has no order and no eigenvalues.

    Parameters
    ----------
    start : Start
    exact : Exact
        Of this start, by `velodrome.scenarios.gate.exact.find_exact`.
    gate : Gate
        What to measure beside the ride.
    engine : Engine
    settings : Settings
    watch : callable
        Called with the simulated time reached in the ride.
    known_noise : float, optional
        The step noise of the baseline: an engine that has become noisier has no more room for it.
    hold_cpu : bool
        Whether to measure CPU time so well that it can be judged, which takes some rides more.

    Raises
    ------
    UnsuitableProblem
        If the engine is not made for such a motion.
    EngineError, ValueError
        If the engine does not run, neither falls nor comes to the end, gives what is not finite, has steps that did
        not converge, or returns the reference's own trajectory.
    """
    problem = start.problem
    engine.check(problem, settings)
    own_noise = engine.step_noise(settings)
    if not 0 <= own_noise <= LARGEST_NOISE:
        raise EngineError(f"its step_noise is {own_noise!r}; it must be from 0 to {LARGEST_NOISE:g}")
    step_noise = own_noise if known_noise is None else min(own_noise, known_noise)
    trajectory = ride_engine(engine, problem, settings, watch)
    followed = evaluate_ride(trajectory, problem.bicycle, problem.surface)
    fall = fell_at(followed, problem.bicycle, problem.surface)
    if trajectory.ended is not None and fall is None:
        raise EngineError(trajectory.ended)
    if trajectory.unconverged_steps:
        raise EngineError(
            f"its iterations did not converge in {trajectory.unconverged_steps} of {trajectory.steps} steps"
        )
    standing = until_fall(followed, problem.bicycle, problem.surface)
    reported = trajectory.first(len(standing.time))
    if reported.not_finite():
        raise EngineError(f"not finite in some samples: {', '.join(reported.not_finite())}")
    scale = replace(scale_of(start), duration=float(standing.time[-1]))
    if engine.name != REFERENCE and exact.is_copied_by(standing, scale):
        raise EngineError("it returned the reference's own trajectory")
    # As many steps as the part that is measured took.
    steps = trajectory.steps * scale.duration / float(trajectory.time[-1])
    reports = find_mismatches(reported, standing, exact.trajectory, start.size, step_noise)
    values = _ride_values(start, reported, standing, exact.trajectory, scale) | {
        "report_mismatch": max(report.share for report in reports),
        "fell_at": fall,
        "steps": steps,
        "cpu_ratio": _ratio(trajectory.cpu_time, exact.cpu_time),
    }
    left = exact.error + noise(scale, step_noise, trajectory.steps, fall is not None)
    force = step_force(scale, step_noise, scale.duration / steps) if steps > 0 else 0.0
    limits: dict[str, float | None] = dict(ride_limits(scale, left, force, exact.borders))
    if hold_cpu:
        cost = _cpu_ratio(engine, problem, settings)
        values[HELD_CPU] = cost
        limits[HELD_CPU] = None if cost is None else (1 - 1 / CPU_FACTOR) * cost
    reasons = _disagreement(reports)
    further: list[Measured] = []
    if fall is None and gate.order:
        further.append(_measured(("observed_order",), lambda: _order(start, engine, settings, step_noise)))
    if fall is None and gate.eigenvalues and start.motion is not None:
        rate = trajectory.steps / scale.duration
        further.append(
            _measured(EIGENVALUE_QUANTITIES, lambda: (_eigenvalues(start, engine, settings, rate, step_noise), {}))
        )
    for part, why in further:
        values |= {name: value for name, (value, _) in part.items()}
        limits |= {name: limit for name, (_, limit) in part.items()}
        reasons |= why
    values = {name: value if value is not None and np.isfinite(value) else None for name, value in values.items()}
    shown = settings.model_dump(mode="json")
    return Sample(values, limits, reasons, trajectory.steps, own_noise, engine.version, shown)


def _disagreement(reports: Sequence[Mismatch]) -> dict[str, str]:
    """Why the reports of an engine do not agree with its coordinates; none where they do."""
    lines = [describe_mismatch(report.as_json()) for report in reports if not report.holds]
    return {"report_mismatch": "; ".join(lines)} if lines else {}


def _measured(names: Sequence[str], measure: Callable[[], Measured]) -> Measured:
    """What a further measurement finds; an engine that breaks in it has no such figures, but keeps its ride's."""
    try:
        return measure()
    except Exception as error:  # an engine that rode may still break at other steps or from other starts
        return dict.fromkeys(names, (None, None)), dict.fromkeys(names, why_failed(error))


def _ride_values(
    start: Start, reported: Trajectory, standing: Trajectory, exact: Trajectory, scale: Scale
) -> dict[str, float | None]:
    """Quantities of the part of a ride that is standing, as reported and as it follows from its coordinates."""
    measured = measure_one(start, reported, exact, followed=standing)
    errors = position_errors(standing, exact)
    found = measured | {
        "short_error": float(errors[min(int(np.searchsorted(exact.time, SHORT_HORIZON)), len(errors) - 1)]),
        "position_error": measured["position_error"]["max"],
        "state_error": state_error(standing, exact, scale),
        "rms_force_error": rms_force_error(standing, exact),
        "required_friction": _required_friction(standing, start.problem.surface),
    }
    return {name: found[name] for name in (*RIDE_QUANTITIES, *SHOWN) if name in found}


def _required_friction(standing: Trajectory, surface: Surface) -> float | None:
    """Coefficient of friction that an engine's own contact forces need; None where it gives none."""
    return None if standing.contact_force is None else float(required_friction(standing, surface).max())


def _cpu_ratio(engine: Engine, problem: Problem, settings: Settings) -> float | None:
    """CPU time relative to the reference's: the median of several pairs of rides in turn."""
    reference = load_engine(REFERENCE)
    pairs = []
    for _ in range(_CPU_PAIRS):
        ours = ride_engine(reference, problem, reference.settings(), lambda _: None).cpu_time
        pairs.append(_ratio(ride_engine(engine, problem, settings, lambda _: None).cpu_time, ours))
    ratios = [ratio for ratio in pairs if ratio is not None]
    return float(np.median(ratios)) if ratios else None


def _ratio(time: float, reference: float) -> float | None:
    return time / reference if reference > 0 else None


def _order(start: Start, engine: Engine, settings: Settings, step_noise: float) -> Measured:
    """Order of convergence over the short horizon with its limit, or why there is none."""
    short = replace(start.problem, times=ORDER_INTERVAL * np.arange(round(SHORT_HORIZON / ORDER_INTERVAL) + 1))
    none: FoundEigenvalues = {"observed_order": (None, None)}
    try:
        ladder = [settings.refined(factor) for factor in FACTORS]
        rides = [ride_engine(engine, short, refined, lambda _: None) for refined in ladder]
    except ValueError as error:  # settings without a step, or of a step at the end of its range or beside the interval
        return none, {"observed_order": " ".join(str(error).split())}
    for one, factor in zip(rides, FACTORS, strict=True):
        if one.ended is not None:
            return none, {"observed_order": f"with {factor:g} times its step it ended: {one.ended}"}
    if any(np.array_equal(one.q, other.q) for one, other in pairwise(rides)):
        return none, {"observed_order": SAME_BITS}
    samples = min(len(one.time) for one in rides)
    paths = [one.q[:samples, :3] for one in rides]
    first, second = (float(np.abs(b - a).max()) for a, b in pairwise(paths))
    scale = replace(scale_of(start), duration=float(short.times[-1]))
    # The finest ride has the most steps.
    round_off = scale.radius * noise(scale, step_noise, rides[-1].steps)
    limit = order_limit(round_off, (first, second))
    if limit is None:
        return none, {"observed_order": BELOW_NOISE}
    return {"observed_order": (observed_orders(paths)[-1], limit)}, {}


def _eigenvalues(start: Start, engine: Engine, settings: Settings, rate: float, step_noise: float) -> FoundEigenvalues:
    """How far the engine's own eigenvalues are from the reference's, at ``rate`` steps a second.

    Those that decay within the interval of the flow from which they are measured are left out: little is left of
    them.
    """
    problem = start.problem
    motion = Problem(problem.bicycle, problem.surface, *start.undisturbed, problem.times)
    interval = interval_of(settings)
    jacobian = jacobian_at(engine, settings, motion, interval)
    exact = linearise(problem.bicycle, problem.surface, *start.undisturbed)
    scale = replace(scale_of(start), duration=1.5 * interval)
    error = noise(scale, step_noise, ceil(rate * scale.duration))
    allowed = eigenvalue_limits(exact.jacobian, scale, error, DISTURBANCES, STENCIL_WEIGHT, interval)
    found = eigenvalue_pairs(exact.eigenvalues, sorted_eigenvalues(jacobian))
    slow = np.real(exact.eigenvalues) > -1 / interval
    yaw_rate = float(start.undisturbed[1][YAW])
    growth = [growth_rate(problem.surface, values, yaw_rate) for values in (found, exact.eigenvalues)]
    limit = float(allowed[slow].max())
    return {
        "eigenvalue_error": (float(np.abs(found - exact.eigenvalues)[slow].max()), limit),
        "growth_rate_error": (growth[0] - growth[1], limit),
    }
