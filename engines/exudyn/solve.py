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

from ...reference.rim import Ending
from ..engine import EngineError, Progress
from .settings import SolverSettings
from .start import GeneralizedAlphaStart, begin, correct_start, second_order_start

PROGRESS_STEPS = 100


@dataclass(frozen=True)
class Integration:
    """How to integrate: until ``end`` [s] in equal ``steps``, with ``samples`` evenly spaced samples after the start.

    With ``slip_equations`` generalized alpha starts as in `velodrome.engines.exudyn.start`; None leaves the start to
    the engine.
    """

    end: float
    steps: int
    samples: int
    settings: SolverSettings
    slip_equations: Sequence[int] | None = None


@dataclass(frozen=True)
class IntegrationOutcome:
    """What an integration came to.

    Attributes
    ----------
    steps : int
        Steps done.
    cpu_time : float
        Process CPU time [s].
    ended : str or None
        Why it ended early; None if it did not.
    unconverged_steps : int
        Steps done whose Newton iteration did not converge by the engine's own word.
    largest_residual : float
        That Newton's method left in a step done: a norm of forces and lengths, in the model's units.
    until : float
        Time after which nothing belongs to the ride any more [s].
    """

    steps: int
    cpu_time: float
    ended: str | None
    unconverged_steps: int
    largest_residual: float
    until: float = math.inf


class _Steps:
    """The steps of a run, as the engine's call before every step sees them.

    The call also tells the engine which steps' ends are samples. By its own period it would leave some out: it adds
    the period up, and skips a sample once the sum is 1e-10 s too large.

    Attributes
    ----------
    taken : int
        Steps begun.
    unconverged : int
        Of those done.
    residual : float
        Largest that Newton's method left in a step done.
    """

    def __init__(self, solver: Any, integration: Integration) -> None:
        self.taken, self.unconverged, self.residual = 0, 0, 0.0
        self._convergence, self._output = solver.conv, solver.output
        self._stride = integration.steps // integration.samples

    def end(self) -> None:
        """Take down how the step at work converged, once it is done."""
        self.unconverged += not self._convergence.newtonConverged
        self.residual = max(self.residual, self._convergence.residual)

    def begin(self, time: float) -> None:
        """Begin a step that leads to a time."""
        self.taken += 1
        if self.taken % self._stride == 0:
            self._output.lastSensorsWritten = time

    def outcome(self, done: int, cpu_time: float, ended: str | None, until: float = math.inf) -> IntegrationOutcome:
        """Outcome of a run."""
        return IntegrationOutcome(done, cpu_time, ended, self.unconverged, self.residual, until)


def integrate(
    system: exu.MainSystem,
    integration: Integration,
    progress: Progress,
    look: Callable[[float], Ending | None] = lambda _: None,
) -> IntegrationOutcome:
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
    step = integration.end / integration.steps
    start: GeneralizedAlphaStart | None = None
    solver: Any = exu.MainSolverImplicitSecondOrder()
    steps = _Steps(solver, integration)
    ending: Ending | None = None

    with _interruptible() as interrupted:

        def before_step(_system, time):
            nonlocal ending
            try:
                if steps.taken > 0:
                    steps.end()
                ending = look(steps.taken * step)
                if ending is not None:
                    return False
                if steps.taken == 0 and start is not None:
                    correct_start(system, start)
                if steps.taken > 0 and steps.taken % PROGRESS_STEPS == 0:
                    progress(steps.taken * step)
                steps.begin(time)
            except BaseException as error:  # an exception must not cross the engine, which would swallow it
                raised.append(error)
            return not (raised or interrupted.is_set())

        system.SetPreStepUserFunction(before_step)
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
        return steps.outcome(steps.taken, cpu_time, "interrupted")
    if ending is not None:  # before a step that was not taken
        return steps.outcome(steps.taken, cpu_time, ending.why, ending.time)
    if success:
        steps.end()
        ending = look(steps.taken * step)
        why, until = (None, math.inf) if ending is None else (ending.why, ending.time)
        return steps.outcome(steps.taken, cpu_time, why, until)
    failure = "the Jacobian is singular" if solver.conv.linearSolverFailed else "Newton's method did not converge"
    if steps.taken == 0:
        raise EngineError(f"exudyn could not start: {failure}")
    return steps.outcome(max(steps.taken - 1, 0), cpu_time, f"{failure} at t = {steps.taken * step:.6g} s")


def simulation_settings(integration: Integration) -> exu.SimulationSettings:
    """Settings of the library."""
    chosen = integration.settings
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    # Beyond the end: after the start, no step's end is a sample but those that `_Steps` names, and the last.
    settings.solution.sensors.writePeriod = 2 * integration.end
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
    # Else a first iterate that is worse than the start would loosen the relative tolerance.
    method.newton.adaptInitialResidual = False
    return settings


@contextmanager
def no_progress() -> Iterator[None]:
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
