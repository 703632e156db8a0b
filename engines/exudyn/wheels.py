"""Ways to put the bicycle's two wheels on the ground, and to read the contact forces after a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorObject

from ...reference.rim import rim_search
from ..engine import Problem
from . import kernel
from .joint import CreateRollingJointOnSurface, RollingJoint, slip_equations
from .method import generalized_alpha
from .settings import SolverSettings

# Of the models, in kilograms, and so of their forces in newtons. Newton's residual is one norm of forces and of
# lengths, measured against the bodies' weights: in kilograms it would let go of lengths a thousand times too soon.
MASS_UNIT = 1000.0

LEFT_AXIS = np.array([0.0, 1.0, 0.0])

WheelBody = dict[str, Any]


class WheelRolling(Protocol):
    """Both wheels on the ground."""

    def local_forces(self, system: exu.MainSystem) -> np.ndarray:
        """Forces of the ground on the wheels after a run, (n, 2, 3): lateral, forward, normal [N]."""
        ...

    def slip_equations(self, system: exu.MainSystem) -> list[int]:
        """Numbers of those algebraic equations that hold velocities though declared holonomic."""
        ...


PutOnGround = Callable[[exu.MainSystem, Sequence[WheelBody], Problem, SolverSettings], WheelRolling]


@dataclass(frozen=True)
class Constrained:
    """Wheels on the joint of this package, both in one object."""

    joint: RollingJoint
    sensor: Any

    def local_forces(self, system: exu.MainSystem) -> np.ndarray:
        """See `WheelRolling`: the engine adds W^T lambda to the inertia forces' side, so forces are minus lambda."""
        return -_samples(system, self.sensor).reshape(-1, 2, 3)

    def slip_equations(self, system: exu.MainSystem) -> list[int]:
        """See `WheelRolling`."""
        return slip_equations(system, self.joint)


def constrain(
    system: exu.MainSystem, wheels: Sequence[WheelBody], problem: Problem, settings: SolverSettings
) -> Constrained:
    """Put the wheels on the surface by true constraints."""
    method = generalized_alpha(settings.spectral_radius)
    joint = CreateRollingJointOnSurface(
        system,
        bodyNumbers=[wheel["bodyNumber"] for wheel in wheels],
        axisVector=LEFT_AXIS.tolist(),
        discRadius=wheel_radii(problem),
        surface=problem.surface,
        newmarkRatio=method.beta / method.gamma,
    )
    return Constrained(joint, _watch(system, joint.objectNumber, exu.OutputVariableType.Force))


@dataclass(frozen=True)
class Discs:
    """Wheels on the engine's own rolling discs."""

    sensors: tuple[Any, Any]

    def local_forces(self, system: exu.MainSystem) -> np.ndarray:
        """See `WheelRolling`; the engine's contact axes are the same."""
        return np.stack([_samples(system, sensor) for sensor in self.sensors], axis=1)

    def slip_equations(self, system: exu.MainSystem) -> list[int]:
        """See `WheelRolling`: the discs are declared nonholonomic."""
        return []


def roll_discs(
    system: exu.MainSystem, wheels: Sequence[WheelBody], problem: Problem, _settings: SolverSettings
) -> Discs:
    """Put the wheels on the level plane by the engine's rolling discs."""
    return _add_discs(system, wheels, problem, np.array([[0.0, 0.0, 1.0]] * 2))[0]


def roll_discs_on_tangents(
    system: exu.MainSystem, wheels: Sequence[WheelBody], problem: Problem, _settings: SolverSettings
) -> Discs:
    """Put the wheels on the surface by rolling discs whose normal follows the contact before every residual.

    The disc's constraints are velocities: of its plane they know the normal only, so there is no point of
    the plane to follow, and the gap drifts.
    """
    nodes, out = [wheel["nodeNumber"] for wheel in wheels], np.empty((2, 3))
    coordinates = np.array([system.GetNode(node)["referenceCoordinates"] for node in nodes])
    shape = (np.zeros((2, 3)), np.stack([np.eye(3)] * 2), np.array(wheel_radii(problem)))
    function, looking = problem.surface.function.real, rim_search(problem.surface, wheel_radii(problem))
    find = kernel.normals(coordinates, *shape, looking, function, problem.surface.parameters, out).__next__
    find()
    discs, objects = _add_discs(system, wheels, problem, out)
    kind = exu.OutputVariableType

    # The generator does not keep the surface's compiled function alive: the default argument does.
    def follow(mbs, _time, _iteration, _discontinuous, _function=function):
        for wheel in range(2):
            coordinates[wheel] = mbs.GetNodeOutput(nodes[wheel], kind.CoordinatesTotal)
        find()
        for wheel in range(2):
            mbs.SetObjectParameter(objects[wheel], "planeNormal", out[wheel].tolist())

    system.SetPreNewtonResidualUserFunction(follow)
    return discs


def wheel_radii(problem: Problem) -> list[float]:
    """Radii of the rear and the front wheel [m]."""
    return [problem.bicycle.rear_wheel_radius, problem.bicycle.front_wheel_radius]


def _add_discs(
    system: exu.MainSystem, wheels: Sequence[WheelBody], problem: Problem, normals: np.ndarray
) -> tuple[Discs, list[Any]]:
    ground = system.CreateGround()
    objects = [
        system.CreateRollingDisc(
            bodyNumbers=[ground, wheel["bodyNumber"]],
            axisPosition=[0.0, 0.0, 0.0],
            axisVector=LEFT_AXIS.tolist(),
            discRadius=radius,
            planeNormal=normal.tolist(),
            show=False,
        )
        for wheel, radius, normal in zip(wheels, wheel_radii(problem), normals, strict=True)
    ]
    rear, front = (_watch(system, item, exu.OutputVariableType.ForceLocal) for item in objects)
    return Discs((rear, front)), objects


def _watch(system: exu.MainSystem, item: Any, kind: Any) -> Any:
    return system.AddSensor(
        SensorObject(objectNumber=item, outputVariableType=kind, storeInternal=True, writeToFile=False)
    )


def _samples(system: exu.MainSystem, sensor: Any) -> np.ndarray:
    return MASS_UNIT * np.atleast_2d(system.GetSensorStoredData(sensor))[:, 1:]
