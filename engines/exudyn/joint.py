"""A rolling joint of knife-edge wheels on any smooth surface, for any Exudyn model.

The engine's own rolling disc works on flat ground only. Here a wheel gets three constraints on the
coordinates of its node: two rows of slip, nonholonomic, and the gap, holonomic. One object of the
engine's general connector holds all rows of one wheel or of two, with one compiled kernel behind it, which
provides the analytic Jacobian::

    wheel = mbs.CreateRigidBody(...)
    joint = CreateRollingJointOnSurface(
        mbs, bodyNumbers=[wheel], axisVector=[0, 1, 0], discRadius=0.3, surface=Paraboloid(0.2)
    )
    force = CreateRollingJointSensor(mbs, joint, "ContactForce")
    mbs.Assemble()
    mbs.SolveDynamic(simulationSettings)

The object is declared holonomic as a whole. On position level a row of slip is the distance that the contact
slips in a step, about ``newmarkRatio * step * slip``: it is zero exactly where the slip is, and its
derivative with respect to the positions at the end of the step is the row's own Jacobian, as the engine expects. So
gap and slip share one call, the slip is not differentiated, and the engine's initial accelerations, which
omit the term (W q')_q q' of a constraint declared nonholonomic, are right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from struct import Struct
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    MarkerNodeCoordinates,
    NodePointGround,
    ObjectConnectorCoordinateVector,
)

from ...reference.rim import rim_search
from ...reference.surface import Surface
from . import kernel

SLIP_ROWS = (0, 1)  # of a wheel's three


@dataclass(frozen=True)
class RollingJoint:
    """A rolling joint in an Exudyn model.

    Attributes
    ----------
    objectNumber : exudyn.ObjectIndex
        Object number of the constraint; its output variable `Force` contains minus the components
        (lateral, forward, normal) of the contact forces, wheel by wheel [N].
    nodeNumbers : tuple
        The wheels' nodes.
    surface : Surface
    centres : ndarray, shape (k, 3)
        Wheel centres in the bodies' axes [m].
    triads : ndarray, shape (k, 3, 3)
        Rows are right-handed unit vectors in the bodies' axes; the middle row is the axle.
    radii : ndarray, shape (k,)
        Radii of the knife edges [m].
    """

    objectNumber: Any
    nodeNumbers: tuple[Any, ...]
    surface: Surface
    centres: np.ndarray
    triads: np.ndarray
    radii: np.ndarray


def CreateRollingJointOnSurface(
    mbs: exu.MainSystem,
    name: str = "",
    bodyNumbers: Sequence[Any] = (),
    axisPosition: Sequence[float] = (0.0, 0.0, 0.0),
    axisVector: Sequence[float] = (1.0, 0.0, 0.0),
    discRadius: float | Sequence[float] = 0.0,
    surface: Surface | None = None,
    newmarkRatio: float = 0.5,
    activeConnector: bool = True,
) -> RollingJoint:
    """Let one or two wheels roll on a surface, as knife edges that neither slip nor lift off.

    Two wheels in one joint take less time than in two joints: the engine requests all their constraints at once.
    The wheels touch where their edges are closest to the surface, from above. The joint works with the engine's
    implicit solvers; with ``useIndex2Constraints`` all rows are velocities, as they should be.

    Parameters
    ----------
    mbs : exudyn.MainSystem
        Must not be assembled yet.
    name : str
        Name of the constraint.
    bodyNumbers : sequence
        The wheels: one or two rigid bodies whose nodes have Euler parameters.
    axisPosition, axisVector : array_like, shape (3,)
        Wheel centre [m] and axle, of any length, in the body's axes; the same for both wheels.
    discRadius : float or sequence of float
        Radius of the edge [m], one for all wheels or one for each.
    surface : Surface
        The ground, fixed in space; see `velodrome.reference.surface`.
    newmarkRatio : float
        Newmark's beta / gamma of the time integration: 0.5 for the trapezoidal rule, up to 2/3 for
        generalized alpha (see `method`). It affects only how fast Newton's method converges.
    activeConnector : bool
        Whether the constraint is active.

    Returns
    -------
    RollingJoint

    Raises
    ------
    ValueError
        If the bodies, the radii, the axle or the surface are not as above.
    """
    nodes = [_find_euler_parameter_node(mbs, body) for body in bodyNumbers]
    if len(nodes) not in (1, 2) or surface is None:
        raise ValueError("a rolling joint takes one or two bodyNumbers and a surface")
    radii = np.broadcast_to(np.asarray(discRadius, float), len(nodes)).copy()
    if not np.all(radii > 0) or not np.all(np.isfinite(radii)):
        raise ValueError(f"discRadius is {discRadius!r}; a wheel's radius is a positive number [m]")
    if not (math.isfinite(newmarkRatio) and newmarkRatio > 0):
        raise ValueError(f"newmarkRatio is {newmarkRatio!r}; it must be a positive number, about 0.5")
    shape = (
        np.tile(np.asarray(axisPosition, float), (len(nodes), 1)),
        np.stack([_make_triad(axisVector)] * len(nodes)),
    )
    constraint, jacobian = _make_user_functions(shape, radii, surface, newmarkRatio)
    item = ObjectConnectorCoordinateVector(
        name=name,
        markerNumbers=_add_markers(mbs, nodes),
        scalingMarker1=np.zeros((3 * len(nodes), 7)),  # gives the number of rows; the functions do the rest
        constraintUserFunction=constraint,
        jacobianUserFunction=jacobian,
        activeConnector=activeConnector,
        visualization={"show": False},
    )
    return RollingJoint(mbs.AddObject(item), tuple(nodes), surface, *shape, radii)


def slip_equations(mbs: exu.MainSystem, joint: RollingJoint) -> list[int]:
    """Return the indices of the slip rows among the algebraic equations of an assembled system."""
    equations = mbs.systemData.GetObjectLTGAE(joint.objectNumber)
    return [equations[3 * wheel + row] for wheel in range(len(joint.radii)) for row in SLIP_ROWS]


def _find_euler_parameter_node(mbs: exu.MainSystem, body: Any) -> Any:
    item = mbs.GetObject(body)
    if item["objectType"] != "RigidBody":
        raise ValueError(f"body {body} is a {item['objectType']}; a wheel is a rigid body (CreateRigidBody)")
    kind = mbs.GetNode(item["nodeNumber"])["nodeType"]
    if kind != "RigidBodyEP":
        raise ValueError(f"body {body} has a {kind} node; a wheel needs nodeType=NodeType.RotationEulerParameters")
    return item["nodeNumber"]


def _add_markers(mbs: exu.MainSystem, nodes: list[Any]) -> list[Any]:
    """Add the markers of the connector's two sides: both wheels, or the ground and one wheel."""
    if len(nodes) == 1:
        nodes = [mbs.AddNode(NodePointGround()), *nodes]
    return [mbs.AddMarker(MarkerNodeCoordinates(nodeNumber=node)) for node in nodes]


