"""A rolling joint of knife-edge wheels on any smooth surface, for any Exudyn model.

The engine's own rolling disc works on flat ground only. Here a wheel gets up to three constraints on the
coordinates of its node: two rows of slip, nonholonomic, and the gap, holonomic. One object of the engine's general
connector holds the rows of all wheels that belong to its node or two, with one compiled kernel behind it, which
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

As in the engine's own disc, rows can be left out with ``constrainedAxes``: a vehicle with more constraints than it
needs has redundant rows, with which the engine's linear solver fails. The ground may be fixed to a body, on which the
reaction then acts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from struct import Struct
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    MarkerNodeCoordinates,
    NodePointGround,
    ObjectConnectorCoordinateVector,
)
from numpy.typing import ArrayLike

from ...reference.rim import rim_search
from ...reference.surface import Surface
from . import general, kernel
from .attachment import INERTIAL_FRAME, Attachment, find_attachment, list_nodes, reference_coordinates, stack_frames
from .pose import EULER_PARAMETERS, FIXED, TREE, Frames

SLIP_ROWS = (0, 1)  # of a wheel's three


@dataclass(frozen=True)
class RollingJoint:
    """A rolling joint in an Exudyn model.

    Attributes
    ----------
    objectNumber : exudyn.ObjectIndex
        Object number of the constraint; its output variable `Force` contains minus the components of the contact
        forces that are constrained, wheel by wheel: lateral, forward, normal [N].
    nodeNumbers : tuple
        The one or two nodes on whose coordinates the constraints depend.
    frames : Frames
        Frames of the wheels, with their origins at the centres, and the frame of the ground.
    surface : Surface
    triads : ndarray, shape (k, 3, 3)
        Rows are right-handed unit vectors in the axes of the wheels' bodies; the middle row is the axle.
    radii : ndarray, shape (k,)
        Radii of the knife edges [m].
    order : ndarray, shape (k, 3)
        Rows of the wheels' lateral, forward and normal constraints in the object; -1 for those that are left out.
    """

    objectNumber: Any
    nodeNumbers: tuple[Any, ...]
    frames: Frames
    surface: Surface
    triads: np.ndarray
    radii: np.ndarray
    order: np.ndarray


def CreateRollingJointOnSurface(
    mbs: exu.MainSystem,
    name: str = "",
    bodyNumbers: Sequence[Any] = (),
    axisPosition: ArrayLike = (0.0, 0.0, 0.0),
    axisVector: ArrayLike = (1.0, 0.0, 0.0),
    discRadius: float | Sequence[float] = 0.0,
    surface: Surface | None = None,
    constrainedAxes: ArrayLike = (1, 1, 1),
    groundNumber: Any = None,
    newmarkRatio: float = 0.5,
    activeConnector: bool = True,
) -> RollingJoint:
    """Let wheels roll on a surface, as knife edges that neither slip nor lift off.

    All wheels of a joint and its ground belong to one node or to two: two wheels that are bodies of their own, any
    number of wheels of one body or one kinematic tree, or a wheel on moving ground. Further wheels get joints of their
    own; two wheels in one joint take less time than in two joints, since the engine requests all their constraints at
    once. The wheels touch where their edges are closest to the surface, from above. The joint works with the
    engine's implicit solvers; with ``useIndex2Constraints`` all rows are velocities, as they should be.

    Parameters
    ----------
    mbs : exudyn.MainSystem
        Must not be assembled yet.
    name : str
        Name of the constraint.
    bodyNumbers : sequence
        The wheels: rigid bodies, their nodes, or markers (MarkerBodyRigid, MarkerNodeRigid,
        MarkerKinematicTreeRigid), with nodes of any kind. A body with several wheels stands there several times.
    axisPosition, axisVector : array_like, shape (3,) or (k, 3)
        Wheel centre [m] and axle, of any length, in the axes of the body, or of the marker, for all wheels or for each.
    discRadius : float or sequence of float
        Radius of the edge [m], one for all wheels or one for each.
    surface : Surface
        The ground; see `velodrome.reference.surface`.
    constrainedAxes : array_like, shape (3,) or (k, 3)
        Flags of the constraints, for all wheels or for each: lateral, forward and normal, as for the engine's own
        disc. Those that are 0 are left out, and so is their force.
    groundNumber : exudyn.ObjectIndex, exudyn.NodeIndex or exudyn.MarkerIndex, optional
        The body or marker to which the surface is fixed, in its axes: moving ground, or ground at another place. By
        default the surface is fixed in inertial axes.
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
        If the bodies, the radii, the axle, the flags or the surface are not as above.
    """
    if len(bodyNumbers) == 0 or surface is None:
        raise ValueError("a rolling joint takes a surface, and at least one wheel in bodyNumbers")
    count = len(bodyNumbers)
    centres = _read_vectors("axisPosition", axisPosition, count)
    axles = _read_vectors("axisVector", axisVector, count)
    wheels = [_offset(find_attachment(mbs, body), centre) for body, centre in zip(bodyNumbers, centres, strict=True)]
    ground = INERTIAL_FRAME if groundNumber is None else find_attachment(mbs, groundNumber)
    nodes = list_nodes([*wheels, ground])
    if not nodes:
        raise ValueError("nothing can roll: the wheels and their ground are all fixed")
    if any(len(list_nodes([each, ground])) == 1 and each.kind == ground.kind != TREE for each in wheels):
        raise ValueError(f"nothing can roll: a wheel is fixed to the body of its ground, node {int(ground.node)}")
    if len(nodes) > 2:
        raise ValueError(
            f"the wheels and their ground belong to {len(nodes)} nodes; the engine's connector joins at most two, so "
            "give each wheel a joint of its own"
        )
    radii = np.broadcast_to(np.asarray(discRadius, float), count).copy()
    if not np.all(radii > 0) or not np.all(np.isfinite(radii)):
        raise ValueError(f"discRadius is {discRadius!r}; a wheel's radius is a positive number [m]")
    if not (math.isfinite(newmarkRatio) and newmarkRatio > 0):
        raise ValueError(f"newmarkRatio is {newmarkRatio!r}; it must be a positive number, about 0.5")
    frames = stack_frames([*wheels, ground])
    triads = np.stack([_make_triad(axle) @ each.rotation.T for axle, each in zip(axles, wheels, strict=True)])
    order = _number_rows(constrainedAxes, count)
    start = reference_coordinates(mbs, nodes)
    rolling = (frames, triads, radii, order)
    constraint, jacobian = _make_user_functions(rolling, start, surface, newmarkRatio)
    item = ObjectConnectorCoordinateVector(
        name=name,
        markerNumbers=_add_markers(mbs, nodes),
        # It gives the number of rows; the functions do the rest.
        scalingMarker1=np.zeros((int(order.max()) + 1, 1)),
        constraintUserFunction=constraint,
        jacobianUserFunction=jacobian,
        activeConnector=activeConnector,
        visualization={"show": False},
    )
    return RollingJoint(mbs.AddObject(item), tuple(nodes), frames, surface, triads, radii, order)


def slip_equations(mbs: exu.MainSystem, joint: RollingJoint) -> list[int]:
    """Return the indices of the slip rows among the algebraic equations of an assembled system."""
    equations = mbs.systemData.GetObjectLTGAE(joint.objectNumber)
    return [equations[row] for row in joint.order[:, SLIP_ROWS].ravel() if row >= 0]


def _read_vectors(name: str, values: ArrayLike, wheels: int) -> np.ndarray:
    """Return vectors of the wheels (k, 3) from one for all of them or one for each."""
    found = np.asarray(values, float)
    if found.shape not in ((3,), (wheels, 3)) or not np.all(np.isfinite(found)):
        raise ValueError(f"{name} is {values!r}; it must be a vector of three numbers, for all wheels or for each")
    return np.broadcast_to(found, (wheels, 3))


def _offset(wheel: Attachment, centre: np.ndarray) -> Attachment:
    """Move the frame of a wheel to the wheel's centre, given in the frame's axes."""
    return replace(wheel, position=wheel.position + wheel.rotation @ centre)


def _number_rows(flags: ArrayLike, wheels: int) -> np.ndarray:
    """Return the rows (k, 3) of the constraints whose flags are set, and -1 for the others."""
    chosen = np.asarray(flags)
    if chosen.shape not in ((3,), (wheels, 3)) or not np.all((chosen == 0) | (chosen == 1)):
        raise ValueError(
            f"constrainedAxes is {flags!r}; it must be three flags 0 or 1 (lateral, forward, normal), for all wheels "
            "or for each"
        )
    chosen = np.broadcast_to(chosen, (wheels, 3)).astype(bool)
    if not chosen.any():
        raise ValueError("constrainedAxes leaves out all constraints, so there is no joint")
    order = np.full((wheels, 3), -1)
    order[chosen] = np.arange(chosen.sum())
    return order


def _add_markers(mbs: exu.MainSystem, nodes: list[Any]) -> list[Any]:
    """Add the markers of the connector's two sides: two nodes, or the ground and one node."""
    if len(nodes) == 1:
        nodes = [mbs.AddNode(NodePointGround()), *nodes]
    return [mbs.AddMarker(MarkerNodeCoordinates(nodeNumber=node)) for node in nodes]


