"""An engine's own circular motion at its own step, and the eigenvalue of its weave there.

At a step h an engine's circle of a given rear rate lies off the reference's by O(h^p), and is not quite steady: the
energy drifts, and the circle moves along its family. So its state v and drift g are those for which the flow over a
window from t0 to t0 + T moves the state along the family alone,

    v(t0 + T) - v(t0) = g T t,    t the tangent of the family for a rear rate of 1

and the eigenvalues are those of the flow about this state, as in `identify`. A ride from the reference's circle would
weave by O(h^p), and show eigenvalues that are wrong by as much. In the time before t0 what an engine adds to the
bicycle's states settles: depths of contacts, gaps that are brought back to zero, a method's own oscillations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...engines.engine import Engine, Problem, Settings
from ...reference.bifurcations.near_circles import REAR_RATE, family_tangent
from ...reference.stability import VARIABLES, independent, linearise, sorted_eigenvalues
from .identify import DISTURBANCES, jacobian_at, ride_window, start_from

# Newton's steps with the reference's flow in the place of the engine's: each leaves O(h^p) of the distance.
_STEPS = 3
# Factor by which a correction at the window's begin is carried back to the start at most.
_CARRIED = 1e2
# The stencil's error of sixth order grows over the window; with those of `identify` it is 3e-6 at family 4's circles.
_DISTURBANCES = DISTURBANCES / 4


@dataclass(frozen=True)
class OwnCircle:
    """An engine's own circular motion.

    Attributes
    ----------
    start : Problem
        From which the engine rides it; its times are not to be used.
    rear_rate : float
        In the engine's own rates, in the middle of the window [rad/s].
    drift : float
        Rate at which the rear rate changes [rad/s^2].
    eigenvalue : complex
        Of the engine's flow about it, nearest to a given one [1/s].
    """

    start: Problem
    rear_rate: float
    drift: float
    eigenvalue: complex


def measure_own_circle(
    engine: Engine, settings: Settings, problem: Problem, near: complex, window: tuple[float, float]
) -> OwnCircle:
    """Measure an engine's own circular motion near one of the reference, and its eigenvalue near a given one.

    Parameters
    ----------
    engine : Engine
    settings : Settings
        The step is used as it is.
    problem : Problem
        It starts on the reference's circular motion. Its times are not used.
    near : complex
        [1/s].
    window : tuple of float
        t0, zero or a number of steps, and T, a number of steps and less than half of the weave's period [s].

    Returns
    -------
    OwnCircle

    Raises
    ------
    EngineError
        If the engine does not ride through the window.
    ValueError
        If the engine refuses the settings, or a disturbed state does not exist.
    """
    jacobian = linearise(problem.bicycle, problem.surface, problem.q, problem.qd, problem.inputs).jacobian
    tangent, variables = family_tangent(jacobian), independent(problem.q, problem.qd)
    correction = _correction_matrix(jacobian, tangent, *window)
    for _ in range(_STEPS):
        begin, end = ride_window(engine, settings, problem, window, variables)
        variables = variables + correction @ (begin - end)
    start = start_from(problem, variables, problem.times)
    begin, end = ride_window(engine, settings, start, window, variables)
    measured = jacobian_at(engine, settings, start, window[1], begin=window[0], disturbances=_DISTURBANCES)
    values = sorted_eigenvalues(measured)
    return OwnCircle(
        start,
        float(begin[REAR_RATE] + end[REAR_RATE]) / 2,
        float(end[REAR_RATE] - begin[REAR_RATE]) / window[1],
        complex(values[np.abs(values - near).argmin()]),
    )


def measure_at_start(
    engine: Engine, settings: Settings, problem: Problem, near: complex, step: float, steps: int = 4
) -> OwnCircle:
    """Measure an engine's own circle at the start of its rides, where it still is on all constraints.

    The constraints of a method that does not bring its states back drift, and with them its circle and eigenvalues.
    Windows of ``steps`` and of twice as many steps from the start are extrapolated to none.

    Parameters
    ----------
    engine, settings, problem, near
        See `measure_own_circle`.
    step : float
        The settings' step [s].
    steps : int

    Returns
    -------
    OwnCircle
        With the start of the shorter window.
    """
    short, long = (
        measure_own_circle(engine, settings, problem, near, (0.0, count * step)) for count in (steps, 2 * steps)
    )
    return OwnCircle(
        short.start,
        2 * short.rear_rate - long.rear_rate,
        2 * short.drift - long.drift,
        2 * short.eigenvalue - long.eigenvalue,
    )


def _correction_matrix(jacobian: np.ndarray, tangent: np.ndarray, begin: float, interval: float) -> np.ndarray:
    """Return the matrix (7, 7) that maps a change over the window, with its sign turned, to a change of the start.

    A change u at the window's begin without rear rate, which makes up for the change over the window but for a multiple
    of the tangent, follows from (exp(J T) - 1) u - g T t. It is carried back to the start, by `_CARRIED` times at most:
    of what decays more, nothing is left at the begin anyway, and an engine's noise would grow.
    """
    values, vectors = np.linalg.eig(jacobian)
    back = np.exp(-begin * values)
    carried_back = np.real(vectors @ np.diag(back / np.maximum(1.0, np.abs(back) / _CARRIED)) @ np.linalg.inv(vectors))
    over_window = np.real(vectors @ np.diag(np.expm1(interval * values)) @ np.linalg.inv(vectors))
    matrix = np.column_stack([over_window[:, :REAR_RATE], -interval * tangent])
    at_begin = np.vstack([np.linalg.inv(matrix)[:REAR_RATE], np.zeros(len(VARIABLES))])
    at_start = carried_back @ at_begin
    return at_start - np.outer(tangent, at_start[REAR_RATE])
