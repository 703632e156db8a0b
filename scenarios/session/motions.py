"""Circular motions, their families and critical bowls from Python."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Real

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.surface import Surface
from ..error import ScenarioError
from ..motions import (
    CircularSolution,
    CriticalShapes,
    SolutionFamilies,
    find_critical_shapes,
    follow_families,
    solve_circular,
)
from ..scenario import make_bowl, show_value


def circular(
    *,
    rear_rate: float,
    alpha: float | None = None,
    surface: Surface | None = None,
    family: int | None = None,
    near: tuple[float, float] | None = None,
    bicycle: Bicycle | None = None,
) -> CircularSolution:
    """Compute one hands-free circular motion, its contact forces and its stability.

    Parameters
    ----------
    rear_rate : float
        Rate of the rear wheel, positive [rad/s].
    alpha : float, optional
        Shape of the bowl z = alpha (x^2 + y^2) [1/m]; 0 is the level plane. Either this or ``surface`` is needed.
    surface : Surface, optional
        Another surface of revolution about z, such as ``Sphere(20.0)``.
    family : int, optional
        Solution family, 1 to 4. Either this or ``near`` is needed; both where a family has several motions.
    near : tuple of float, optional
        Lean and steer that the motion is near to [rad].
    bicycle : Bicycle, optional
        The benchmark bicycle if not given.

    Returns
    -------
    CircularSolution

    Raises
    ------
    ScenarioError
        If there is no such motion, an argument is of another type, or the ground is given twice, not at all or is no
        surface of revolution.

    Examples
    --------
    >>> import velodrome
    >>> found = velodrome.circular(alpha=0.005, rear_rate=18.0, family=2)
    >>> found.lyapunov_stable
    True
    >>> round(found.motion.lean, 5), round(found.motion.steer, 5)
    (0.73744, 2.83701)
    """
    ground = make_bowl(_ground(alpha, surface))
    if not isinstance(rear_rate, Real):
        raise ScenarioError(f"rear_rate must be a number; it is {show_value(repr(rear_rate))}")
    if near is not None and not (np.shape(near) == (2,) and all(isinstance(angle, Real) for angle in near)):
        raise ScenarioError(f"near must be two numbers, lean and steer; it is {show_value(repr(near))}")
    return solve_circular(_require_bicycle(bicycle), ground, rear_rate, family, near)


def families(
    *, alpha: float | None = None, surface: Surface | None = None, bicycle: Bicycle | None = None
) -> SolutionFamilies:
    """Follow the four families of circular motions, with special points and stable sections.

    Parameters
    ----------
    alpha : float, optional
        Shape of the bowl z = alpha (x^2 + y^2) [1/m]; 0 is the level plane. Either this or ``surface`` is needed.
    surface : Surface, optional
        Another surface of revolution about z.
    bicycle : Bicycle, optional
        The benchmark bicycle if not given.

    Returns
    -------
    SolutionFamilies

    Raises
    ------
    ScenarioError
        If the ground is given twice, not at all or is no surface of revolution.

    Examples
    --------
    >>> import velodrome
    >>> found = velodrome.families(alpha=0.005)
    >>> [curve.number for curve in found.curves][:4]
    [1, 2, 3, 4]
    >>> found.curves[1].samples.lean.shape == found.curves[1].samples.rear_rate.shape
    True
    """
    return follow_families(_require_bicycle(bicycle), make_bowl(_ground(alpha, surface)))


def critical(
    *, bicycle: Bicycle | None = None, progress: Callable[[str, float, float], None] | None = None
) -> CriticalShapes:
    """Compute the critical shapes of the paraboloid; this takes half a minute.

    They are the alpha at which families exchange parts and at which a family's last stable section vanishes.

    Parameters
    ----------
    bicycle : Bicycle, optional
        The benchmark bicycle if not given.
    progress : callable, optional
        Called with what is looked for, the value reached and the largest.

    Returns
    -------
    CriticalShapes
    """
    return find_critical_shapes(bicycle or Bicycle(), progress or _say_nothing)


def _say_nothing(*_: object) -> None:
    """Take the place of a progress bar."""


def _require_bicycle(bicycle: Bicycle | None) -> Bicycle:
    if bicycle is None:
        return Bicycle()
    if not isinstance(bicycle, Bicycle):
        raise ScenarioError(f"bicycle must be a velodrome.Bicycle; it is {show_value(repr(bicycle))}")
    return bicycle


def _ground(alpha: float | None, surface: Surface | None) -> Surface | float:
    if alpha is not None and surface is None:
        if not isinstance(alpha, Real):
            raise ScenarioError(f"alpha must be a number; it is {show_value(repr(alpha))}")
        return float(alpha)
    if surface is not None and alpha is None:
        if not isinstance(surface, Surface):
            raise ScenarioError(f"surface must be a surface such as Sphere(20.0); it is {show_value(repr(surface))}")
        return surface
    raise ScenarioError("give the bowl by one of alpha and surface, such as alpha=0.005 or surface=Sphere(20.0)")
