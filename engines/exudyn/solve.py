"""Integration by the engine's implicit solvers."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import exudyn as exu

from engines.engine import EngineError, Progress
from reference.rim import Ending

from .settings import SolverSettings
from .start import Start, begin, correct, second_order_start

PROGRESS_STEPS = 100


@dataclass(frozen=True)
class Integration:
    """How to integrate: until ``end`` [s] in equal ``steps``, with ``samples`` evenly spaced samples after the start.

    With ``slip_equations`` generalized alpha starts as in `engines.exudyn.start`; None leaves the start to
    the engine.
    """

    end: float
    steps: int
    samples: int
    settings: SolverSettings
    slip_equations: Sequence[int] | None = None


@dataclass(frozen=True)
class Outcome:
    """Steps done, process CPU time [s], and why the integration ended early (None if it did not).

    What comes after the time ``until`` [s] is none of the ride.
    """

    steps: int
    cpu_time: float
    ended: str | None
    until: float = math.inf


def integrate(
    system: exu.MainSystem,
    integration: Integration,
    progress: Progress,
    look: Callable[[float], Ending | None] = lambda _: None,
) -> Outcome:
    """Integrate a system from its initial state; its sensors hold the result.

    Parameters
    ----------
    system : exudyn.MainSystem
        Assembled.
    integration : Integration
    progress : callable
        Called now and then with the simulated time [s]; what it raises ends the run and is raised again.
    look : callable
        Called with the time [s] before each step and after the last; says why the ride ends there, or None.

    Raises
    ------
    EngineError
        If the engine did not come to the first step.
    """
    raised: list[BaseException] = []
    taken = 0
    step = integration.end / integration.steps
    start: Start | None = None
    ending: Ending | None = None

    with _interruptible() as interrupted:

        def before_step(_system, _time):
            nonlocal taken, ending
            try:
                ending = look(taken * step)
                if taken == 0 and start is not None:
                    correct(system, start)
                elif taken > 0 and taken % PROGRESS_STEPS == 0:
                    progress(taken * step)
            except BaseException as error:  # an exception must not cross the engine, which would swallow it
                raised.append(error)
            taken += 1
            return not (raised or ending or interrupted.is_set())

        system.SetPreStepUserFunction(before_step)
        solver: Any = exu.MainSolverImplicitSecondOrder()
        settings = simulation_settings(integration)
        cpu_time = -time.process_time()
        success = False
        with suppress(exu.SolverError):  # raised where the Jacobian is singular
            if integration.slip_equations is None:
                success = solver.SolveSystem(system, settings)
            else:
                start = second_order_start(system, settings, step, integration.slip_equations)
                success = begin(system, settings, solver, start) and solver.SolveSteps(system, settings)
                solver.FinalizeSolver(system, settings)
        cpu_time += time.process_time()
    if raised:
        raise raised[0]
    if interrupted.is_set():  # by a signal that the caller has made harmless
        return Outcome(taken, cpu_time, "interrupted")
    if ending is not None:  # before a step that was not taken
        return Outcome(taken - 1, cpu_time, ending.why, ending.time)
    if success and (ending := look(taken * step)) is not None:
        return Outcome(taken, cpu_time, ending.why, ending.time)
    if success:
        return Outcome(taken, cpu_time, None)
    failure = "the Jacobian is singular" if solver.conv.linearSolverFailed else "Newton's method did not converge"
    if taken == 0:
        raise EngineError(f"exudyn could not start: {failure}")
    return Outcome(max(taken - 1, 0), cpu_time, f"{failure} at t = {taken * step:.6g} s")


def simulation_settings(integration: Integration) -> exu.SimulationSettings:
    """Settings of the library."""
    chosen = integration.settings
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = integration.end / integration.samples
    # The default inverts the matrix of some fifty unknowns, which takes nearly as long as the rest of the step.
    settings.linearSolver.solverType = exu.LinearSolverType.EigenDense
    method: Any = settings.timeIntegration
    method.verboseMode = 0
    method.numberOfSteps = integration.steps
    method.endTime = integration.end
    # A refused step ends the run: a shorter one would miss the output times and hide the failure.
    method.adaptiveStep = False
    method.generalizedAlpha.spectralRadius = chosen.spectral_radius
    trapezoidal = chosen.solver == "trapezoidal-index2"
    method.generalizedAlpha.useNewmark = method.generalizedAlpha.useIndex2Constraints = trapezoidal
    method.newton.useModifiedNewton = chosen.jacobian != "iteration"
    method.newton.modifiedNewtonJacUpdatePerStep = chosen.jacobian == "step"
    method.newton.relativeTolerance = chosen.newton_relative_tolerance
    method.newton.absoluteTolerance = chosen.newton_absolute_tolerance
    return settings


@contextmanager
def silent() -> Iterator[None]:
    """Keep the engine's messages off the standard output."""
    before = exu.config.printToConsole
    exu.config.printToConsole = False
    try:
        yield
    finally:
        exu.config.printToConsole = before


@contextmanager
def _interruptible() -> Iterator[threading.Event]:
    """Hold back SIGINT until the integration has stopped.

    Python would raise inside a user function, from where the engine makes an error of its own of it.
    """
    interrupted = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield interrupted
        return
    before = signal.signal(signal.SIGINT, lambda _number, _frame: interrupted.set())
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)
        if interrupted.is_set():
            signal.raise_signal(signal.SIGINT)
