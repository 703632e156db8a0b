"""Integration by Exudyn's implicit solvers."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import exudyn as exu

from ...reference.fall import Ending
from ..engine import EngineError, Progress
from .library import SOLVER_ERROR, choose_dense_solver, set_printing, write_no_files
from .settings import SolverSettings
from .start import GeneralizedAlphaStart, begin, correct_start, second_order_start

PROGRESS_STEPS = 100


@dataclass(frozen=True)
class Integration:
    """How to integrate: until ``end`` [s] in equal ``steps``, with ``samples`` evenly spaced samples after the start.

    With ``slip_equations`` generalized alpha starts as in `velodrome.engines.exudyn.start`; with None the engine
    computes the start.
    """

    end: float
    steps: int
    samples: int
    settings: SolverSettings
    slip_equations: Sequence[int] | None = None


@dataclass(frozen=True)
class IntegrationOutcome:
    """Result of an integration.

    Attributes
    ----------
    steps : int
        Number of steps taken.
    cpu_time : float
        Process CPU time [s].
    ended : str or None
        Why the integration ended early; None if it did not.
    unconverged_steps : int
        Number of steps whose Newton iteration did not converge according to the engine.
    largest_residual : float
        Largest residual that Newton's method left in a step: a norm of forces and lengths, in the model's units.
    ending : Ending or None
        When and why the ride ended early, if not by a failure; samples after that do not belong to it.
    """

    steps: int
    cpu_time: float
    ended: str | None
    unconverged_steps: int
    largest_residual: float
    ending: Ending | None = None


class _Steps:
    """Bookkeeping of a run's steps, from the engine's call before every step.

    The call also tells the engine at which steps' ends to sample. With its own sampling period the engine would omit
    some samples: it accumulates the period, and skips a sample if the sum is 1e-10 s too large.

    Attributes
    ----------
    taken : int
        Number of steps begun.
    unconverged : int
        Number of finished steps that did not converge.
    residual : float
        Largest residual that Newton's method left in a finished step.
    """

    def __init__(self, solver: Any, integration: Integration) -> None:
        self.taken, self.unconverged, self.residual = 0, 0, 0.0
        self._convergence, self._output = solver.conv, solver.output
        self._stride = integration.steps // integration.samples

    def end(self) -> None:
        """Record the convergence of the current step after it is finished."""
        self.unconverged += not self._convergence.newtonConverged
        self.residual = max(self.residual, self._convergence.residual)

    def begin(self, time: float) -> None:
        """Begin a step that leads to a time."""
        self.taken += 1
        if self.taken % self._stride == 0:
            self._output.lastSensorsWritten = time

    def outcome(
        self, done: int, cpu_time: float, ended: str | None, ending: Ending | None = None
    ) -> IntegrationOutcome:
        """Return the outcome of a run."""
        why = ended if ending is None else ending.why
        return IntegrationOutcome(done, cpu_time, why, self.unconverged, self.residual, ending)


def integrate(
    system: exu.MainSystem,
    integration: Integration,
    progress: Progress,
    look: Callable[[float], Ending | None] = lambda _: None,
) -> IntegrationOutcome:
    """Integrate a system from its initial state; its sensors contain the result.

    Parameters
    ----------
    system : exudyn.MainSystem
        An assembled system.
    integration : Integration
    progress : callable
        Called now and then with the simulated time [s]; an exception from it ends the run and is raised again.
    look : callable
        Called with the time [s] before each step and after the last; returns why the ride ends there, or None.

    Raises
    ------
    EngineError
        If the engine did not reach the first step.
    """
    raised: list[BaseException] = []
    step = integration.end / integration.steps
    start: GeneralizedAlphaStart | None = None
    solver: Any = exu.MainSolverImplicitSecondOrder()
    steps = _Steps(solver, integration)
    ending: Ending | None = None

    with _delay_interrupt() as interrupted:

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
            except BaseException as error:  # the engine would swallow an exception
                raised.append(error)
            return not (raised or interrupted.is_set())

        system.SetPreStepUserFunction(before_step)
        settings = simulation_settings(integration)
        cpu_time = -time.process_time()
        success = False
        with suppress(SOLVER_ERROR):  # raised where the Jacobian is singular
            if integration.slip_equations is None:
                success = solver.SolveSystem(system, settings)
            else:
                start = second_order_start(system, settings, step, integration.slip_equations)
                success = begin(system, settings, solver, start) and solver.SolveSteps(system, settings)
                solver.FinalizeSolver(system, settings)
        cpu_time += time.process_time()
    if raised:
        raise raised[0]
    if interrupted.is_set():  # only if the caller ignores the signal
        return steps.outcome(steps.taken, cpu_time, "interrupted")
    if ending is not None:  # before a step that was not taken
        return steps.outcome(steps.taken, cpu_time, None, ending)
    if success:
        steps.end()
        return steps.outcome(steps.taken, cpu_time, None, look(steps.taken * step))
    failure = "the Jacobian is singular" if solver.conv.linearSolverFailed else "Newton's method did not converge"
    if steps.taken == 0:
        raise EngineError(f"exudyn could not start: {failure}")
    return steps.outcome(max(steps.taken - 1, 0), cpu_time, f"{failure} at t = {steps.taken * step:.6g} s")


def simulation_settings(integration: Integration) -> exu.SimulationSettings:
    """Return the library's settings."""
    chosen = integration.settings
    settings = exu.SimulationSettings()
    # Beyond the end: after the start, samples are only at the ends of the steps that `_Steps` chooses, and at the last.
    write_no_files(settings, period=2 * integration.end)
    # The default inverts a matrix of about fifty unknowns, which takes nearly as long as the rest of the step.
    choose_dense_solver(settings)
    method: Any = settings.timeIntegration
    method.verboseMode = 0
    method.numberOfSteps = integration.steps
    method.endTime = integration.end
    # A refused step ends the run: a shorter step would miss the output times and hide the failure.
    method.adaptiveStep = False
    method.generalizedAlpha.spectralRadius = chosen.spectral_radius
    trapezoidal = chosen.solver == "trapezoidal-index2"
    method.generalizedAlpha.useNewmark = method.generalizedAlpha.useIndex2Constraints = trapezoidal
    method.newton.useModifiedNewton = chosen.jacobian != "iteration"
    method.newton.modifiedNewtonJacUpdatePerStep = chosen.jacobian == "step"
    method.newton.relativeTolerance = chosen.newton_relative_tolerance
    method.newton.absoluteTolerance = chosen.newton_absolute_tolerance
    # Otherwise a first iterate that is worse than the start would loosen the relative tolerance.
    method.newton.adaptInitialResidual = False
    return settings


@contextmanager
def no_progress() -> Iterator[None]:
    """Suppress the engine's messages on the standard output."""
    before = set_printing(False)
    try:
        yield
    finally:
        set_printing(before)


@contextmanager
def _delay_interrupt() -> Iterator[threading.Event]:
    """Delay SIGINT until the integration has stopped.

    Python would raise an exception inside a user function, which the engine would turn into an error of its own.
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
