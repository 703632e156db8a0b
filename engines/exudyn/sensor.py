"""Sensors of a rolling joint: contact point, gap, slip and contact force."""

from __future__ import annotations

from typing import Any, Literal, get_args

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorUserFunction

from ...reference.rim import rim_search
from . import general
from .attachment import read_node_coordinates, read_node_rates, reference_coordinates
from .joint import RollingJoint

Quantity = Literal["ContactPoint", "Gap", "Slip", "ContactForce"]


def CreateRollingJointSensor(
    mbs: exu.MainSystem,
    joint: RollingJoint,
    quantity: Quantity,
    wheel: int = 0,
    name: str = "",
    storeInternal: bool = True,
    fileName: str = "",
) -> Any:
    """Add a sensor of a rolling joint.

    Parameters
    ----------
    mbs : exudyn.MainSystem
    joint : RollingJoint
    quantity : {"ContactPoint", "Gap", "Slip", "ContactForce"}
        Point of the edge closest to the surface, (3,) [m]; its distance from the surface, (1,) [m];
        the material velocity there relative to the ground, lateral and forward, (2,) [m/s]; force of the ground on the
        wheel, (3,) [N], which has no component along axes that are not constrained. Vectors in inertial axes. After
        the engine's static solver, ``SolveStatic``, the force has the opposite sign, as the engine's own constraint
        forces have: that solver gives Lagrange multipliers the other sign, and a sensor cannot tell the solver.
    wheel : int
        Index of the wheel in the joint.
    name, storeInternal, fileName
        As for the engine's sensors.

    Returns
    -------
    exudyn.SensorIndex

    Raises
    ------
    ValueError
        If there is no such quantity or wheel.
    """
    if quantity not in get_args(Quantity):
        raise ValueError(f"there is no quantity {quantity!r}; there are {', '.join(get_args(Quantity))}")
    if wheel not in range(len(joint.radii)):
        raise ValueError(f"the joint has no wheel {wheel!r}; it has {len(joint.radii)}")
    item = SensorUserFunction(
        name=name,
        sensorUserFunction=_make_user_function(mbs, joint, quantity, wheel),
        storeInternal=storeInternal,
        writeToFile=bool(fileName),
        fileName=fileName,
    )
    return mbs.AddSensor(item)


def _make_user_function(mbs: exu.MainSystem, joint: RollingJoint, quantity: Quantity, wheel: int) -> Any:
    nodes, kind = joint.nodeNumbers, exu.OutputVariableType
    start = reference_coordinates(mbs, nodes)
    state = np.zeros((2, len(start)))
    state[0] = start
    point, frame, slip, gap = np.empty(3), np.empty((3, 3)), np.empty(2), np.empty(1)
    function = joint.surface.function.real
    shape = (joint.frames, joint.triads, joint.radii)
    where = (rim_search(joint.surface, joint.radii), function, joint.surface.parameters)
    measure = general.probe(wheel, state, *shape, *where, point, frame, slip, gap).__next__
    values = {"ContactPoint": point, "Gap": gap, "Slip": slip}
    constrained = joint.order[wheel] >= 0
    rows = joint.order[wheel, constrained]

    # The generator does not keep the surface's compiled function alive, but the default argument does.
    def value(mbs, _time, _sensors, _factors, configuration, _function=function):
        state[0] = read_node_coordinates(mbs, nodes, configuration)
        state[1] = read_node_rates(mbs, nodes, configuration)
        measure()
        if quantity == "ContactForce":
            multipliers = np.atleast_1d(mbs.GetObjectOutput(joint.objectNumber, kind.Force, configuration))
            return (-multipliers[rows] @ frame[constrained]).tolist()
        return values[quantity].tolist()

    return value
