"""Ride a periodic orbit with an engine: its errors after whole periods, and what the orbit's multipliers make of them.

With d_k the difference of the engine's state from the orbit's start after k periods and M the orbit's monodromy matrix,

    d_(k + 1) = M d_k + e + O(d_k^2)

where e is what the engine's own step adds in a period. Once the engine has settled from its start, e is the same in
every period.
"""

from __future__ import annotations

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import Engine, EngineError, Problem, Settings
from ...reference.bifurcations.near_circles import state_of_variables
from ...reference.bifurcations.orbits import PeriodicOrbit
from ...reference.bifurcations.shooting import Flow
from ...reference.stability import independent


def follow_orbit(engine: Engine, settings: Settings, flow: Flow, orbit: PeriodicOrbit, periods: int) -> np.ndarray:
    """Ride an orbit of the reference.

    Parameters
    ----------
    engine : Engine
    settings : Settings
        With a step that divides the period.
    flow : Flow
        Near the orbit.
    orbit : PeriodicOrbit
    periods : int

    Returns
    -------
    ndarray, shape (periods + 1, 7)
        Differences of the independent variables from the orbit's start at whole periods.

    Raises
    ------
    EngineError
        If the engine does not ride to the end.
    """
    equations = flow.equations
    times = orbit.period * np.arange(periods + 1)
    problem = Problem(equations.bicycle, equations.surface, *state_of_variables(flow, orbit.state), times)
    engine.check(problem, settings)
    ridden = ride_engine(engine, problem, settings, lambda _: None)
    if len(ridden.time) <= periods:
        raise EngineError(f"{engine.name} did not ride {periods} periods: {ridden.ended}")
    return independent(ridden.q, ridden.qd) - orbit.state


def predict_differences(differences: np.ndarray, monodromy: np.ndarray, settled: int) -> np.ndarray:
    """Predict the differences after further periods from those after two successive ones.

    Parameters
    ----------
    differences : ndarray, shape (n, 7)
        As `follow_orbit` returns them.
    monodromy : ndarray, shape (7, 7)
    settled : int
        Number of periods after which an engine has settled; the next one shows what its step adds in a period.

    Returns
    -------
    ndarray, shape (n, 7)
        The given differences up to ``settled`` + 1, from there on predicted ones.
    """
    added = differences[settled + 1] - monodromy @ differences[settled]
    predicted = differences.copy()
    for k in range(settled + 1, len(differences) - 1):
        predicted[k + 1] = monodromy @ predicted[k] + added
    return predicted