def _make_triad(axle: Sequence[float]) -> np.ndarray:
    """Return right-handed unit vectors (3, 3) with an axle in the middle; the y axis gives the identity."""
    along = np.asarray(axle, float)
    length = np.linalg.norm(along)
    if along.shape != (3,) or not (np.isfinite(length) and length > 0):
        raise ValueError(f"axisVector is {axle!r}; it must be a vector of three numbers, not all zero")
    along = along / length
    other = np.eye(3)[0 if abs(along[0]) < 0.9 else 1]
    across = np.cross(other, along)
    across /= np.linalg.norm(across)
    return np.stack([np.cross(along, across), along, across])


def _make_user_functions(
    shape: tuple[np.ndarray, np.ndarray], radii: np.ndarray, surface: Surface, ratio: float
) -> Any:
    """Make the connector's two user functions, which share one evaluation.

    The engine requests the Jacobian and the constraints at every iterate, with the same coordinates.
    """
    count = len(radii)
    state, rows, values, scale = (
        np.zeros(size) for size in ((2 * count, 7), (3 * count, 7 * count), (2, 3 * count), 1)
    )
    state[:count, 2], state[:count, 3] = radii, 1.0
    function = surface.function.real
    evaluate = kernel.constraints(
        state, *shape, radii, rim_search(surface, radii), function, surface.parameters, scale, rows, values
    ).__next__
    evaluate()  # compiles
    memory, pack = state.data.cast("B"), Struct(f"{14 * count}d").pack_into
    on_position_level, on_velocity_level = values[0].tolist, values[1].tolist
    start: Any = exu.ConfigurationType.StartOfStep
    evaluated_at: tuple[Any, Any, Any] = (None, None, None)

    def update(mbs, time, coordinates, rates):
        nonlocal evaluated_at
        if time != evaluated_at[0]:
            scale[0] = ratio * (time - mbs.systemData.GetTime(start))
        pack(memory, 0, *coordinates, *rates)
        evaluate()
        evaluated_at = (time, coordinates, rates)

    def constraint(mbs, time, _item, coordinates, rates, velocity_level):
        if (time, coordinates, rates) != evaluated_at:
            update(mbs, time, coordinates, rates)
        return on_velocity_level() if velocity_level else on_position_level()

    # The generator does not keep the surface's compiled function alive, but the default argument does.
    def jacobian(mbs, time, _item, coordinates, rates, _velocity_level, _function=function):
        if (time, coordinates, rates) != evaluated_at:
            update(mbs, time, coordinates, rates)
        return rows  # the engine makes a copy

    return constraint, jacobian
