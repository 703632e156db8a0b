"""Measure one engine on one gated scenario, with the limits by which each quantity may move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import REFERENCE, Engine, EngineError, Problem, Settings, Trajectory, why_failed
from ...engines.registry import load_engine
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
Measured = tuple[FoundEigenvalues, dict[str, str]]  # with the reasons for missing values, by quantity

EIGENVALUE_QUANTITIES = ("eigenvalue_error", "growth_rate_error")
SHORT_HORIZON = 1.0  # duration over which the first error and the order are measured [s]
# Factors on the settings' own step for the order: the errors of coarser steps are further above noise.
FACTORS = (4.0, 2.0, 1.0)
ORDER_INTERVAL = 0.2  # output interval for the order, which four steps of common sizes divide [s]
# Number of pairs of rides, of the engine and the reference in turn, where CPU time is judged; and the factor by which
# the median of their ratios may grow. In 29 pairs of engine and scenario the medians of six runs lay within a factor of
# 1.7, with four jobs per core running beside them.
_CPU_PAIRS = 7
CPU_FACTOR = 2.0


@dataclass(frozen=True)
class Sample:
    """Measurements of one engine on one gated scenario.

    Attributes
    ----------
    values, limits : dict
        By quantity; None where the engine does not give it, or where it cannot be told from noise.
    reasons : dict
        Why a value is missing, by quantity.
    steps : int
        Steps of the ride.
    step_noise : float
        The engine's own, with these settings.
    version : str
    settings : dict
        JSON values.
    trajectory : Trajectory
        The ride, as the engine gave it.
    """

    values: dict[str, float | None]
    limits: dict[str, float | None]
    reasons: dict[str, str]
    steps: int
    step_noise: float
    version: str
    settings: dict[str, Any]
    trajectory: Trajectory


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

    Contacts, poses and energies are those that follow from its coordinates; its reports of them must agree with
    these. An engine that falls is measured up to its fall, and has no order and no eigenvalues.

    Parameters
    ----------
    start : Start
    exact : Exact
        Exact ride from this start, by `velodrome.scenarios.gate.exact.find_exact`.
    gate : Gate
        What to measure in addition to the ride.
    engine : Engine
    settings : Settings
    watch : callable
        Called with the simulated time reached in the ride.
    known_noise : float, optional
        Step noise of the baseline; an engine that claims more gets no wider limits for it.
    hold_cpu : bool
        Whether to measure CPU time precisely enough to be judged, which takes some more rides.

    Raises
    ------
    UnsuitableProblem
        If the motion does not suit the engine.
    EngineError, ValueError
        If the engine does not run, neither falls nor reaches the end, gives values that are not finite, has steps that
        did not converge, or returns the reference's own trajectory.
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
    if engine.name != REFERENCE and exact.is_copied_by(standing):
        raise EngineError("it returned the reference's own trajectory")
    # Number of steps in the measured part of the ride, which a fall ends after the last sample.
    end = trajectory.time[-1] if trajectory.fall is None else trajectory.fall.time[1]
    steps = trajectory.steps * scale.duration / float(end)
    reports = find_mismatches(reported, standing, exact.trajectory, start.size, step_noise)
    values = _measure_ride(start, reported, standing, exact.trajectory, scale) | {
        "report_mismatch": max(report.share for report in reports),
        "fell_at": fall,
        "steps": steps,
        "cpu_ratio": _ratio(trajectory.cpu_time, exact.cpu_time),
    }
    error = exact.error + noise(scale, step_noise, trajectory.steps, fall is not None)
    force = step_force(scale, step_noise, scale.duration / steps) if steps > 0 else 0.0
    limits: dict[str, float | None] = dict(ride_limits(scale, error, force, exact.borders))
    if hold_cpu:
        cpu_ratio = _measure_cpu_ratio(engine, problem, settings)
        values[HELD_CPU] = cpu_ratio
        limits[HELD_CPU] = None if cpu_ratio is None else (1 - 1 / CPU_FACTOR) * cpu_ratio
    reasons = _describe_disagreement(reports)
    further: list[Measured] = []
    if fall is None and gate.order:
        further.append(
            _measure_safely(("observed_order",), lambda: _measure_order(start, engine, settings, step_noise))
        )
    if fall is None and gate.eigenvalues and start.motion is not None:
        rate = trajectory.steps / scale.duration
        further.append(
            _measure_safely(
                EIGENVALUE_QUANTITIES, lambda: (_measure_eigenvalues(start, engine, settings, rate, step_noise), {})
            )
        )
    for part, why in further:
        values |= {name: value for name, (value, _) in part.items()}
        limits |= {name: limit for name, (_, limit) in part.items()}
        reasons |= why
    values = {name: value if value is not None and np.isfinite(value) else None for name, value in values.items()}
    return Sample(
        values=values,
        limits=limits,
        reasons=reasons,
        steps=trajectory.steps,
        step_noise=own_noise,
        version=engine.version,
        settings=trajectory.settings,
        trajectory=trajectory,
    )


def _describe_disagreement(reports: Sequence[Mismatch]) -> dict[str, str]:
    """Return why the reports of an engine do not agree with its coordinates; empty where they do."""
    lines = [describe_mismatch(report.as_json()) for report in reports if not report.holds]
    return {"report_mismatch": "; ".join(lines)} if lines else {}


def _measure_safely(names: Sequence[str], measure: Callable[[], Measured]) -> Measured:
    """Return a further measurement; an engine that breaks in it gets no values there but keeps those of its ride."""
    try:
        return measure()
    except Exception as error:  # an engine that finished its ride may still break at other steps or from other starts
        return dict.fromkeys(names, (None, None)), dict.fromkeys(names, why_failed(error))


def _measure_ride(
    start: Start, reported: Trajectory, standing: Trajectory, exact: Trajectory, scale: Scale
) -> dict[str, float | None]:
    """Return the quantities of a ride before its fall, as reported and as they follow from the coordinates."""
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
    """Return the coefficient of friction that an engine's own contact forces need; None where it gives none."""
    return None if standing.contact_force is None else float(required_friction(standing, surface).max())


