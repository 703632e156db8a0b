"""The Python interface to circular motions, their families and critical bowls."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ...reference.bicycle import Bicycle
from ...reference.inputs import Inputs
from ...reference.surface import Surface
from ..motions import (
    CircularSolution,
    CriticalShapes,
    SolutionFamilies,
    find_critical_shapes,
    follow_families,
    search_bound,
    solve_circular,
)
from ..scenario import make_bowl
from .arguments import (
    read_bicycle,
    read_family,
    read_ground,
    read_inputs,
    read_near,
    read_number,
    read_progress,
)


def circular(
    *,
    rear_rate: float,
    alpha: float | None = None,
    surface: Surface | str | None = None,
    family: int | None = None,
    near: tuple[float, float] | None = None,
    bicycle: Bicycle | str | Path | None = None,
    inputs: Inputs | None = None,
    within: bool = False,
) -> CircularSolution:
    """Compute one circular motion, hands-free or with constant inputs, its contact forces and its stability.

    Parameters
    ----------
    rear_rate : float
        Rate of the rear wheel, positive [rad/s].
    alpha : float, optional
        Shape of the bowl z = alpha (x^2 + y^2) [1/m]; 0 is the level plane. Either this or ``surface`` is needed.
    surface : Surface or str, optional
        Another surface of revolution about z, such as ``Sphere(20.0)``, or the text that names it on the command line,
        such as ``"sphere:radius=20"``.
    family : int, optional
        Solution family, 1 to 4. Either this or ``near`` is needed; both if the family has several motions.
    near : tuple of float, optional
        Lean and steer that the motion is near to [rad]; on the level plane (0, 0) is straight motion.
    bicycle : Bicycle, str or Path, optional
        A bicycle, or a bicycle file as `velodrome bicycle` reads it; the benchmark bicycle if not given.
    inputs : Inputs, optional
        Torques and steer damping that are held; none if not given. With a steer torque the families have no numbers,
        and ``near`` is needed.
    within : bool
        Search for the unstable orbit that bounds a stable motion, too; this takes some seconds.

    Returns
    -------
    CircularSolution

    Raises
    ------
    MissingMotionError
        If there is no such motion.
    ScenarioError
        If an argument has a wrong type or value, or the ground is given twice, not at all or
        is no surface of revolution.

    Examples
    --------
    >>> import velodrome
    >>> found = velodrome.circular(alpha=0.005, rear_rate=18.0, family=2)
    >>> found.lyapunov_stable
    True
    >>> round(found.motion.lean, 5), round(found.motion.steer, 5)
    (0.73744, 2.83701)
    """
    ground = make_bowl(read_ground(alpha, surface))
    rate = read_number("rear_rate", rear_rate, "rad/s")
    made = read_bicycle(bicycle)
    found = solve_circular(made, ground, rate, read_family(family), read_near(near), read_inputs(inputs))
    return search_bound(found) if within else found


def families(
    *,
    alpha: float | None = None,
    surface: Surface | str | None = None,
    bicycle: Bicycle | str | Path | None = None,
    inputs: Inputs | None = None,
    within: bool = False,
) -> SolutionFamilies:
    """Follow the four families of circular motions, with special points and stable sections.

    Parameters
    ----------
    alpha : float, optional
        Shape of the bowl z = alpha (x^2 + y^2) [1/m]; 0 is the level plane. Either this or ``surface`` is needed.
    surface : Surface or str, optional
        Another surface of revolution about z, or the text that names it, such as ``"sphere:radius=20"``.
    bicycle : Bicycle, str or Path, optional
        A bicycle, or a bicycle file as `velodrome bicycle` reads it; the benchmark bicycle if not given.
    inputs : Inputs, optional
        Torques and steer damping that are held; none if not given. With a steer torque no curve has a number.
    within : bool
        Search for the unstable orbits that bound stable circles, too; this takes some seconds for each stable section.

    Returns
    -------
    SolutionFamilies

    Raises
    ------
    ScenarioError
        If an argument has a wrong type or value, or the ground is given twice, not at all or is no surface of
        revolution.

    Examples
    --------
    >>> import velodrome
    >>> found = velodrome.families(alpha=0.005)
    >>> [curve.number for curve in found.curves][:4]
    [1, 2, 3, 4]
    >>> found.curves[1].samples.lean.shape == found.curves[1].samples.rear_rate.shape
    True
    """
    ground, held = make_bowl(read_ground(alpha, surface)), read_inputs(inputs)
    return follow_families(read_bicycle(bicycle), ground, held, within=within)


def critical(
    *, bicycle: Bicycle | str | Path | None = None, progress: Callable[[str, float, float], None] | None = None
) -> CriticalShapes:
    """Compute the critical shapes of the paraboloid; this takes half a minute.

    They are the alpha at which families exchange parts and at which a family's last stable section vanishes.

    Parameters
    ----------
    bicycle : Bicycle, str or Path, optional
        A bicycle, or a bicycle file as `velodrome bicycle` reads it; the benchmark bicycle if not given.
    progress : callable, optional
        Called with the name of the stage, the value reached and the largest value.

    Returns
    -------
    CriticalShapes

    Raises
    ------
    ScenarioError
        If an argument has a wrong type.
    """
    watch = read_progress(progress)
    return find_critical_shapes(read_bicycle(bicycle), watch)
