"""Pose of a rigid frame as a function of its node's coordinates, and the Jacobians of its motion.

A frame is fixed to a body, or to a link of a kinematic tree, or to the ground. With the node's coordinates q, its
origin p(q) and its rotation A(q) move with

    p' = L q'        w = G q'

where L and G (3, n) are the frame's translational and rotational Jacobians, and w is the angular velocity in inertial
axes. The engine has them in its markers, but does not hand them to user functions, so they are computed here, for each
kind of node as the engine defines its coordinates:

    EULER_PARAMETERS   position and four Euler parameters
    ANGLES             position and angles about x, y and z, each turning the axes of the next
    ROTATION_VECTOR    position and rotation vector; the rates are the velocity and the local angular velocity, G = A
    PLANAR             position in the xy plane and the angle about z
    TREE               joint coordinates of a kinematic tree
    FIXED              none
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...reference.kernels.compilation import jit
from ...reference.kernels.vector import add, combine, cross
from .kernel import axes as euler_parameter_axes
from .kernel import rotate_vector

FIXED, EULER_PARAMETERS, ANGLES, ROTATION_VECTOR, PLANAR, TREE = range(6)
REVOLUTE, PRISMATIC = 0, 3  # joints turn about, or slide along, axis number joint - REVOLUTE or joint - PRISMATIC


class Frames(NamedTuple):
    """Frames of f bodies, and how they depend on n coordinates.

    Attributes
    ----------
    kinds : ndarray, shape (f,)
        The nodes' kinds.
    starts : ndarray, shape (f,)
        Indices of the nodes' first coordinates.
    sizes : ndarray, shape (f,)
        Numbers of the nodes' coordinates.
    positions : ndarray, shape (f, 3)
        Frames' origins in their bodies' axes [m]; of fixed frames in inertial axes.
    rotations : ndarray, shape (f, 3, 3)
        From the frames' axes to their bodies'; of fixed frames to inertial axes.
    lengths : ndarray, shape (f,)
        Numbers m of joints between the base of a tree and the link.
    joints : ndarray, shape (f, m, 2)
        Coordinate and type of each of these joints.
    offsets : ndarray, shape (f, m + 1, 3)
        The tree's base [m], then the joints' offsets from the links before them [m].
    turns : ndarray, shape (f, m, 3, 3)
        Rotations from the joints' axes to those of the links before them.
    """

    kinds: np.ndarray
    starts: np.ndarray
    sizes: np.ndarray
    positions: np.ndarray
    rotations: np.ndarray
    lengths: np.ndarray
    joints: np.ndarray
    offsets: np.ndarray
    turns: np.ndarray


@jit
def rotate_axes(body, matrix):
    """Return the unit vectors of axes that are the columns of a rotation ``matrix`` (3, 3) in a body's axes."""
    return (
        rotate_vector(body, matrix[:, 0]),
        rotate_vector(body, matrix[:, 1]),
        rotate_vector(body, matrix[:, 2]),
    )


