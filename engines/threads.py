"""Rides of many problems in threads of one process, for engines whose library computes without Python's lock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from threading import Event

from .engine import Problem, Progress, Trajectory


class _StoppedError(Exception):
    """Raised in the rides that go on when one of the others ends the batch."""


def ride_in_threads(
    ride: Callable[[Problem, Progress], Trajectory], problems: Sequence[Problem], threads: int
) -> list[Trajectory | Exception]:
    """Ride problems in threads.

    Parameters
    ----------
    ride : callable
        Runs one problem; it calls the function that it is given from time to time.
    problems : sequence of Problem
    threads : int
        Number of threads. The first problem is ridden before the others, so that kernels are compiled once.

    Returns
    -------
    list of Trajectory or Exception
        For each problem what ``ride`` returns or raises.

    Raises
    ------
    ValueError
        If there is no thread.
    BaseException
        What ``ride`` raises that is no Exception, or the user's interrupt. The other rides then stop at their next
        call of the function.
    """
    if threads < 1:
        raise ValueError(f"threads is {threads}; it must be at least 1")
    stopped = Event()

    def report(_: float) -> None:
        if stopped.is_set():
            raise _StoppedError

    def attempt(problem: Problem) -> Trajectory | Exception:
        try:
            return ride(problem, report)
        except Exception as error:
            return error

    first, others = [attempt(problem) for problem in problems[:1]], problems[1:]
    if threads == 1 or len(others) < 2:
        return first + [attempt(problem) for problem in others]
    with ThreadPoolExecutor(min(threads, len(others))) as pool:
        try:
            return first + list(pool.map(attempt, others))
        except BaseException:
            stopped.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
