"""Engines with faults, planted by wrapping an engine that has none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tests.wrapped import WrappedEngine
from velodrome.engines.engine import Problem, Progress, Trajectory
from velodrome.engines.registry import load_engine
from velodrome.reference.kinematics import COORDINATES
from velodrome.reports.measure import evaluate_ride

Before = Callable[[Problem], Problem]
After = Callable[[Trajectory, Problem, float], Trajectory]


@dataclass(frozen=True)
class Planted(WrappedEngine):
    """An engine whose problems and trajectories are changed on the way.

    Attributes
    ----------
    inner : Engine
    before : callable
        Of what is ridden.
    after : callable
        Of what is given, with the problem and the mean step [s].
    """

    before: Before
    after: After

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        """Run the changed problem and change what comes of it."""
        ridden = self.inner.simulate(self.before(problem), settings, progress)
        return self.after(ridden, problem, float(ridden.time[-1]) / max(1, ridden.steps))


Fault = tuple[Before, After]


def plant(name: str, fault: Fault) -> Planted:
    """Plant a fault in an installed engine."""
    return Planted(load_engine(name), *fault)


def same(problem: Problem) -> Problem:
    return problem


def follow(trajectory: Trajectory, problem: Problem) -> Trajectory:
    """Bodies, contacts and energies from the coordinates, as an engine of coordinates gives them."""
    return evaluate_ride(trajectory, problem.bicycle, problem.surface)


def mapped(into: np.ndarray, back: np.ndarray, rates_into: np.ndarray, rates_back: np.ndarray) -> Fault:
    """Coordinates and rates multiplied by factors on the way in and on the way back."""

    def before(problem: Problem) -> Problem:
        return replace(problem, q=into * problem.q, qd=rates_into * problem.qd)

    def after(trajectory: Trajectory, problem: Problem, _: float) -> Trajectory:
        return follow(replace(trajectory, q=trajectory.q * back, qd=trajectory.qd * rates_back), problem)

    return before, after


def signs(*names: str) -> np.ndarray:
    return np.array([-1.0 if name in names else 1.0 for name in COORDINATES])


def mirrored(*names: str) -> Fault:
    """Coordinates with the other sign, on the way in and on the way back."""
    return mapped(signs(*names), signs(*names), signs(*names), signs(*names))


def mirrored_back(*names: str) -> Fault:
    """Coordinates with the other sign on the way back alone."""
    return mapped(np.ones(9), signs(*names), np.ones(9), signs(*names))


def scaled_rate(name: str, factor: float, both: bool) -> Fault:
    """A rate times a factor on the way back, or divided by it on the way in too."""
    factors = np.where(np.array(COORDINATES) == name, factor, 1.0)
    return mapped(np.ones(9), np.ones(9), 1 / factors if both else np.ones(9), factors)


def reported(change: Callable[[Any, Problem, float], dict[str, Any]]) -> Fault:
    """Fields that are given otherwise than they are."""
    return same, lambda trajectory, problem, step: replace(trajectory, **change(trajectory, problem, step))


def changed(*names: str, by: Callable[[np.ndarray], np.ndarray]) -> Fault:
    """Fields that are given otherwise than they are, each by itself."""
    return reported(lambda trajectory, *_: {name: by(getattr(trajectory, name)) for name in names})