@jit
def turn_axes(body, axis, angle):
    """Return the unit vectors of a body after a turn about its axis number ``axis``."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = body
    if axis == 0:
        return x, combine(c, y, s, z), combine(c, z, -s, y)
    if axis == 1:
        return combine(c, x, -s, z), y, combine(c, z, s, x)
    return combine(c, x, s, y), combine(c, y, -s, x), z


@jit
def rotation_vector_axes(v0, v1, v2):
    """Return unit vectors (x, y, z) of a body that is turned by a rotation vector (Rodrigues)."""
    square = v0 * v0 + v1 * v1 + v2 * v2
    angle = np.sqrt(square)
    # sin(a) / a and (1 - cos a) / a^2
    first = np.sin(angle) / angle if angle > 0 else 1.0
    second = 2 * (np.sin(0.5 * angle) / angle) ** 2 if angle > 0 else 0.5
    x = (1 - second * (v1 * v1 + v2 * v2), second * v0 * v1 + first * v2, second * v0 * v2 - first * v1)
    y = (second * v0 * v1 - first * v2, 1 - second * (v0 * v0 + v2 * v2), second * v1 * v2 + first * v0)
    z = (second * v0 * v2 + first * v1, second * v1 * v2 - first * v0, 1 - second * (v0 * v0 + v1 * v1))
    return x, y, z


@jit
def set_column(matrix, column, vector):
    """Set a column of a matrix (3, n)."""
    for i in range(3):
        matrix[i, column] = vector[i]


@jit
def follow_tree(frames, number, coordinates, linear, angular):
    """Return (origin, axes) of a link, and fill the columns of its joints in the Jacobians of that origin."""
    start, count = frames.starts[number], frames.lengths[number]
    joints, offsets, turns = frames.joints[number], frames.offsets[number], frames.turns[number]
    origin = (offsets[0, 0], offsets[0, 1], offsets[0, 2])
    body = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for i in range(count):
        origin = add(origin, rotate_vector(body, offsets[i + 1]))
        body = rotate_axes(body, turns[i])
        column, joint = start + joints[i, 0], joints[i, 1]
        if joint >= PRISMATIC:
            axis = body[joint - PRISMATIC]
            q = coordinates[column]
            origin = (origin[0] + q * axis[0], origin[1] + q * axis[1], origin[2] + q * axis[2])
            set_column(linear, column, axis)
        else:
            set_column(angular, column, body[joint - REVOLUTE])
            set_column(linear, column, origin)
            body = turn_axes(body, joint - REVOLUTE, coordinates[column])
    for i in range(count):
        if joints[i, 1] < PRISMATIC:
            column = start + joints[i, 0]
            axis = (angular[0, column], angular[1, column], angular[2, column])
            arm = (
                origin[0] - linear[0, column],
                origin[1] - linear[1, column],
                origin[2] - linear[2, column],
            )
            set_column(linear, column, cross(axis, arm))
    return origin, body


@jit
def locate_body(frames, number, coordinates, linear, angular):
    """Return (origin, unit vectors) of the body of a frame, and fill the Jacobians L and G (3, n) of its origin.

    Only the columns of the body's own node are filled.
    """
    kind, start = frames.kinds[number], frames.starts[number]
    linear[:, start : start + frames.sizes[number]] = 0.0
    angular[:, start : start + frames.sizes[number]] = 0.0
    body = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    if kind == FIXED:
        return (0.0, 0.0, 0.0), body
    if kind == TREE:
        return follow_tree(frames, number, coordinates, linear, angular)
    linear[0, start] = linear[1, start + 1] = 1.0
    if kind == PLANAR:
        set_column(angular, start + 2, body[2])
        return (coordinates[start], coordinates[start + 1], 0.0), turn_axes(body, 2, coordinates[start + 2])
    linear[2, start + 2] = 1.0
    origin = (coordinates[start], coordinates[start + 1], coordinates[start + 2])
    t0, t1, t2 = coordinates[start + 3], coordinates[start + 4], coordinates[start + 5]
    if kind == EULER_PARAMETERS:
        t3 = coordinates[start + 6]
        # w = G theta' is twice the vector part of theta' conj(theta).
        set_column(angular, start + 3, (-2 * t1, -2 * t2, -2 * t3))
        set_column(angular, start + 4, (2 * t0, 2 * t3, -2 * t2))
        set_column(angular, start + 5, (-2 * t3, 2 * t0, 2 * t1))
        set_column(angular, start + 6, (2 * t2, -2 * t1, 2 * t0))
        return origin, euler_parameter_axes(t0, t1, t2, t3)
    if kind == ANGLES:
        set_column(angular, start + 3, body[0])
        body = turn_axes(body, 0, t0)
        set_column(angular, start + 4, body[1])
        body = turn_axes(body, 1, t1)
        set_column(angular, start + 5, body[2])
        return origin, turn_axes(body, 2, t2)
    body = rotation_vector_axes(t0, t1, t2)
    for j in range(3):
        set_column(angular, start + 3 + j, body[j])
    return origin, body
