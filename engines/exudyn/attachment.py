"""What a rolling joint attaches to: bodies and rigid markers of an Exudyn model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import exudyn as exu
import numpy as np

from . import pose
from .library import read_total_coordinates

_RATES: Any = exu.OutputVariableType.Coordinates_t
_indices: Any = exu  # the library's type stubs lack the types of its indices

# Kinds of nodes by the engine's names, with the numbers of their coordinates.
_RIGID_NODES = {
    "RigidBodyEP": (pose.EULER_PARAMETERS, 7),
    "RigidBodyRxyz": (pose.ANGLES, 6),
    "RigidBodyRotVecLG": (pose.ROTATION_VECTOR, 6),
    "RigidBody2D": (pose.PLANAR, 3),
}
_BODIES = ("RigidBody", "RigidBody2D", "Ground")
_JOINTS = ("RevoluteX", "RevoluteY", "RevoluteZ", "PrismaticX", "PrismaticY", "PrismaticZ")


@dataclass(frozen=True)
class TreePath:
    """The joints from the base of a kinematic tree to one of its links; see `pose.Frames`."""

    joints: np.ndarray
    offsets: np.ndarray
    turns: np.ndarray


_NO_PATH = TreePath(np.zeros((0, 2), np.int64), np.zeros((1, 3)), np.zeros((0, 3, 3)))


@dataclass(frozen=True)
class Attachment:
    """A frame that is fixed to a body, to a link of a kinematic tree, or to the ground.

    Attributes
    ----------
    kind : int
        How it depends on its node; one of the kinds of `pose`.
    node : exudyn.NodeIndex or None
        Its node; None for the ground.
    size : int
        Number of the node's coordinates.
    position : ndarray, shape (3,)
        Its origin in the body's axes [m]; that of the ground in inertial axes.
    rotation : ndarray, shape (3, 3)
        From its axes to the body's; those of the ground to inertial axes.
    path : TreePath
        Joints that lead to the link.
    """

    kind: int
    node: Any = None
    size: int = 0
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    path: TreePath = _NO_PATH


INERTIAL_FRAME = Attachment(pose.FIXED)


def find_attachment(mbs: exu.MainSystem, number: Any) -> Attachment:
    """Find out what a body, a node or a marker is, and how its pose depends on coordinates.

    Parameters
    ----------
    mbs : exudyn.MainSystem
    number : exudyn.ObjectIndex, exudyn.NodeIndex or exudyn.MarkerIndex
        A rigid body, the ground, a rigid body's node, or a marker that is fixed to one of these or to a link of a
        kinematic tree. A plain number is that of an object.

    Raises
    ------
    ValueError
        If it has no pose, or one whose Jacobian cannot be computed from the coordinates of one node.
    """
    if isinstance(number, _indices.MarkerIndex):
        return _read_marker(mbs, number)
    if isinstance(number, _indices.NodeIndex):
        return _read_node(mbs, number, f"node {int(number)}")
    return _read_body(mbs, number)


def _read_marker(mbs: exu.MainSystem, number: Any) -> Attachment:
    marker: dict[str, Any] = mbs.GetMarker(number)
    if marker["markerType"] == "BodyRigid":
        return _place(_read_body(mbs, marker["bodyNumber"]), marker["localHT"])
    if marker["markerType"] == "NodeRigid":
        return _place(_read_node(mbs, marker["nodeNumber"], f"marker {int(number)}"), marker["localHT"])
    if marker["markerType"] == "KinematicTreeRigid":
        return _place(_read_link(mbs, marker["objectNumber"], marker["linkNumber"]), marker["localHT"])
    raise ValueError(
        f"marker {int(number)} is a Marker{marker['markerType']}; a rolling joint takes a MarkerBodyRigid, a "
        "MarkerNodeRigid or a MarkerKinematicTreeRigid, whose Jacobians depend on one node"
    )


def _read_body(mbs: exu.MainSystem, number: Any) -> Attachment:
    body: dict[str, Any] = mbs.GetObject(number)
    kind = body["objectType"]
    if kind == "KinematicTree":
        raise ValueError(
            f"object {int(number)} is a KinematicTree; give a MarkerKinematicTreeRigid, which names its link"
        )
    if kind not in _BODIES:
        raise ValueError(
            f"object {int(number)} is a {kind}; a rolling joint takes a RigidBody, a RigidBody2D or a Ground"
        )
    if kind == "Ground":
        return Attachment(
            pose.FIXED,
            position=np.array(body["referencePosition"], float),
            rotation=np.array(body["referenceRotation"], float),
        )
    return _read_node(mbs, body["nodeNumber"], f"body {int(number)}")


def _read_node(mbs: exu.MainSystem, number: Any, owner: str) -> Attachment:
    kind = mbs.GetNode(number)["nodeType"]
    if kind == "PointGround":
        return Attachment(pose.FIXED, position=np.array(mbs.GetNode(number)["referenceCoordinates"], float))
    if kind not in _RIGID_NODES:
        known = ", ".join(f"Node{name}" for name in _RIGID_NODES)
        raise ValueError(f"{owner} has a Node{kind}; a rolling joint takes a rigid body's node: {known}")
    family, size = _RIGID_NODES[kind]
    return Attachment(family, number, size)


def _read_link(mbs: exu.MainSystem, number: Any, link: int) -> Attachment:
    tree: dict[str, Any] = mbs.GetObject(number)
    path: list[int] = []
    while link >= 0:
        path.insert(0, link)
        link = tree["linkParents"][link]
    types = [tree["jointTypes"][i].name for i in path]
    for name in types:
        if name not in _JOINTS:
            raise ValueError(f"the kinematic tree {int(number)} has a joint of type {name}; there are {_JOINTS}")
    return Attachment(
        pose.TREE,
        tree["nodeNumber"],
        len(tree["jointTypes"]),
        path=TreePath(
            joints=np.array([[i, _JOINTS.index(name)] for i, name in zip(path, types, strict=True)], np.int64),
            offsets=np.array([tree["baseOffset"], *(tree["jointOffsets"][i] for i in path)], float),
            turns=np.array([tree["jointTransformations"][i] for i in path], float),
        ),
    )


def _place(carrier: Attachment, local: Any) -> Attachment:
    """Return the frame at a local homogeneous transformation (4, 4) of a body's frame."""
    placed = np.array(local, float).reshape(4, 4)
    return replace(
        carrier,
        position=carrier.position + carrier.rotation @ placed[:3, 3],
        rotation=carrier.rotation @ placed[:3, :3],
    )