def _make_triad(axle: np.ndarray) -> np.ndarray:
    """Return right-handed unit vectors (3, 3) with an axle in the middle; the y axis gives the identity."""
    length = np.linalg.norm(axle)
    if not length > 0:
        raise ValueError("axisVector is zero; an axle is a vector of three numbers, not all zero")
    along = axle / length
    other = np.eye(3)[0 if abs(along[0]) < 0.9 else 1]
    across = np.cross(other, along)
    across /= np.linalg.norm(across)
    return np.stack([np.cross(along, across), along, across])


def _is_common(frames: Frames, order: np.ndarray) -> bool:
    """Whether the joint is of the kind that `kernel` is for, as in a bicycle."""
    *wheels, ground = frames.kinds
    return (
        ground == FIXED
        and not frames.positions[-1].any()
        and np.array_equal(frames.rotations[-1], np.eye(3))
        and all(kind == EULER_PARAMETERS for kind in wheels)
        and len(set(frames.starts[:-1])) == len(wheels)
        and bool(np.all(order >= 0))
    )


def _make_user_functions(
    rolling: tuple[Frames, np.ndarray, np.ndarray, np.ndarray], start: np.ndarray, surface: Surface, ratio: float
) -> Any:
    """Make the connector's two user functions, which share one evaluation; ``start`` has coordinates (n,).

    The engine requests the Jacobian and the constraints at every iterate, with the same coordinates.
    """
    frames, triads, radii, order = rolling
    count, size = int(order.max()) + 1, len(start)
    function = surface.function.real
    where = (rim_search(surface, radii), function, surface.parameters)
    rows, values, scale = np.zeros((count, size)), np.zeros((2, count)), np.zeros(1)
    if _is_common(frames, order):
        state = np.stack([start, np.zeros(size)]).reshape(-1, 7)
        evaluate = kernel.constraints(state, frames.positions[:-1], triads, radii, *where, scale, rows, values).__next__
    else:
        state = np.stack([start, np.zeros(size)])
        evaluate = general.attached_constraints(
            state, frames, triads, radii, order, *where, scale, rows, values
        ).__next__
    evaluate()  # compiles
    memory, pack = state.data.cast("B"), Struct(f"{2 * size}d").pack_into
    on_position_level, on_velocity_level = values[0].tolist, values[1].tolist
    begun: Any = exu.ConfigurationType.StartOfStep
    evaluated_at: tuple[Any, Any, Any] = (None, None, None)

    def update(mbs, time, coordinates, rates):
        nonlocal evaluated_at
        if time != evaluated_at[0]:
            scale[0] = ratio * (time - mbs.systemData.GetTime(begun))
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
