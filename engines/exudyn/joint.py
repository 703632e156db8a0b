"""A rolling joint of a knife-edge wheel on any smooth surface, out of the engine's general connector.

The engine's own rolling disc knows flat ground only. Here each wheel gets two constraints on the
coordinates of its node: the gap, holonomic, and the two rows of slip, nonholonomic. Both are evaluated in
Python around one compiled kernel, and bring their own analytic Jacobian.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    MarkerNodeCoordinates,
    NodePointGround,
    ObjectConnectorCoordinateVector,
    SensorObject,
)
from numba import typeof

from reference.surface import Surface

from . import kernel


@dataclass(frozen=True)
class RollingJoint:
    """A wheel's two constraints, the gap (one row) and the slip (lateral, forward), and their multipliers' sensors."""

    gap: Any
    slip: Any
    gap_multiplier: Any
    slip_multipliers: Any


class _VelocityRows:
    """Gap and velocity rows of one wheel, computed once for each set of coordinates.

    The engine asks four times at every iterate: residual and Jacobian of both constraints.
    """

    def __init__(self, radius: float, surface: Surface):
        self.gap = np.nan
        self.rows = np.zeros((3, 7))
        # Views: the engine copies what it is given, so the same memory serves every call.
        self.slip_rows, self.gap_row = self.rows[:2], self.rows[2:]
        self._coordinates = np.array([0.0, 0.0, radius, 1.0, 0.0, 0.0, 0.0])
        self._arguments = (self._coordinates, radius, surface.function.real, surface.parameters, self.rows)
        kernel.velocity_rows(*self._arguments)
        # The compiled entry itself: the dispatcher would spend 10 us a call on the type of the surface's function.
        signature = tuple(typeof(argument) for argument in self._arguments)
        self._kernel = kernel.velocity_rows.get_overload(signature)
        self._seen: Any = None

    def update(self, coordinates: Any) -> None:
        """Bring gap and rows to coordinates of seven."""
        if coordinates != self._seen:
            self._seen = coordinates
            self._coordinates[:] = coordinates
            self.gap = self._kernel(*self._arguments)


def add_rolling_joint(system: exu.MainSystem, wheel: dict[str, Any], radius: float, surface: Surface) -> RollingJoint:
    """Add a wheel's rolling joint to a system.

    Parameters
    ----------
    system : exudyn.MainSystem
    wheel : dict
        What ``CreateRigidBody(..., returnDict=True)`` gave for a wheel: its node (Euler parameters) lies in
        the centre, its axle is its y axis.
    radius : float
        Radius of the knife edge [m].
    surface : Surface
        The ground.

    Returns
    -------
    RollingJoint
        Its slip rows are still declared holonomic: call `release_slip` once integration starts.
    """
    contact = _VelocityRows(radius, surface)

    def gap(_system, _time, _item, coordinates, rates, at_velocity_level):
        contact.update(coordinates)
        return [float(contact.gap_row[0] @ rates)] if at_velocity_level else [contact.gap]

    def gap_jacobian(_system, _time, _item, coordinates, _rates, _at_velocity_level):
        contact.update(coordinates)
        return contact.gap_row

    def slip(_system, _time, _item, coordinates, rates, _at_velocity_level):
        contact.update(coordinates)
        return contact.slip_rows @ rates

    def slip_jacobian(_system, _time, _item, coordinates, _rates, _at_velocity_level):
        contact.update(coordinates)
        return contact.slip_rows

    origin: Any = system.AddNode(NodePointGround())
    ground = system.AddMarker(MarkerNodeCoordinates(nodeNumber=origin))
    markers = [ground, system.AddMarker(MarkerNodeCoordinates(nodeNumber=wheel["nodeNumber"]))]

    def connector(rows: int, constraint: Any, jacobian: Any) -> Any:
        item = ObjectConnectorCoordinateVector(
            markerNumbers=markers,
            scalingMarker1=np.zeros((rows, 7)),  # tells the number of rows; the functions do the rest
            constraintUserFunction=constraint,
            jacobianUserFunction=jacobian,
            visualization={"show": False},
        )
        return system.AddObject(item)

    def multipliers(constraint: Any) -> Any:
        kind: Any = exu.OutputVariableType.Force
        sensor = SensorObject(objectNumber=constraint, outputVariableType=kind, storeInternal=True, writeToFile=False)
        return system.AddSensor(sensor)

    holonomic, nonholonomic = connector(1, gap, gap_jacobian), connector(2, slip, slip_jacobian)
    return RollingJoint(holonomic, nonholonomic, multipliers(holonomic), multipliers(nonholonomic))


def release_slip(system: exu.MainSystem, joint: RollingJoint) -> None:
    """Declare the slip rows nonholonomic, as they are.

    The engine's initial accelerations omit (W q')_q q' of constraints on velocity level, which falsifies
    the first contact forces. The Jacobian of the slip rows stands on either level, so they take part in
    the initial accelerations as if holonomic and are released before the first step.
    """
    system.SetObjectParameter(joint.slip, "velocityLevel", True)
