"""Rides of many problems in the reference, in batches of compiled code."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from .admission import admit_trajectory, ride_engine
from .engine import Engine, Problem, Trajectory
from .guard import GuardedEngine
from .lagrange import LagrangeEngine

# Rides and samples held at once: some ten megabytes, and a call's own time does not matter any more.
_RIDES_A_CALL, _SAMPLES_A_CALL = 64, 20_000


def rides_in_batches(engine: Engine, settings: Any) -> bool:
    """Return whether `ride_many` rides an engine with these settings in batches."""
    inner = engine.inner if isinstance(engine, GuardedEngine) else engine
    return isinstance(inner, LagrangeEngine) and settings.integrator == "dop853"


def ride_many(
    engine: Engine, problems: Sequence[Problem], settings: Any, threads: int = 1
) -> Iterator[tuple[int, Trajectory | Exception]]:
    """Run problems in an engine and validate the trajectories.

    Parameters
    ----------
    engine : Engine
        With settings for which `rides_in_batches` is true.
    problems : sequence of Problem
        They may differ in everything.
    settings : Settings
    threads : int
        Number of threads that share the problems.

    Yields
    ------
    index : int
        Of the problem; those with the same output times follow one another.
    ride : Trajectory or Exception
        What `velodrome.engines.admission.ride_engine` returns or raises for the problem, to the bit, except for the
        CPU time: that of a batch is divided in proportion to the steps. A batch is not larger than some megabytes.
    """
    inner: Any = engine.inner if isinstance(engine, GuardedEngine) else engine
    groups: dict[bytes, list[int]] = {}
    for i, problem in enumerate(problems):
        groups.setdefault(problem.times.tobytes(), []).append(i)
    for group in groups.values():
        size = max(1, min(_RIDES_A_CALL, _SAMPLES_A_CALL // len(problems[group[0]].times)))
        for first in range(0, len(group), size):
            part = group[first : first + size]
            rides = inner.simulate_many([problems[i] for i in part], settings, threads)
            for i, ride in zip(part, rides, strict=True):
                yield i, _admit(engine, problems[i], settings, ride)


def _admit(engine: Engine, problem: Problem, settings: Any, ride: Trajectory | Exception) -> Trajectory | Exception:
    """Return a validated trajectory; a ride that failed is repeated alone, which gives its error in full."""
    try:
        if isinstance(ride, Exception):
            return ride_engine(engine, problem, settings, lambda _: None)
        return admit_trajectory(engine, problem, settings, ride)
    except MemoryError:
        raise
    except Exception as error:
        return error
