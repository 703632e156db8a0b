"""Ways to put the bicycle's wheels on the ground, and to read the contact forces after a run."""

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
from .library import read_total_coordinates
from .method import generalized_alpha
from .settings import SolverSettings

# Mass unit of the models [kg], and so their unit of force [N]. Newton's residual is a norm of both forces and lengths,
# relative to the bodies' weights: in kilograms the iterations would stop a thousand times too early for lengths.
MASS_UNIT = 1000.0

LEFT_AXIS = np.array([0.0, 1.0, 0.0])

WheelBody = dict[str, Any]


class WheelRolling(Protocol):
    """Both wheels on the ground."""

    def local_forces(self, system: exu.MainSystem) -> np.ndarray:
        """Return forces of the ground on the wheels after a run, (n, 2, 3): lateral, forward, normal [N]."""
        ...

    def slip_equations(self, system: exu.MainSystem) -> list[int]:
        """Return indices of the algebraic equations that constrain velocities although declared holonomic."""
        ...


PutOnGround = Callable[[exu.MainSystem, Sequence[WheelBody], Problem, SolverSettings], WheelRolling]


@dataclass(frozen=True)
class Constrained:
    """Wheels on this package's joint, both in one object."""

    joint: RollingJoint
    sensor: Any

    def local_forces(self, system: exu.MainSystem) -> np.ndarray:
        """Return minus lambda, as the engine adds W^T lambda on the inertia forces' side; see `WheelRolling`."""
        return -_read_forces(system, self.sensor).reshape(-1, 2, 3)

    def slip_equations(self, system: exu.MainSystem) -> list[int]:
        """Return the indices of the joint's slip rows; see `WheelRolling`."""
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
    return Constrained(joint, _add_sensor(system, joint.objectNumber, exu.OutputVariableType.Force))


@dataclass(frozen=True)
class Discs:
    """Wheels on the engine's own rolling discs."""

    sensors: tuple[Any, Any]

    def local_forces(self, system: exu.MainSystem) -> np.ndarray:
        """Return the discs' forces, whose contact axes are the same as ours; see `WheelRolling`."""
        return np.stack([_read_forces(system, sensor) for sensor in self.sensors], axis=1)

    def slip_equations(self, system: exu.MainSystem) -> list[int]:
        """Return no equations, since the discs are declared nonholonomic; see `WheelRolling`."""
        return []


def roll_discs(
    system: exu.MainSystem, wheels: Sequence[WheelBody], problem: Problem, _settings: SolverSettings
) -> Discs:
    """Put the wheels on the level plane by the engine's rolling discs."""
    return _add_discs(system, wheels, problem, np.array([[0.0, 0.0, 1.0]] * 2))[0]


def roll_discs_on_tangents(
    system: exu.MainSystem, wheels: Sequence[WheelBody], problem: Problem, _settings: SolverSettings
) -> Discs:
    """Put the wheels on the surface by rolling discs with a normal that follows the contact before every residual.

    The disc's constraints are velocities, and the plane enters them only by its normal: no point of
    the plane can be followed, and the gap drifts.
    """
    nodes, out = [wheel["nodeNumber"] for wheel in wheels], np.empty((2, 3))
    coordinates = np.array([system.GetNode(node)["referenceCoordinates"] for node in nodes])
    shape = (np.zeros((2, 3)), np.stack([np.eye(3)] * 2), np.array(wheel_radii(problem)))
    function, looking = problem.surface.function.real, rim_search(problem.surface, wheel_radii(problem))
    find = kernel.normals(coordinates, *shape, looking, function, problem.surface.parameters, out).__next__
    find()
    discs, objects = _add_discs(system, wheels, problem, out)

    # The generator does not keep the surface's compiled function alive, but the default argument does.
    def follow(mbs, _time, _iteration, _discontinuous, _function=function):
        for wheel in range(2):
            coordinates[wheel] = read_total_coordinates(mbs, nodes[wheel])
        find()
        for wheel in range(2):
            mbs.SetObjectParameter(objects[wheel], "planeNormal", out[wheel].tolist())

    system.SetPreNewtonResidualUserFunction(follow)
    return discs


def wheel_radii(problem: Problem) -> list[float]:
    """Return the radii of the rear and the front wheel [m]."""
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
    rear, front = (_add_sensor(system, item, exu.OutputVariableType.ForceLocal) for item in objects)
    return Discs((rear, front)), objects


def _add_sensor(system: exu.MainSystem, item: Any, kind: Any) -> Any:
    return system.AddSensor(
        SensorObject(objectNumber=item, outputVariableType=kind, storeInternal=True, writeToFile=False)
    )


def _read_forces(system: exu.MainSystem, sensor: Any) -> np.ndarray:
    return MASS_UNIT * np.atleast_2d(system.GetSensorStoredData(sensor))[:, 1:]
