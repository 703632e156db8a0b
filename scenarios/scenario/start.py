"""Computation of a scenario's start: the motion is computed, disturbed and projected onto the constraints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...engines.engine import Problem
from ...reference.bicycle import Bicycle
from ...reference.circular import CircularMotion
from ...reference.dae import consistent_state
from ...reference.families import find_motion
from ...reference.kinematics import LEAN, REAR_ANGLE, STEER, YAW, body_positions
from ...reference.missing_motion import NoSuchMotion, SearchFailed
from ...reference.regularity import require_inertia
from ...reference.rideability import require_standing
from ...reference.rim import require_clear_rims
from ...reference.stability import growth_rate, linearise
from ...reference.surface import Plane, Surface, SurfaceOfRevolution, evaluate
from ...reference.wheel_overlap import require_separate_wheels
from ..error import MissingMotionError, ScenarioError
from .schema import CircularTable, Scenario, Simulation, UprightTable
from .surfaces import make_bowl

# Runs that disturb the same motion in different ways share its computation.
_find_motion = lru_cache(maxsize=256)(find_motion)


@dataclass(frozen=True)
class Start:
    """A problem, and the motion that it starts from.

    Attributes
    ----------
    problem : Problem
    undisturbed : tuple of ndarray, shapes (9,)
        Coordinates and rates before the perturbation.
    family : int or None
        Family of the circular motion; None for an upright start.
    motion : CircularMotion or None
        None for an upright start.
    growth_rate : float
        Largest real part of the motion's eigenvalues that symmetry does not fix [1/s]. On ground without symmetry,
        where no motion is steady, the value is that of the same start on the level plane. Of a straight start with
        torques, which is not steady either, it is that of the equations frozen at the start.
    size : float
        Radius of the circle of D, or the wheelbase for a straight start [m].
    """

    problem: Problem
    undisturbed: tuple[np.ndarray, np.ndarray]
    family: int | None
    motion: CircularMotion | None
    growth_rate: float
    size: float


def make_start(scenario: Scenario) -> Start:
    """Compute a scenario's start.

    Raises
    ------
    MissingMotionError
        If there is no such motion.
    ScenarioError
        If its disturbed state cannot be reached, has a rim inside the ground, wheels that overlap, or singular
        equations.
    """
    bicycle, surface = scenario.make_bicycle(), scenario.surface.make()
    try:
        # Unrealistic parameters may overflow in between; the results are checked.
        with np.errstate(all="ignore"):
            family, motion, q, qd = _compute_undisturbed(scenario, bicycle, surface)
            require_inertia(bicycle, surface, q)
            rate = _compute_growth_rate(scenario, bicycle, surface, q, qd)
            undisturbed, (q, qd) = (q, qd), _disturb_state(scenario, bicycle, surface, q, qd)
            require_inertia(bicycle, surface, q)
            require_clear_rims(bicycle, surface, q)
            require_separate_wheels(bicycle, q)
    except (NoSuchMotion, SearchFailed) as error:
        raise describe_missing_motion(error, "motion: ") from error
    except (ValueError, ArithmeticError) as error:
        raise ScenarioError(f"motion: {error}") from error
    times = output_times(scenario.simulation)
    size = float(np.hypot(*motion.position[:2])) if motion is not None else bicycle.wheelbase
    problem = Problem(bicycle, surface, q, qd, times, scenario.make_inputs(), scenario.simulation.beyond_fall)
    return Start(problem, undisturbed, family, motion, rate, size)


def describe_missing_motion(error: NoSuchMotion | SearchFailed, place: str = "") -> MissingMotionError:
    """Return the error for users of a search without a result; ``place`` precedes its message."""
    message = f"{place}{error}"
    return MissingMotionError(message, "no-such-motion" if isinstance(error, NoSuchMotion) else "search-failed")


def output_times(simulation: Simulation) -> np.ndarray:
    """Return the times of the samples that a scenario asks for, shape (n,) [s]."""
    samples = round(simulation.duration * simulation.output_rate)
    # Each time is rounded once: i / rate, not a sum of steps.
    return np.arange(samples + 1) / simulation.output_rate


def _compute_growth_rate(
    scenario: Scenario, bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray
) -> float:
    if not isinstance(surface, SurfaceOfRevolution):
        surface = Plane()
        _, _, q, qd = _compute_undisturbed(scenario, bicycle, surface)
    return growth_rate(surface, linearise(bicycle, surface, q, qd, scenario.make_inputs()).eigenvalues, float(qd[YAW]))


def _compute_undisturbed(
    scenario: Scenario, bicycle: Bicycle, surface: Surface
) -> tuple[int | None, CircularMotion | None, np.ndarray, np.ndarray]:
    table = scenario.motion
    if isinstance(table, CircularTable):
        near = (table.near.lean, table.near.steer) if table.near is not None else None
        where, inputs = (bicycle, make_bowl(surface)), scenario.make_inputs()
        family, motion = _find_motion(*where, table.rear_rate, table.family, near, inputs)  # type: ignore[arg-type]
        require_standing(bicycle, surface, motion)
        # A straight motion is an upright start: it has no circle.
        return family, None if motion.is_straight else motion, *motion.state()
    rates = (0.0, 0.0, table.speed / bicycle.rear_wheel_radius)
    # Where the disturbed bicycle stands: there may be no ground at the origin.
    place = (float(bicycle.reference_point[0]) + scenario.perturbation.x, scenario.perturbation.y)
    q, qd = consistent_state(bicycle, surface, place, 0.0, 0.0, rates)
    return None, None, q, qd


def _disturb_state(
    scenario: Scenario, bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    change = scenario.perturbation
    if change == type(change)():
        return q, qd
    lean = float(q[LEAN]) + change.lean
    moved = (0.0, 0.0) if isinstance(scenario.motion, UprightTable) else (change.x, change.y)
    q, qd = consistent_state(
        bicycle,
        surface,
        (float(q[0]) + moved[0], float(q[1]) + moved[1]),
        lean,
        float(q[STEER]) + change.steer,
        (qd[LEAN] + change.lean_rate, qd[STEER] + change.steer_rate, qd[REAR_ANGLE] + change.rear_rate),
        guess=(float(q[2]), float(q[5])),
    )
    centre = body_positions(bicycle, q[None])[0, 0]
    # The constraints also hold for wheels that touch the ground from below.
    if centre[2] <= evaluate(surface, centre[0], centre[1])[0]:
        raise ValueError(f"at lean = {lean!r} the rear frame lies below the ground; a smaller perturbation would not")
    return q, qd
