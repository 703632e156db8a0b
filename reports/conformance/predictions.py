"""What rides look like whose maps are wrong, as the reference rides them.

A map may be wrong on the way in, on the way back, or both ways. A start that a wrong map has taken off the constraints
is put back on them by some engines and kept off them by others, whose equations hold the constraints' derivatives
alone; the reference does either.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ...engines.coordinates import angular_velocities, body_positions, body_velocities, rotations
from ...engines.engine import Problem
from ...engines.rolling import WheelContact, observe_wheel
from ...reference.bicycle import Bicycle
from ...reference.simulate import PreciseMotion, simulate, simulate_modified_euler
from ...reference.surface import Surface
from ..measure import ROUND_OFF
from .coordinate_maps import CoordinateMap, coordinate_maps
from .motions import TransientMotion

_STEP = 1e-3  # of the rides that keep what is off the constraints [s]
_TELLING = 100.0  # times the error of a method
_LIFTS = 5  # Newton steps to the ground


@dataclass(frozen=True)
class Prediction:
    """A ride with a wrong map.

    Attributes
    ----------
    what : str
        In words.
    simple : bool
        False for two mistakes at once.
    q, qd : ndarray, shape (n, 9)
        As the engine would give them.
    """

    what: str
    simple: bool
    q: np.ndarray
    qd: np.ndarray


@lru_cache(maxsize=16)
def predictions(motion: TransientMotion) -> tuple[Prediction, ...]:
    """Rides of a motion with every map of `coordinate_maps` wrong in every way.

    Those are left out that differ from the right ride by no more than the errors of the methods by which they are
    found: such a mistake does not show in this motion.
    """
    exact = motion.exact
    error = max(measure_distance(motion, one.q, one.qd, exact.q, exact.qd) for one in _rides(motion.problem))
    found = (one for map_ in coordinate_maps() for one in _predict(motion, map_))
    return tuple(
        one
        for one in found
        if measure_distance(motion, one.q, one.qd, exact.q, exact.qd) > _TELLING * max(error, ROUND_OFF)
    )


def _predict(motion: TransientMotion, map_: CoordinateMap) -> Iterator[Prediction]:
    back, rates_back = np.linalg.inv(map_.positions).T, np.linalg.inv(map_.rates).T
    exact, problem, simple = motion.exact, motion.problem, map_.simple
    yield Prediction(f"{map_.what} on the way back", simple, exact.q @ back, exact.qd @ rates_back)
    start = replace(problem, q=map_.positions @ problem.q, qd=map_.rates @ problem.qd)
    for found in _rides(start):
        yield Prediction(map_.what, simple, found.q @ back, found.qd @ rates_back)
        yield Prediction(f"{map_.what} on the way in", simple, found.q, found.qd)


def _rides(start: Problem) -> Iterator[PreciseMotion]:
    """The reference's rides from a start that may be off the constraints, those that come to the end.

    The start is put back on the constraints; or is kept off them; or has its rear wheel put on the ground first, as
    engines do whose height is no coordinate of their own.
    """
    step = float(start.times[1]) / round(float(start.times[1]) / _STEP)

    def put_back() -> PreciseMotion:
        return simulate(start.bicycle, start.surface, start.q, start.qd, start.times, tolerance=1e-9)

    def keep(problem: Problem) -> PreciseMotion:
        state = (problem.bicycle, problem.surface, problem.q, problem.qd, problem.times)
        return simulate_modified_euler(*state, step=step)

    for ride in (put_back, lambda: keep(start), lambda: keep(_stand_rear_wheel(start))):
        try:
            with np.errstate(all="ignore"):
                found = ride()
        except (ValueError, ArithmeticError):  # no contact, or a rim in the ground
            continue
        if len(found.time) == len(start.times):
            yield found


def _stand_rear_wheel(problem: Problem) -> Problem:
    """Problem with the height and its rate such that the rear wheel stands on the ground."""
    bicycle, surface, q, qd = problem.bicycle, problem.surface, problem.q.copy(), problem.qd.copy()
    for _ in range(_LIFTS):
        here = _rear_wheel(bicycle, surface, q, qd)
        q[2] -= float(here.gap / here.normal[2])
    here = _rear_wheel(bicycle, surface, q, qd)
    qd[2] -= float(here.gap_rate / here.normal[2])
    return replace(problem, q=q, qd=qd)


def _rear_wheel(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray) -> WheelContact:
    centre, velocity = body_positions(bicycle, q[None])[0, 2], body_velocities(bicycle, q[None], qd[None])[0, 2]
    axle = rotations(bicycle, q[None])[0, 2, :, 1]
    spin = angular_velocities(bicycle, q[None], qd[None])[0, 2]
    return observe_wheel(surface, bicycle.rear_wheel_radius, centre, axle, velocity, spin)


def measure_distance(
    motion: TransientMotion, q: np.ndarray, qd: np.ndarray, to_q: np.ndarray, to_qd: np.ndarray
) -> float:
    """Root mean square of the differences of two rides from the second sample on, relative to the motion's sizes."""
    n = min(len(q), len(to_q))
    apart = [(q[1:n] - to_q[1:n]) / motion.sizes, (qd[1:n] - to_qd[1:n]) / motion.scale.rates]
    with np.errstate(over="ignore", invalid="ignore"):
        found = float(np.sqrt(np.mean(np.square(apart))))
    return found if np.isfinite(found) else np.inf
