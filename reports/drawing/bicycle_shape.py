"""Meshes of the bicycle's four bodies, built from its parameters.

The equations contain two circles, a steering axis and four centres of mass. The tubes between them are
for display only, but they start and end where the parameters say: hubs, steering axis, fork offset.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...reference.bicycle import Bicycle

# Radii of the drawn tubes, relative to the mean wheel radius.
TYRE = 0.050
RIM = 0.028
TUBE = 0.052
STAY = 0.030
SPOKE = 0.011

SPOKES = 8  # at 20 rad/s and 60 frames/s a wheel turns 19 degrees a frame: far less than the 45 between spokes
SIDES = 12
DARK, PLAIN, LIGHT = 0.42, 1.0, 1.6


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh.

    Attributes
    ----------
    vertices, normals : ndarray, shape (n, 3)
        Positions [m] and outward unit normals.
    triangles : ndarray, shape (m, 3)
        Vertex indices, anticlockwise seen from outside.
    shade : ndarray, shape (n,)
        Factor on the colour: below 1 darkens, above 1 lightens towards white.
    """

    vertices: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    shade: np.ndarray

    def inflated(self, distance: float) -> Mesh:
        """Return the mesh with every point moved outwards by a distance [m].

        Bicycles drawn at the same place need different sizes, otherwise their surfaces flicker.
        """
        return Mesh(self.vertices + distance * self.normals, self.normals, self.triangles, self.shade)

    def coloured(self, colour: tuple[int, int, int]) -> np.ndarray:
        """Return the vertex colours for a body colour, shape (n, 3), uint8."""
        base = np.asarray(colour, float)
        dark = base * np.minimum(self.shade, 1)[:, None]
        light = (255 - base) * np.maximum(self.shade - 1, 0)[:, None]
        return np.clip(np.round(dark + light), 0, 255).astype(np.uint8)


def merge(meshes: Iterable[Mesh]) -> Mesh:
    """Join meshes into one."""
    meshes = list(meshes)
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=True)]),
        np.concatenate([mesh.shade for mesh in meshes]),
    )


def revolved(
    profile: np.ndarray, slope: np.ndarray, origin: np.ndarray, axis: np.ndarray, sides: int, shade: float
) -> Mesh:
    """Turn a profile about an axis.

    Parameters
    ----------
    profile, slope : ndarray, shape (k, 2)
        Points (distance from the axis, height along it) [m] and their outward unit normals.
    origin, axis : ndarray, shape (3,)
        Point where the height is zero [m]; unit vector.
    sides : int
        Number of points around the axis.
    shade : float
        See `Mesh`.
    """
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    angle = np.arange(sides) * 2 * np.pi / sides
    radial = np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second)
    vertices = origin + profile[:, None, :1] * radial + profile[:, None, 1:] * axis
    normals = slope[:, None, :1] * radial + slope[:, None, 1:] * axis
    i, j = np.meshgrid(np.arange(len(profile) - 1), np.arange(sides), indexing="ij")
    a, b = i * sides + j, i * sides + (j + 1) % sides
    c, d = a + sides, b + sides
    triangles = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, d), (a, d, c))])
    flat = vertices.reshape(-1, 3)
    return Mesh(flat, normals.reshape(-1, 3), triangles, np.full(len(flat), shade))


def torus(radius: float, thickness: float, axis: np.ndarray, shade: float = PLAIN) -> Mesh:
    """Make a ring about the origin from the radii of its centre line and of its section [m]."""
    around = np.linspace(0, 2 * np.pi, SIDES + 1)
    slope = np.column_stack([np.cos(around), np.sin(around)])
    return revolved([radius, 0.0] + thickness * slope, slope, np.zeros(3), axis, 64, shade)


def tube(start: np.ndarray, end: np.ndarray, thickness: float, shade: float = PLAIN, sides: int = SIDES) -> Mesh:
    """Make a tube with round ends and a radius between two points [m]."""
    length = float(np.linalg.norm(end - start))
    quarter = np.linspace(0, np.pi / 2, 4)
    around = np.concatenate([quarter - np.pi / 2, quarter])
    slope = np.column_stack([np.cos(around), np.sin(around)])
    profile = thickness * slope
    profile[len(quarter) :, 1] += length
    return revolved(profile, slope, start, (end - start) / length, sides, shade)


def ball(centre: np.ndarray, radius: float, shade: float = PLAIN) -> Mesh:
    """Make a sphere from its centre and radius [m]."""
    around = np.linspace(-np.pi / 2, np.pi / 2, 13)
    slope = np.column_stack([np.cos(around), np.sin(around)])
    return revolved(radius * slope, slope, centre, np.array([0.0, 0.0, 1.0]), 24, shade)


