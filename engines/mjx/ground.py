"""Heights of the surfaces that JAX can differentiate: those with a closed form.

The suite's surfaces are compiled by numba, whose functions JAX cannot call inside its own compiled code. The functions
here use arithmetic alone, so that they take Python's, numpy's and JAX's numbers. Where there is no ground they are nan.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...reference.bowls import Cone, Sphere, Torus
from ...reference.profile import PolynomialProfile
from ...reference.surface import InclinedPlane, Paraboloid, Plane, Surface, is_level
from ..engine import UnsuitableProblem

# A height f(x, y, parameters) [m], with the parameters of the surface.
Height = Callable[[Any, Any, Any], Any]


def _inclined_plane(x: Any, y: Any, parameters: Any) -> Any:
    return parameters[0] * x + parameters[1] * y


def _paraboloid(x: Any, y: Any, parameters: Any) -> Any:
    return parameters[0] * (x * x + y * y)


def _polynomial(x: Any, y: Any, parameters: Any) -> Any:
    s, height = x * x + y * y, 0.0
    for k in range(len(parameters) - 1, -1, -1):
        height = height * s + parameters[k]
    return height


def _sphere(x: Any, y: Any, parameters: Any) -> Any:
    k, s = parameters[0], x * x + y * y
    return k * s / (1 + (1 - k * k * s) ** 0.5)


def _cone(x: Any, y: Any, parameters: Any) -> Any:
    slope, rounding = parameters[0], parameters[1]
    s = x * x + y * y
    return slope * s / ((s + rounding * rounding) ** 0.5 + rounding)


def _torus(x: Any, y: Any, parameters: Any) -> Any:
    k, d = parameters[0], (x * x + y * y) ** 0.5 - parameters[1]
    return k * d * d / (1 + (1 - k * k * d * d) ** 0.5)


_HEIGHTS: dict[type, Height] = {
    InclinedPlane: _inclined_plane,
    Paraboloid: _paraboloid,
    PolynomialProfile: _polynomial,
    Sphere: _sphere,
    Cone: _cone,
    Torus: _torus,
}


def choose_height(surface: Surface) -> Height | None:
    """Return the height function of a surface; None for level ground, where nothing has to be searched.

    Raises
    ------
    UnsuitableProblem
        If the surface has no closed form that is known here.
    """
    if is_level(surface):
        return None
    height = _HEIGHTS.get(type(surface))
    if height is None:
        known = ", ".join(kind.__name__ for kind in (Plane, *_HEIGHTS))
        raise UnsuitableProblem(
            f"MJX cannot ride on a {type(surface).__name__}: JAX needs a closed form of the ground, one of {known}"
        )
    return height
