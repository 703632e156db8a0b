"""Surfaces z = f(x, y), described by their height, gradient and Hessian.

A surface consists of a pair of compiled functions (real, and complex for the complex step) and an array of
parameters, so a kernel is compiled once and takes any surface as data. Where there is no ground (beyond
the rim of a sphere, outside a grid of heights) the functions return nan, and Newton's method and the integrators
stop there.

This module has the level plane and the paper's paraboloid; `bowls`, `profile` and `height_field` have further surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, TypeGuard, runtime_checkable

import numpy as np
from numba import types

from .kernels.compilation import compile_callback, jit

_PARAMETERS = types.Array(types.float64, 1, "C")


def _signature(scalar: Any) -> Any:
    return types.UniTuple(scalar, 6)(scalar, scalar, _PARAMETERS)


@dataclass(frozen=True)
class SurfaceFunction:
    """A height function, compiled for real and for complex arguments when first used.

    Attributes
    ----------
    source : callable
        The function as passed to `surface_function`.
    cached : bool
        Whether the compiled code is kept on disk; that of a closure cannot be.
    """

    source: Callable[..., tuple[Any, ...]]
    cached: bool = True

    @cached_property
    def real(self) -> Any:
        """Compiled for real x and y."""
        return compile_callback(_signature(types.float64), cache=self.cached)(self.source)

    @cached_property
    def complex(self) -> Any:
        """Compiled for complex x and y."""
        return compile_callback(_signature(types.complex128), cache=self.cached)(self.source)


def surface_function(function: Callable[..., tuple[Any, ...]]) -> SurfaceFunction:
    """Prepare ``function(x, y, parameters) -> (f, fx, fy, fxx, fxy, fyy)`` for compilation into the kernels.

    All six results must have the type of ``x`` (write ``0 * x`` for a zero), and the function must be
    analytic: no `abs`, no comparison of ``x`` or ``y`` other than of their real parts.

    Parameters
    ----------
    function : callable
        Height [m], gradient [-] and Hessian [1/m] at (x, y) [m], in numba's subset of Python; nan where
        there is no ground.

    Returns
    -------
    SurfaceFunction
    """
    return SurfaceFunction(function)


@runtime_checkable
class Surface(Protocol):
    """Any smooth ground z = f(x, y), with gravity along -z.

    Two optional properties are used when the whole rim of a wheel is searched (`velodrome.reference.rim`): ``bend``, an
    upper bound of the largest eigenvalue of the Hessian anywhere [1/m], which saves most of the search, and ``detail``,
    the length within which the ground does not bend to and fro [m], which determines the number of samples where it is
    less than a wheel's radius.
    """

    @property
    def function(self) -> SurfaceFunction:
        """The compiled height function."""
        ...

    @property
    def parameters(self) -> np.ndarray:
        """Parameters of the function, shape (k,), float64; all zero if and only if the surface is the level plane."""
        ...


@runtime_checkable
class SurfaceOfRevolution(Surface, Protocol):
    """Ground z = g(r) about the z axis, on which circular motions exist."""

    @property
    def extent(self) -> tuple[float, float]:
        """Smallest and largest radius r where there is ground [m]."""
        ...

    def flattened(self, fraction: float) -> SurfaceOfRevolution:
        """Return the ground between the level plane (fraction 0) and this one (fraction 1), smooth in the fraction."""
        ...


@surface_function
def _paraboloid(x, y, parameters):
    alpha = parameters[0]
    curvature = 2 * alpha + 0 * x
    return alpha * (x * x + y * y), 2 * alpha * x, 2 * alpha * y, curvature, 0 * x, curvature


@surface_function
def _plane(x, y, parameters):
    zero = 0 * x
    return zero, zero, zero, zero, zero, zero


@dataclass(frozen=True)
class Plane:
    """The horizontal plane z = 0."""

    @property
    def function(self) -> SurfaceFunction:
        """The compiled height function."""
        return _plane

    @property
    def parameters(self) -> np.ndarray:
        """One unused entry, shape (1,); the plane has no parameters."""
        return np.zeros(1)

    @property
    def extent(self) -> tuple[float, float]:
        """Radii of the ground [m]; it has no edge."""
        return 0.0, math.inf

    @property
    def bend(self) -> float:
        """Largest eigenvalue of the Hessian, 0 [1/m]."""
        return 0.0

    def flattened(self, fraction: float) -> Plane:
        """Return the plane itself, which is level."""
        return self


@surface_function
def _inclined_plane(x, y, parameters):
    zero = 0 * x
    fx, fy = parameters[0] + zero, parameters[1] + zero
    return parameters[0] * x + parameters[1] * y, fx, fy, zero, zero, zero


@dataclass(frozen=True)
class InclinedPlane:
    """A plane through the origin that rises in one direction.

    Parameters
    ----------
    slope : float
        Rise over run, not negative [-].
    direction : float
        Direction in which it rises, from the x axis towards y [rad].

    Raises
    ------
    ValueError
        If the slope is negative or a value is not finite.
    """

    slope: float
    direction: float = 0.0

    def __post_init__(self) -> None:
        if not (is_number(self.slope) and self.slope >= 0):
            raise ValueError(f"slope is {self.slope!r}; it must be a finite number >= 0")
        if not is_number(self.direction):
            raise ValueError(f"direction is {self.direction!r}; it must be a finite number of rad")

    @property
    def function(self) -> SurfaceFunction:
        """The compiled height function."""
        return _inclined_plane

    @property
    def parameters(self) -> np.ndarray:
        """Gradient of the height, shape (2,)."""
        return self.slope * np.array([math.cos(self.direction), math.sin(self.direction)])

    @property
    def bend(self) -> float:
        """Largest eigenvalue of the Hessian, 0 [1/m]."""
        return 0.0


@dataclass(frozen=True)
class Paraboloid:
    """The bowl z = alpha (x^2 + y^2) of Xiong et al. (2020), section 3.1.

    Parameters
    ----------
    alpha : float
        Shape parameter [1/m]; 0 gives the plane.

    Raises
    ------
    ValueError
        If alpha is negative or not finite.
    """

    alpha: float

    def __post_init__(self) -> None:
        if not (is_number(self.alpha) and self.alpha >= 0):
            raise ValueError(f"alpha is {self.alpha!r}; it must be a finite number >= 0")

    @property
    def function(self) -> SurfaceFunction:
        """The compiled height function."""
        return _paraboloid

    @property
    def parameters(self) -> np.ndarray:
        """Array of alpha, shape (1,)."""
        return np.array([float(self.alpha)])

    @property
    def extent(self) -> tuple[float, float]:
        """Radii of the ground [m]; it has no edge."""
        return 0.0, math.inf

    @property
    def bend(self) -> float:
        """Largest eigenvalue of the Hessian, 2 alpha everywhere [1/m]."""
        return 2.0 * self.alpha

    def flattened(self, fraction: float) -> Paraboloid:
        """Return the paraboloid with a fraction of alpha."""
        return Paraboloid(fraction * self.alpha)


_revolving: dict[type, bool] = {}


def is_of_revolution(surface: object) -> TypeGuard[SurfaceOfRevolution]:
    """Return whether a surface is one of revolution, as all surfaces of its class are, or none.

    The same as ``isinstance`` with the protocol, which takes a tenth of a millisecond.
    """
    kind = type(surface)
    if kind not in _revolving:
        _revolving[kind] = isinstance(surface, SurfaceOfRevolution)
    return _revolving[kind]


def is_number(value: object) -> bool:
    """Return whether a value is a finite real number and not a bool."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def is_level(surface: Surface) -> bool:
    """Return whether a surface is the plane z = 0: only its parameters are all zero."""
    return not np.any(surface.parameters)


