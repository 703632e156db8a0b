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
omit the term (W q')_q q' of a constraint declared nonholonomic, are right. For nodes with rotation vectors the engine
alone gets that term wrong, and this joint corrects it in its own rows (see `constraints`). In the rows of the engine's
own joints between such nodes it stays wrong, unless the rotation vectors are zero at the start.

As in the engine's own disc, rows can be left out with ``constrainedAxes``: a vehicle with more constraints than it
needs has redundant rows, with which the engine's linear solver fails. The ground may be fixed to a body, on which the
reaction then acts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    MarkerNodeCoordinates,
    NodePointGround,
    ObjectConnectorCoordinateVector,
)
from numpy.typing import ArrayLike

from ...reference.surface import Surface, SurfaceFunction
from .attachment import INERTIAL_FRAME, Attachment, find_attachment, list_nodes, stack_frames
from .constraints import make_constraint_functions
from .library import hide_connector
from .pose import Frames

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

    Notes
    -----
    A solver ends with the engine's ModelError, which is a ValueError, if a wheel has no contact at the start, or if its
    gap there is longer than the free fall in the first step: closing it would take more than the weight. A centre is
    in place after it is moved by minus the gap along the normal, both from `velodrome.engines.rolling.observe_wheel`,
    until no gap is left.
    """
    count = _count_wheels(bodyNumbers)
    ground_surface = _check_surface(surface)
    centres = _read_vectors("axisPosition", axisPosition, count)
    axles = _read_vectors("axisVector", axisVector, count)
    wheels = [_offset(find_attachment(mbs, body), centre) for body, centre in zip(bodyNumbers, centres, strict=True)]
    ground = INERTIAL_FRAME if groundNumber is None else find_attachment(mbs, groundNumber)
    nodes = list_nodes([*wheels, ground])
    if not nodes:
        raise ValueError("nothing can roll: the wheels and their ground are all fixed")
    labels = [f"wheel {i} ({_name_item(number)})" for i, number in enumerate(bodyNumbers)]
    for label, wheel in zip(labels, wheels, strict=True):
        if _is_same_body(wheel, ground):
            raise ValueError(f"nothing can roll: {label} is fixed to the body or link that carries its ground")
    if len(nodes) > 2:
        raise ValueError(
            f"the wheels and their ground belong to {len(nodes)} nodes; the engine's connector joins at most two, so "
            "give each wheel a joint of its own"
        )
    radii = _read_radii(discRadius, count)
    if not (math.isfinite(newmarkRatio) and newmarkRatio > 0):
        raise ValueError(f"newmarkRatio is {newmarkRatio!r}; it must be a positive number, about 0.5")
    frames = stack_frames([*wheels, ground])
    triads = np.stack([_make_triad(axle) @ each.rotation.T for axle, each in zip(axles, wheels, strict=True)])
    order = _number_rows(constrainedAxes, count)
    joint = RollingJoint(None, tuple(nodes), frames, ground_surface, triads, radii, order)
    owner = f"rolling joint {name!r}" if name else "rolling joint"
    constraint, jacobian = make_constraint_functions(
        mbs, joint, newmarkRatio, [f"{label} of the {owner}" for label in labels]
    )
    item = ObjectConnectorCoordinateVector(
        name=name,
        markerNumbers=_add_markers(mbs, nodes),
        # It gives the number of rows; the functions do the rest.
        scalingMarker1=np.zeros((int(order.max()) + 1, 1)),
        constraintUserFunction=constraint,
        jacobianUserFunction=jacobian,
        activeConnector=activeConnector,
        visualization=hide_connector(),
    )
    return replace(joint, objectNumber=mbs.AddObject(item))


def slip_equations(mbs: exu.MainSystem, joint: RollingJoint) -> list[int]:
    """Return the indices of the slip rows among the algebraic equations of an assembled system."""
    equations = mbs.systemData.GetObjectLTGAE(joint.objectNumber)
    return [equations[row] for row in joint.order[:, SLIP_ROWS].ravel() if row >= 0]


def _count_wheels(wheels: Any) -> int:
    """Return the number of wheels; raise if they are not listed."""
    if isinstance(wheels, str) or not hasattr(wheels, "__len__"):
        raise ValueError(f"bodyNumbers is {wheels!r}; it must be a list, also of a single wheel")
    if len(wheels) == 0:
        raise ValueError("a rolling joint takes at least one wheel in bodyNumbers")
    return len(wheels)


def _check_surface(surface: Any) -> Surface:
    """Return a surface; raise if it is not an instance with a compiled height function."""
    if not isinstance(getattr(surface, "function", None), SurfaceFunction):
        raise ValueError(
            f"surface is {surface!r}; a rolling joint takes a surface of velodrome.reference.surface, such as Plane()"
        )
    return surface


def _name_item(number: Any) -> str:
    """Return the name of a body, node or marker in messages."""
    kind = type(number).__name__.removesuffix("Index").lower()
    return f"{kind if kind in ('node', 'marker') else 'body'} {int(number)}"


def _is_same_body(wheel: Attachment, ground: Attachment) -> bool:
    """Return whether a wheel and its ground are fixed to one body or link of a kinematic tree, or both at rest."""
    if len({None if each.node is None else int(each.node) for each in (wheel, ground)}) > 1:
        return False
    # The joints that lead to a link tell it apart from all others.
    return np.array_equal(wheel.path.joints, ground.path.joints)


def _read_radii(values: Any, wheels: int) -> np.ndarray:
    """Return the radii (k,) of wheels from one for all of them or one for each."""
    try:
        radii = np.asarray(values, float)
    except (TypeError, ValueError):
        radii = np.array(np.nan)
    if not (np.all(radii > 0) and np.all(np.isfinite(radii))):
        raise ValueError(f"discRadius is {values!r}; a wheel's radius is a positive number [m]")
    if radii.shape not in ((), (wheels,)):
        raise ValueError(f"discRadius is {values!r}; it must be one radius for all wheels, or one for each of {wheels}")
    return np.broadcast_to(radii, wheels).copy()


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
