"""Simulation of many problems with an engine in one call, and validation of the trajectories."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from .admission import admit_trajectory, require_sound_start, ride_engine
from .engine import Engine, EngineError, Problem, Trajectory
from .groups import group_by_times
from .guard import find_simulate_many

# Rides and samples held at once: some ten megabytes, and a call's own time does not matter any more.
_RIDES_A_CALL, _SAMPLES_A_CALL = 64, 20_000


def ride_engine_many(
    engine: Engine, problems: Sequence[Problem], settings: Any, threads: int = 1
) -> list[Trajectory | Exception]:
    """Run problems in an engine and validate the trajectories, each as `velodrome.engines.admission.ride_engine` does.

    Parameters
    ----------
    engine : Engine
        One without ``simulate_many`` rides the problems one after the other.
    problems : sequence of Problem
    settings : Settings
    threads : int
        Number of threads that the engine may use.

    Returns
    -------
    list of Trajectory or Exception
        For each problem what `ride_engine` returns or raises, the same to the bit except for the CPU time.

    Raises
    ------
    ValueError
        If there is no thread.
    EngineError
        If the engine does not return one ride for each problem.
    """
    if threads < 1:
        raise ValueError(f"threads is {threads}; it must be at least 1")
    simulate_many = find_simulate_many(engine)
    if simulate_many is None:
        return [_ride_alone(engine, problem, settings) for problem in problems]
    found: dict[int, Trajectory | Exception] = {}
    for i, problem in enumerate(problems):
        try:
            require_sound_start(engine, problem)
        except EngineError as error:
            found[i] = error
    ready = [i for i in range(len(problems)) if i not in found]
    if ready:
        rides = simulate_many([problems[i] for i in ready], settings, threads)
        found |= {i: _admit(engine, problems[i], settings, ride) for i, ride in zip(ready, rides, strict=True)}
    return [found[i] for i in range(len(problems))]


def ride_in_batches(
    engine: Engine, problems: Sequence[Problem], settings: Any, threads: int = 1
) -> Iterator[tuple[int, Trajectory | Exception]]:
    """Run any number of problems in calls of `ride_engine_many` that hold some megabytes of samples each.

    Parameters
    ----------
    engine, problems, settings, threads
        As `ride_engine_many` takes them.

    Yields
    ------
    index : int
        Of the problem; those with the same output times follow one another.
    ride : Trajectory or Exception
    """
    for group in group_by_times(problems):
        size = max(1, min(_RIDES_A_CALL, _SAMPLES_A_CALL // len(problems[group[0]].times)))
        for first in range(0, len(group), size):
            part = group[first : first + size]
            yield from zip(part, ride_engine_many(engine, [problems[i] for i in part], settings, threads), strict=True)


def _ride_alone(engine: Engine, problem: Problem, settings: Any) -> Trajectory | Exception:
    try:
        return ride_engine(engine, problem, settings, lambda _: None)
    except Exception as error:
        return error


def _admit(engine: Engine, problem: Problem, settings: Any, ride: Any) -> Trajectory | Exception:
    if isinstance(ride, EngineError):
        return ride
    if isinstance(ride, Exception):  # alone it tells the place in the engine's code too
        return _ride_alone(engine, problem, settings)
    try:
        return admit_trajectory(engine, problem, settings, ride)
    except Exception as error:
        return error