def _measure_cpu_ratio(engine: Engine, problem: Problem, settings: Settings) -> float | None:
    """Return the CPU time relative to the reference's: the median over several pairs of rides in turn."""
    reference = load_engine(REFERENCE)
    pairs = []
    for _ in range(_CPU_PAIRS):
        reference_time = ride_engine(reference, problem, reference.settings(), lambda _: None).cpu_time
        pairs.append(_ratio(ride_engine(engine, problem, settings, lambda _: None).cpu_time, reference_time))
    ratios = [ratio for ratio in pairs if ratio is not None]
    return float(np.median(ratios)) if ratios else None


def _ratio(time: float, reference: float) -> float | None:
    return time / reference if reference > 0 else None


def _measure_order(start: Start, engine: Engine, settings: Settings, step_noise: float) -> Measured:
    """Return the order of convergence over the short horizon with its limit, or why there is none."""
    short = replace(start.problem, times=ORDER_INTERVAL * np.arange(round(SHORT_HORIZON / ORDER_INTERVAL) + 1))
    none: FoundEigenvalues = {"observed_order": (None, None)}
    try:
        refined_settings = [settings.refined(factor) for factor in FACTORS]
        rides = [ride_engine(engine, short, refined, lambda _: None) for refined in refined_settings]
    except ValueError as error:  # settings without a step, or a step out of range or off the interval
        return none, {"observed_order": " ".join(str(error).split())}
    for ride, factor in zip(rides, FACTORS, strict=True):
        if ride.ended is not None:
            return none, {"observed_order": f"with {factor:g} times its step it ended: {ride.ended}"}
    if any(np.array_equal(coarse.q, fine.q) for coarse, fine in pairwise(rides)):
        return none, {"observed_order": SAME_BITS}
    samples = min(len(ride.time) for ride in rides)
    paths = [ride.q[:samples, :3] for ride in rides]
    first, second = (float(np.abs(fine - coarse).max()) for coarse, fine in pairwise(paths))
    scale = replace(scale_of(start), duration=float(short.times[-1]))
    # The finest ride has the most steps.
    round_off = scale.radius * noise(scale, step_noise, rides[-1].steps)
    limit = order_limit(round_off, (first, second))
    if limit is None:
        return none, {"observed_order": BELOW_NOISE}
    return {"observed_order": (observed_orders(paths)[-1], limit)}, {}


def _measure_eigenvalues(
    start: Start, engine: Engine, settings: Settings, rate: float, step_noise: float
) -> FoundEigenvalues:
    """Return the errors of the engine's own eigenvalues, from rides with ``rate`` steps per second.

    Eigenvalues that decay within the interval of the flow from which they are measured are left out, because little of
    their motion is left in the flow.
    """
    problem = start.problem
    motion = Problem(problem.bicycle, problem.surface, *start.undisturbed, problem.times, problem.inputs)
    interval = interval_of(settings)
    jacobian = jacobian_at(engine, settings, motion, interval)
    exact = linearise(problem.bicycle, problem.surface, *start.undisturbed, problem.inputs)
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
