"""What ends a ride in Exudyn early: a rim that touches the ground at a second place, and a fall."""

from __future__ import annotations

from collections.abc import Callable

import exudyn as exu
import numpy as np

from ...reference.bicycle import BODIES
from ...reference.fall import Ending, FallWatch, find_first_ending
from ...reference.rim import RimWatch
from ..engine import EngineError, Problem
from .model import BodyMotion, Model
from .results import read_coordinates

# Coordinates of the system and their rates.
_State = tuple[list[float], list[float]]
Look = Callable[[float], Ending | None]


def make_looks(model: Model, problem: Problem) -> Look:
    """Make the check that `velodrome.engines.exudyn.solve.integrate` calls with the time [s] at every step.

    It returns when and why the ride ends, None if it goes on.

    Raises
    ------
    EngineError
        If a rim lies inside the ground at the start.
    """
    looks = [_look_at_rims(model, problem)]
    if not problem.beyond_fall:
        looks.append(_look_at_fall(model, problem))
    return lambda time: find_first_ending(*(look(time) for look in looks))


def _look_at_rims(model: Model, problem: Problem) -> Look:
    try:
        watch = RimWatch(problem.bicycle, problem.surface, problem.q)
    except ValueError as error:
        raise EngineError(f"exudyn could not start: {error}") from error
    if not watch.needed:
        return lambda _: None
    system, kinds = model.system, exu.OutputVariableType

    def look(time: float) -> Ending | None:
        for k, node in enumerate(model.nodes[2:]):
            watch.centre[k] = system.GetNodeOutput(node, kinds.Position)
            watch.axle[k] = system.GetNodeOutput(node, kinds.RotationMatrix)[1::3]
        return watch.look(time)

    return look


def _look_at_fall(model: Model, problem: Problem) -> Look:
    system, data = model.system, model.system.systemData

    def convert(times: np.ndarray, states: tuple[_State, _State]) -> tuple[np.ndarray, np.ndarray]:
        return _read_coordinates_at(model, problem, times, states)

    watch = FallWatch(problem.bicycle, problem.surface, convert)

    def look(time: float) -> Ending | None:
        if not watch.is_due(time):
            return None
        height = watch.measure_height(system.GetNodeOutput(model.nodes[0], exu.OutputVariableType.Position))
        return watch.look(time, height, (data.GetODE2Coordinates(), data.GetODE2Coordinates_t()))

    return look


def _read_coordinates_at(
    model: Model, problem: Problem, times: np.ndarray, states: tuple[_State, _State]
) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates and rates (2, 9) at two states; the system is left at the second, where the ride ends."""
    system, kinds = model.system, exu.OutputVariableType
    n = len(BODIES)
    position, velocity, spin = (np.empty((2, n, 3)) for _ in range(3))
    rotation = np.empty((2, n, 3, 3))
    for k, (coordinates, rates) in enumerate(states):
        system.systemData.SetODE2Coordinates(coordinates)
        system.systemData.SetODE2Coordinates_t(rates)
        for body, node in enumerate(model.nodes):
            position[k, body] = system.GetNodeOutput(node, kinds.Position)
            velocity[k, body] = system.GetNodeOutput(node, kinds.Velocity)
            rotation[k, body] = np.reshape(system.GetNodeOutput(node, kinds.RotationMatrix), (3, 3))
            spin[k, body] = system.GetNodeOutput(node, kinds.AngularVelocity)
    return read_coordinates(problem, BodyMotion(times, position, velocity, rotation, spin))
