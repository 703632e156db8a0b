"""Identify an engine's own reduced linear system about a motion from its flow.

Each of the seven independent variables of `velodrome.reference.stability` is disturbed both ways. The derivatives
M1, M2 of the state at times T/2 and 3 T/2 give the flow between them,

    Phi = M2 M1^-1 = exp(J T)

In the time before T/2, an engine's own fast states, such as the depth of a soft contact, adapt to those of the bicycle.
J is measured at halved steps and extrapolated, so that differences from the reference are due to the model and not to
the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import Engine, EngineError, Problem, Settings
from ...reference.dae import consistent_state
from ...reference.kinematics import PITCH, YAW
from ...reference.stability import independent, sorted_eigenvalues
from .convergence import extrapolate, observed_orders

INTERVAL = 0.2  # [s]; short enough that the fastest oscillation known, 7 rad/s, turns by less than half a turn
# Disturbances of x, y, lean, steer and their rates, and the rear rate [m, rad, rad/s]. The stencil's error is of sixth
# order in them (a fourth-order one left 8e-5 of an eigenvalue at P3); an engine's noise is divided by them.
DISTURBANCES = np.array([5e-3, 5e-3, 1e-3, 1e-3, 5e-3, 5e-3, 1e-2])
_STENCIL = ((1, 45 / 60), (-1, -45 / 60), (2, -9 / 60), (-2, 9 / 60), (3, 1 / 60), (-3, -1 / 60))
STENCIL_WEIGHT = sum(abs(weight) for _, weight in _STENCIL)
IDENTIFY_LEVELS = 3


@dataclass(frozen=True)
class Identified:
    """Reduced linear system of an engine.

    Attributes
    ----------
    jacobian : ndarray, shape (7, 7)
        Extrapolated to a step of zero.
    uncertainty : float
        Largest change of an entry by the last extrapolation [1/s and mixed units].
    eigenvalues : ndarray, shape (7,), complex
        In the order of `velodrome.reference.stability.eigenvalue_order` [1/s].
    order : float
        Observed order in the step of the entries; NaN where they do not change.
    """

    jacobian: np.ndarray
    uncertainty: float
    eigenvalues: np.ndarray
    order: float


def identify(
    engine: Engine,
    settings: Settings,
    problem: Problem,
    progress: Callable[[float], None] = lambda _: None,
    levels: int = IDENTIFY_LEVELS,
) -> Identified:
    """Measure an engine's reduced Jacobian about the state that a problem starts from.

    Parameters
    ----------
    engine : Engine
    settings : Settings
        Settings of the coarsest level; each further level halves the step.
    problem : Problem
        It starts on the motion, which is circular, or straight and upright. Its times are not used.
    progress : callable
        Called with the completed share of the work, 0 to 1.
    levels : int
        At least 2.

    Returns
    -------
    Identified

    Raises
    ------
    EngineError
        If the engine does not ride through 1.5 times the interval T.
    ValueError
        If the disturbed states do not exist, or the engine refuses the settings.
    """
    interval = interval_of(settings)
    jacobians = []
    for level in range(levels):
        refined = settings.refined(0.5**level)
        # Halved steps cost twice as much.
        before, share = (2**level - 1) / (2**levels - 1), 2**level / (2**levels - 1)
        jacobians.append(
            jacobian_at(engine, refined, problem, interval, lambda done, b=before, s=share: progress(b + s * done))
        )
    limit = extrapolate(jacobians)
    orders = observed_orders(jacobians)
    eigenvalues = sorted_eigenvalues(limit.value)
    return Identified(limit.value, limit.uncertainty, eigenvalues, orders[-1] if orders else np.nan)


def interval_of(settings: Settings) -> float:
    """Return the interval T of the flow: about `INTERVAL`, an even number of the settings' steps [s]."""
    step = getattr(settings, "step", None)
    return INTERVAL if step is None else max(1, round(INTERVAL / step / 2)) * 2 * step


def jacobian_at(
    engine: Engine,
    settings: Settings,
    problem: Problem,
    interval: float,
    progress: Callable[[float], None] = lambda _: None,
    begin: float | None = None,
    disturbances: np.ndarray = DISTURBANCES,
) -> np.ndarray:
    """Return an engine's reduced Jacobian (7, 7) at the settings' own step.

    Parameters
    ----------
    engine, settings, problem, progress
        See `identify`.
    interval : float
        T, over which the flow is taken: a number of steps [s].
    begin : float, optional
        When it begins, a number of steps or zero; without it T/2, then T is an even number of steps [s].
    disturbances : ndarray, shape (7,)
        Of the independent variables.
    """
    # Imported here because it takes a tenth of a second, and every run imports this module.
    from scipy.linalg import logm

    window = (interval / 2 if begin is None else begin, interval)
    flow, variables = np.zeros((2, 7, 7)), independent(problem.q, problem.qd)
    for j in range(7):
        for i, (multiple, weight) in enumerate(_STENCIL):
            disturbed = variables + multiple * disturbances[j] * np.eye(7)[j]
            flow[:, :, j] += weight / disturbances[j] * ride_window(engine, settings, problem, window, disturbed)
            progress((j * len(_STENCIL) + i + 1) / (7 * len(_STENCIL)))
    propagator = flow[1] @ np.linalg.inv(flow[0])
    return np.real(logm(propagator)) / interval


def ride_window(
    engine: Engine, settings: Settings, problem: Problem, window: tuple[float, float], variables: np.ndarray
) -> np.ndarray:
    """Return the independent variables (2, 7) at the begin and the end of a window of a ride.

    Parameters
    ----------
    engine : Engine
    settings : Settings
    problem : Problem
        Its start gives the yaw, and the height and pitch near which the ride starts; its times are not used.
    window : tuple of float
        When it begins, zero or a number of steps, and how long it is, a number of steps [s].
    variables : ndarray, shape (7,)
        The independent variables `velodrome.reference.stability.VARIABLES` from which it starts.

    Raises
    ------
    EngineError
        If the engine does not ride through the window.
    ValueError
        If there is no such state, or the engine refuses the settings.
    """
    begin, interval = window
    # Engines sample at equal times, which the begin and the interval are multiples of.
    unit = _common_unit(begin, interval)
    count = round((begin + interval) / unit)
    started = start_from(problem, variables, unit * np.arange(count + 1))
    engine.check(started, settings)
    trajectory = ride_engine(engine, started, settings, lambda _: None)
    if len(trajectory.time) <= count:
        raise EngineError(f"{engine.name} did not ride through {begin + interval:g} s: {trajectory.ended}")
    samples = [count - round(interval / unit), count]
    return independent(trajectory.q[samples], trajectory.qd[samples])


def _common_unit(begin: float, interval: float) -> float:
    """Return the longest time of which both are multiples, at least a thousandth of the interval."""
    if begin == 0:
        return interval
    share = Fraction(begin / interval).limit_denominator(1000)
    return interval / share.denominator


def start_from(problem: Problem, variables: np.ndarray, times: np.ndarray) -> Problem:
    """Return a problem with other independent variables (7,) and times, at the same yaw and near the same height."""
    x, y, lean, steer, lean_rate, steer_rate, rear_rate = variables.tolist()
    yaw = float(problem.q[YAW])
    position = np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y
    guess = float(problem.q[2]), float(problem.q[PITCH])
    rates = lean_rate, steer_rate, rear_rate
    state = consistent_state(problem.bicycle, problem.surface, position, lean, steer, rates, yaw, guess)
    return Problem(problem.bicycle, problem.surface, *state, times, problem.inputs, problem.beyond_fall)
