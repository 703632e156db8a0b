"""Rides with wrong maps of coordinates, predicted by the reference.

A map may be wrong on the way into the engine, on the way back, or both ways. A wrong map may violate the constraints at
the start. Some engines then project the start onto the constraints; others, whose equations contain only the
constraints' derivatives, simulate_as_it_is the violation. The reference predicts both.
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

_STEP = 1e-3  # step of the rides that simulate_as_it_is a violation of the constraints [s]
DISTINCT = 100.0  # a prediction differs from the right ride by more than so many times the methods' error
_LIFTS = 5  # Newton steps that put the rear wheel on the ground


@dataclass(frozen=True)
class Prediction:
    """A ride with a wrong map.

    Attributes
    ----------
    what : str
        Description of the map.
    simple : bool
        False for a combination of two mistakes.
    q, qd : ndarray, shape (n, 9)
        Coordinates and rates as the engine would return them.
    """

    what: str
    simple: bool
    q: np.ndarray
    qd: np.ndarray


@lru_cache(maxsize=16)
def predictions(motion: TransientMotion) -> tuple[Prediction, ...]:
    """Predict the rides of a motion with each wrong map of `coordinate_maps`, in the input, the output or both.

    Predictions are left out that differ from the right ride by no more than the errors of the methods that compute
    them: such a mistake does not show in this motion.
    """
    exact = motion.exact
    error = max(measure_distance(motion, ride.q, ride.qd, exact.q, exact.qd) for ride in simulate_start(motion.problem))
    found = (prediction for map_ in coordinate_maps() for prediction in _predict(motion, map_))
    return tuple(
        prediction
        for prediction in found
        if measure_distance(motion, prediction.q, prediction.qd, exact.q, exact.qd) > DISTINCT * max(error, ROUND_OFF)
    )


def _predict(motion: TransientMotion, map_: CoordinateMap) -> Iterator[Prediction]:
    back, rates_back = np.linalg.inv(map_.positions).T, np.linalg.inv(map_.rates).T
    exact, problem, simple = motion.exact, motion.problem, map_.simple
    yield Prediction(f"{map_.what} on the way back", simple, exact.q @ back, exact.qd @ rates_back)
    start = replace(problem, q=map_.positions @ problem.q, qd=map_.rates @ problem.qd)
    for found in simulate_start(start):
        yield Prediction(map_.what, simple, found.q @ back, found.qd @ rates_back)
        yield Prediction(f"{map_.what} on the way in", simple, found.q, found.qd)


def simulate_start(start: Problem) -> Iterator[PreciseMotion]:
    """Yield the reference's rides from a start that may violate the constraints, if they reach the end.

    Three ways are tried: the start is projected onto the constraints; the violation is kept; or the rear wheel is first
    put on the ground, as engines do that have no coordinate of height.
    """
    step = float(start.times[1]) / round(float(start.times[1]) / _STEP)

    def simulate_projected() -> PreciseMotion:
        state = (start.bicycle, start.surface, start.q, start.qd, start.times)
        return simulate(*state, tolerance=1e-9, inputs=start.inputs)

    def simulate_as_it_is(problem: Problem) -> PreciseMotion:
        state = (problem.bicycle, problem.surface, problem.q, problem.qd, problem.times)
        return simulate_modified_euler(*state, step=step, inputs=problem.inputs)

    for ride in (
        simulate_projected,
        lambda: simulate_as_it_is(start),
        lambda: simulate_as_it_is(_stand_rear_wheel(start)),
    ):
        try:
            with np.errstate(all="ignore"):
                found = ride()
        except (ValueError, ArithmeticError):  # no contact, or a rim in the ground
            continue
        if len(found.time) == len(start.times):
            yield found


def _stand_rear_wheel(problem: Problem) -> Problem:
    """Return the problem with the height and its rate changed so that the rear wheel stands on the ground."""
    bicycle, surface, q, qd = problem.bicycle, problem.surface, problem.q.copy(), problem.qd.copy()
    for _ in range(_LIFTS):
        here = _observe_rear_wheel(bicycle, surface, q, qd)
        q[2] -= float(here.gap / here.normal[2])
    here = _observe_rear_wheel(bicycle, surface, q, qd)
    qd[2] -= float(here.gap_rate / here.normal[2])
    return replace(problem, q=q, qd=qd)


def _observe_rear_wheel(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray) -> WheelContact:
    centre, velocity = body_positions(bicycle, q[None])[0, 2], body_velocities(bicycle, q[None], qd[None])[0, 2]
    axle = rotations(bicycle, q[None])[0, 2, :, 1]
    spin = angular_velocities(bicycle, q[None], qd[None])[0, 2]
    return observe_wheel(surface, bicycle.rear_wheel_radius, centre, axle, velocity, spin)


def measure_distance(
    motion: TransientMotion, q: np.ndarray, qd: np.ndarray, to_q: np.ndarray, to_qd: np.ndarray
) -> float:
    """Return the root mean square difference of two rides after the first sample, relative to the motion's sizes."""
    n = min(len(q), len(to_q))
    apart = [(q[1:n] - to_q[1:n]) / motion.sizes, (qd[1:n] - to_qd[1:n]) / motion.scale.rates]
    with np.errstate(over="ignore", invalid="ignore"):
        found = float(np.sqrt(np.mean(np.square(apart))))
    return found if np.isfinite(found) else np.inf
