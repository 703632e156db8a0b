"""Start values for generalized alpha with which the multipliers are of second order from the first step.

Generalized alpha with constrained positions keeps q_n on the constraints, but its velocities leave them:
with D = alpha_m - alpha_f the position formula has the error C h^3 q''', C = (1 - 6 beta - 3 D) / 6, so the
velocities of the smooth numerical solution satisfy B v_n = C h^2 B q''' with B the constraints' Jacobian,
and the auxiliary accelerations are those at the time t_n + D h. A start with B v = 0 and a_0 = q''_0, as in
the engine, excites an oscillation of the multipliers of first order in h, which is damped only by
the spectral radius (Arnold, Bruels and Cardona: Error analysis of generalized-alpha Lie group time
integration methods for constrained mechanical systems. Numerische Mathematik 129, 2015). The remedy is to
start from

    v_0 + C h^2 P q''',    a_0 = q''_0 + D h q''',

where P maps q''' to the velocities of smallest kinetic energy with the same B v and without slip: rows that
constrain velocities hold exactly. All of it is computed by the engine: accelerations at the start and one step
before and after it, mass matrix, Jacobian. The initial sample keeps the given velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from ..engine import EngineError
from .method import generalized_alpha

INITIAL: Any = exu.ConfigurationType.Initial
CURRENT: Any = exu.ConfigurationType.Current


@dataclass(frozen=True)
class GeneralizedAlphaStart:
    """Start values of generalized alpha.

    Attributes
    ----------
    acceleration, multipliers : ndarray
        Those of the given state.
    auxiliary : ndarray
        Generalized alpha's accelerations a_0.
    velocity : ndarray
        Corrected velocity, to be set before the first step.
    """

    acceleration: np.ndarray
    multipliers: np.ndarray
    auxiliary: np.ndarray
    velocity: np.ndarray


def second_order_start(
    system: exu.MainSystem, settings: exu.SimulationSettings, step: float, slip_equations: Sequence[int]
) -> GeneralizedAlphaStart:
    """Compute the start values from an assembled system's initial state.

    Parameters
    ----------
    system : exudyn.MainSystem
        Its initial state satisfies the constraints and is left unchanged.
    settings : exudyn.SimulationSettings
        Settings with generalized alpha.
    step : float
        Step size h [s].
    slip_equations : sequence of int
        Indices of the algebraic equations that constrain velocities.

    Raises
    ------
    EngineError
        If the engine finds no initial accelerations.
    """
    data: Any = system.systemData
    q, v = np.array(data.GetODE2Coordinates(INITIAL)), np.array(data.GetODE2Coordinates_t(INITIAL))
    a, multipliers, mass, jacobian = _compute_dynamics(system, settings, q, v)
    if not np.all(np.isfinite(a)):
        raise EngineError("exudyn could not start: it finds no initial accelerations; is a wheel without contact?")

    def acceleration(h: float) -> np.ndarray:
        return _compute_dynamics(system, settings, q + h * v + h * h / 2 * a, v + h * a)[0]

    jerk = (acceleration(step) - acceleration(-step)) / (2 * step)
    _set_initial(system, q, v)
    beta, _, shift = generalized_alpha(settings.timeIntegration.generalizedAlpha.spectralRadius)
    excess = (1 - 6 * beta - 3 * shift) / 6 * step**2 * jacobian @ jerk
    excess[list(slip_equations)] = 0.0
    matrix = np.block([[mass, jacobian.T], [jacobian, np.zeros((len(excess), len(excess)))]])
    correction = np.linalg.solve(matrix, np.concatenate([np.zeros(len(v)), excess]))[: len(v)]
    return GeneralizedAlphaStart(a, multipliers, a + shift * step * jerk, v + correction)


def begin(system: exu.MainSystem, settings: exu.SimulationSettings, solver: Any, start: GeneralizedAlphaStart) -> bool:
    """Initialize a solver with start values; the velocity is set later, by `correct_start`."""
    settings.timeIntegration.generalizedAlpha.computeInitialAccelerations = False
    # The initial accelerations that the solver finds become its auxiliary ones; the true ones are set afterwards.
    data: Any = system.systemData
    data.SetODE2Coordinates_tt(start.auxiliary, INITIAL)
    ready = solver.InitializeSolver(system, settings)
    data.SetODE2Coordinates_tt(start.acceleration, CURRENT)
    data.SetAECoordinates(start.multipliers, CURRENT)
    return ready


def correct_start(system: exu.MainSystem, start: GeneralizedAlphaStart) -> None:
    """Set the corrected velocity, after the initial sample and before the first step."""
    data: Any = system.systemData
    data.SetODE2Coordinates_t(start.velocity, CURRENT)


def _set_initial(system: exu.MainSystem, q: np.ndarray, v: np.ndarray) -> None:
    data: Any = system.systemData
    data.SetODE2Coordinates(q, INITIAL)
    data.SetODE2Coordinates_t(v, INITIAL)


def _compute_dynamics(
    system: exu.MainSystem, settings: exu.SimulationSettings, q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Compute accelerations, multipliers, mass matrix and constraint Jacobian of a state by the engine."""
    _set_initial(system, q, v)
    solver: Any = exu.MainSolverImplicitSecondOrder()
    solver.InitializeSolver(system, settings)
    try:
        acceleration = np.array(system.systemData.GetODE2Coordinates_tt(CURRENT))
        multipliers = np.array(system.systemData.GetAECoordinates(CURRENT))
        solver.ComputeMassMatrix(system, 1.0)
        mass = np.array(solver.GetSystemMassMatrix())
        size = len(q) + len(multipliers)
        solver.SetSystemJacobian(np.zeros((size, size)))
        solver.ComputeJacobianAE(system, 1.0, 1.0, False)
        jacobian = np.array(solver.GetSystemJacobian())[len(q) :, : len(q)]
    finally:
        solver.FinalizeSolver(system, settings)
    return acceleration, multipliers, mass, jacobian
