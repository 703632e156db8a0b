"""Bowls of simple shapes: sphere, cone and torus, each a surface of revolution about z."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .kernels.revolution import of_radius, of_square
from .surface import Plane, SurfaceFunction, SurfaceOfRevolution, is_number, surface_function


@surface_function
def _sphere(x, y, parameters):
    k = parameters[0]
    s = x * x + y * y
    inside = 1 - k * k * s
    # The square root of a negative number is imaginary, not nan, for complex arguments.
    w = np.sqrt(inside) if inside.real > 0 else np.nan + 0 * x
    return of_square(x, y, k * s / (1 + w), k / (2 * w), k * k * k / (4 * w * w * w))


@surface_function
def _cone(x, y, parameters):
    slope, rounding = parameters[0], parameters[1]
    s = x * x + y * y
    w = np.sqrt(s + rounding * rounding)
    return of_square(x, y, slope * s / (w + rounding), slope / (2 * w), -slope / (4 * w * w * w))


@surface_function
def _torus(x, y, parameters):
    k, ring = parameters[0], parameters[1]
    r = np.sqrt(x * x + y * y)
    d = r - ring
    inside = 1 - k * k * d * d
    w = np.sqrt(inside) if inside.real > 0 else np.nan + 0 * x
    return of_radius(x, y, r, k * d * d / (1 + w), k * d / w, k / (w * w * w))


_SHARPEST = 1e-100  # rounding of a cone's tip [m]


def _number_error(name: str, value: object, what: str) -> ValueError:
    return ValueError(f"{name} is {value!r}; it must be a finite number {what}")


@dataclass(frozen=True)
class Sphere:
    """The lower half of a sphere, z = R - sqrt(R^2 - r^2); there is no ground at and beyond its equator.

    Near the axis it differs from the paraboloid of alpha = 1 / (2 R) by r^4 / (8 R^3).

    Parameters
    ----------
    radius : float
        R [m].

    Raises
    ------
    ValueError
        If the radius is not positive and finite.
    """

    radius: float

    def __post_init__(self) -> None:
        if not (is_number(self.radius) and self.radius > 0):
            raise _number_error("radius", self.radius, "> 0")

    @property
    def function(self) -> SurfaceFunction:
        """The height function."""
        return _sphere

    @property
    def parameters(self) -> np.ndarray:
        """Array of the curvature 1 / R, shape (1,)."""
        return np.array([1 / self.radius])

    @property
    def extent(self) -> tuple[float, float]:
        """Radii of the ground, from the axis to the equator [m]."""
        return 0.0, float(self.radius)

    def flattened(self, fraction: float) -> SurfaceOfRevolution:
        """Return the sphere with a fraction of the curvature."""
        return Sphere(self.radius / fraction) if fraction > 0 else Plane()


@dataclass(frozen=True)
class Cone:
    """A cone with a rounded tip, z = slope (sqrt(r^2 + rounding^2) - rounding).

    Near the axis it is the paraboloid of alpha = slope / (2 rounding); where r >> rounding it is a cone.
    A sharp tip has no normal, and a wheel's contact there would be undefined, so the tip is always rounded.

    Parameters
    ----------
    slope : float
        Slope far from the axis [-].
    rounding : float
        Scale of the rounded part [m].

    Raises
    ------
    ValueError
        If one of them is not positive and finite, or the rounding is below 1e-100 m.
    """

    slope: float
    rounding: float

    def __post_init__(self) -> None:
        for name in ("slope", "rounding"):
            value = getattr(self, name)
            if not (is_number(value) and value > 0):
                raise _number_error(name, value, "> 0")
        if self.rounding < _SHARPEST:
            raise _number_error("rounding", self.rounding, f">= {_SHARPEST!r}: the square of a smaller one underflows")

    @property
    def function(self) -> SurfaceFunction:
        """The height function."""
        return _cone

    @property
    def parameters(self) -> np.ndarray:
        """Slope and rounding, shape (2,)."""
        return np.array([float(self.slope), float(self.rounding)])

    @property
    def extent(self) -> tuple[float, float]:
        """Radii of the ground [m]; it has no edge."""
        return 0.0, math.inf

    @property
    def bend(self) -> float:
        """The tip's curvature, slope / rounding [1/m]."""
        return self.slope / self.rounding

    def flattened(self, fraction: float) -> SurfaceOfRevolution:
        """Return the cone with a fraction of the slope."""
        return Cone(fraction * self.slope, self.rounding) if fraction > 0 else Plane()


@dataclass(frozen=True)
class Torus:
    """A circular trough, the lower half of a torus: z = tube - sqrt(tube^2 - (r - ring)^2).

    The bottom of the trough is the circle r = ring at z = 0. From there the ground rises both ways and ends where it
    is vertical, at r = ring +- tube. If the tube is wider than the ring, the inner slope meets itself on the axis in a
    tip, which has no normal; with ring = 0 this is the sphere.

    Parameters
    ----------
    ring : float
        Radius of the tube's centre line [m].
    tube : float
        Radius of the tube [m].

    Raises
    ------
    ValueError
        If the ring is negative, the tube not positive, or one of them not finite.
    """

    ring: float
    tube: float

    def __post_init__(self) -> None:
        if not (is_number(self.ring) and self.ring >= 0):
            raise _number_error("ring", self.ring, ">= 0")
        if not (is_number(self.tube) and self.tube > 0):
            raise _number_error("tube", self.tube, "> 0")

    @property
    def function(self) -> SurfaceFunction:
        """The height function."""
        return _torus

    @property
    def parameters(self) -> np.ndarray:
        """The tube's curvature 1 / tube, and the ring, shape (2,)."""
        return np.array([1 / self.tube, float(self.ring)])

    @property
    def extent(self) -> tuple[float, float]:
        """Radii of the ground, from the inner vertical wall, or the axis, to the outer one [m]."""
        return max(0.0, float(self.ring - self.tube)), float(self.ring + self.tube)

    def flattened(self, fraction: float) -> SurfaceOfRevolution:
        """Return the torus with a fraction of the tube's curvature, around the same ring."""
        return Torus(self.ring, self.tube / fraction) if fraction > 0 else Plane()