def list_nodes(attachments: Sequence[Attachment]) -> list[Any]:
    """Return the different nodes of attachments, in their order."""
    found: dict[int, Any] = {}
    for each in attachments:
        if each.node is not None:
            found.setdefault(int(each.node), each.node)
    return list(found.values())


def reference_coordinates(mbs: exu.MainSystem, nodes: Sequence[Any]) -> np.ndarray:
    """Return the reference coordinates of nodes, one node after the other, shape (n,)."""
    return np.concatenate([np.atleast_1d(mbs.GetNode(node)["referenceCoordinates"]) for node in nodes])


def read_node_coordinates(mbs: Any, nodes: Sequence[Any], configuration: Any) -> np.ndarray:
    """Return the coordinates of nodes in a configuration, one node after the other, shape (n,)."""
    # The engine returns a number for a node with one coordinate.
    return np.concatenate([np.atleast_1d(read_total_coordinates(mbs, node, configuration)) for node in nodes])


def read_node_rates(mbs: Any, nodes: Sequence[Any], configuration: Any) -> np.ndarray:
    """Return the rates of the nodes' coordinates in a configuration, one node after the other, shape (n,)."""
    return np.concatenate([np.atleast_1d(mbs.GetNodeOutput(node, _RATES, configuration)) for node in nodes])


def stack_frames(attachments: Sequence[Attachment]) -> pose.Frames:
    """Collect attachments for compiled code; the coordinates are those of `list_nodes`, one node after the other."""
    starts, total = {}, 0
    for each in attachments:
        if each.node is not None and int(each.node) not in starts:
            starts[int(each.node)] = total
            total += each.size
    count, longest = len(attachments), max(len(each.path.joints) for each in attachments)
    frames = pose.Frames(
        kinds=np.array([each.kind for each in attachments]),
        starts=np.array([0 if each.node is None else starts[int(each.node)] for each in attachments]),
        sizes=np.array([each.size for each in attachments]),
        positions=np.array([each.position for each in attachments]),
        rotations=np.array([each.rotation for each in attachments]),
        lengths=np.array([len(each.path.joints) for each in attachments]),
        joints=np.zeros((count, longest, 2), np.int64),
        offsets=np.zeros((count, longest + 1, 3)),
        turns=np.zeros((count, longest, 3, 3)),
    )
    for i, each in enumerate(attachments):
        length = len(each.path.joints)
        frames.joints[i, :length], frames.turns[i, :length] = each.path.joints, each.path.turns
        frames.offsets[i, : length + 1] = each.path.offsets
    return frames