@jit
def _evaluate(function, parameters, x, y):
    out = np.empty((x.size, 6))
    for i in range(x.size):
        f, fx, fy, fxx, fxy, fyy = function(x[i], y[i], parameters)
        out[i, 0], out[i, 1], out[i, 2] = f, fx, fy
        out[i, 3], out[i, 4], out[i, 5] = fxx, fxy, fyy
    return out


def evaluate(surface: Surface, x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray:
    """Evaluate height, gradient and Hessian at points.

    Parameters
    ----------
    surface : Surface
    x, y : ndarray or float
        Coordinates of any common shape (...) [m].

    Returns
    -------
    ndarray, shape (..., 6)
        f [m], fx, fy [-], fxx, fxy, fyy [1/m].
    """
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    flat = _evaluate(surface.function.real, surface.parameters, x.ravel(), y.ravel())
    return flat.reshape(*x.shape, 6)


def has_tip(surface: SurfaceOfRevolution) -> bool:
    """Return whether a surface's profile meets the axis at an angle: there it has a height, but no normal."""
    return surface.extent[0] == 0 and not np.all(np.isfinite(evaluate(surface, 0.0, 0.0)))


def unit_normals(surface: Surface, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Compute upward unit normals of a surface, shape (..., 3), at coordinates of any common shape [m]."""
    values = evaluate(surface, x, y)
    normal = np.stack([-values[..., 1], -values[..., 2], np.ones_like(values[..., 0])], axis=-1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)