def _wheel_mesh(radius: float, size: float) -> Mesh:
    axle = np.array([0.0, 1.0, 0.0])
    # The tyre's outermost circle is the knife edge itself.
    tyre, rim = TYRE * size, RIM * size
    parts = [torus(radius - tyre, tyre, axle, DARK), torus(radius - 2 * tyre, rim, axle)]
    hub = 0.16 * size
    parts.append(tube(-hub * axle, hub * axle, 0.07 * size))
    for k, angle in enumerate(np.arange(SPOKES) * 2 * np.pi / SPOKES):
        outwards = np.array([math.sin(angle), 0.0, math.cos(angle)])
        flange = 0.12 * size * (1 if k % 2 else -1) * axle
        parts.append(tube(flange, (radius - 2 * tyre) * outwards, SPOKE * size, LIGHT, 6))
    # A single reflector, so that turns of the wheel can be counted.
    parts.append(ball(0.62 * radius * np.array([0.0, 0.0, 1.0]), 0.10 * size, LIGHT))
    return merge(parts)


def _along_steer_axis(bicycle: Bicycle, distance: float) -> np.ndarray:
    """Return the point of the steering axis at rest at a distance above D [m]."""
    return bicycle.reference_point + distance * bicycle.steer_axis


def _rear_frame_mesh(bicycle: Bicycle, size: float) -> Mesh:
    axle = np.array([0.0, 1.0, 0.0])
    hub = bicycle.centre("rear_wheel")
    crown = 1.14 * bicycle.front_wheel_radius
    head_low, head_high = (_along_steer_axis(bicycle, crown + rise * size) for rise in (0.08, 0.45))
    bracket = np.array([0.40 * bicycle.wheelbase, 0.0, 0.93 * bicycle.rear_wheel_radius])
    seat_direction = np.array([-math.sin(0.29), 0.0, math.cos(0.29)])
    seat_length = (head_high[2] - bracket[2]) / seat_direction[2]
    seat = bracket + seat_length * seat_direction
    saddle = seat + 0.30 * size * seat_direction
    parts = [
        tube(bracket, seat, TUBE * size),
        tube(seat, head_high, TUBE * size),
        tube(bracket, head_low, 1.15 * TUBE * size),
        tube(head_low, head_high, 1.3 * TUBE * size),
        tube(seat, saddle, 0.7 * TUBE * size),
        tube(bracket - 0.2 * size * axle, bracket + 0.2 * size * axle, 1.2 * TUBE * size, DARK),
    ]
    for side in (-0.17 * size * axle, 0.17 * size * axle):
        parts += [tube(hub + side, bracket + 0.5 * side, STAY * size), tube(hub + side, seat + 0.3 * side, STAY * size)]
    forward = np.array([size, 0.0, 0.0])
    nose, tail = saddle + 0.40 * forward, saddle - 0.28 * forward
    parts.append(tube(tail, nose, 0.10 * size, DARK))
    parts += [tube(tail + 0.2 * side * size * axle, nose, 0.07 * size, DARK) for side in (-1, 1)]
    # The rider is a rigid part of the rear frame, represented by its centre of mass.
    parts.append(ball(bicycle.centre("rear_frame"), 0.20 * size, LIGHT))
    return merge(parts)


def _front_frame_mesh(bicycle: Bicycle, size: float) -> Mesh:
    axle = np.array([0.0, 1.0, 0.0])
    hub = bicycle.centre("front_wheel")
    crown = 1.14 * bicycle.front_wheel_radius
    low, top = _along_steer_axis(bicycle, crown), _along_steer_axis(bicycle, crown + 0.62 * size)
    half = 0.17 * size * axle
    forward = np.cross(axle, bicycle.steer_axis)
    clamp = top + 0.22 * size * forward
    grip = 0.75 * size * axle
    parts = [
        tube(low, top, 0.8 * TUBE * size),
        tube(low - half, low + half, 0.9 * TUBE * size),
        tube(top, clamp, 0.8 * TUBE * size),
        tube(clamp - grip, clamp + grip, 0.75 * TUBE * size),
    ]
    parts += [tube(low + side, hub + side, STAY * size * 1.2) for side in (-half, half)]
    back = -0.35 * size * forward
    for side in (-grip, grip):
        parts += [tube(clamp + side, clamp + side + back, 0.75 * TUBE * size, DARK)]
    return merge(parts)


def body_meshes(bicycle: Bicycle) -> dict[str, Mesh]:
    """Make the mesh of each body in its own axes at rest, with the origin at its centre of mass.

    Parameters
    ----------
    bicycle : Bicycle

    Returns
    -------
    dict of str to Mesh
        Keys are `velodrome.reference.bicycle.BODIES`.
    """
    size = 0.5 * (bicycle.rear_wheel_radius + bicycle.front_wheel_radius)
    frames = {"rear_frame": _rear_frame_mesh(bicycle, size), "front_frame": _front_frame_mesh(bicycle, size)}
    meshes = {
        body: Mesh(mesh.vertices - bicycle.centre(body), mesh.normals, mesh.triangles, mesh.shade)
        for body, mesh in frames.items()
    }
    meshes["rear_wheel"] = _wheel_mesh(bicycle.rear_wheel_radius, size)
    meshes["front_wheel"] = _wheel_mesh(bicycle.front_wheel_radius, size)
    return meshes
