"""Special points of a family, solved from the conditions that define them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from .bicycle import Bicycle
from .circular import REAR_SPEED, CircularMotion, Steady
from .circular import STEER as STEER_UNKNOWN
from .continuation import Point, arc_distance, roots_along
from .dae import consistent_state, dynamics
from .families import Family, front_rate_slope, rear_rate_slope
from .kernels.circle import STEP
from .kernels.steady import steady_energy
from .kinematics import FRONT_ANGLE, constants
from .rideability import assess_motions, explain_motion, explain_obstacles
from .roots import find_root
from .stability import VARIABLES, linearise
from .surface import Plane, is_level

LEAN, STEER, LEAN_RATE, STEER_RATE = (VARIABLES.index(name) for name in ("lean", "steer", "lean_rate", "steer_rate"))
STRAIGHT = {1: ("B", 0.0), 2: ("C", np.pi)}
_ROUND_OFF = 1e-9  # of the polynomial's coefficients, from determinants of 4 x 4 matrices
SMALL_LEAN = 0.05  # [rad] the extremum of the front rate next to the pivoting motion has no letter


@dataclass(frozen=True)
class SpecialPoint:
    """A point of a family that fulfils a special condition.

    Attributes
    ----------
    name : str
        The paper's letter where it has one, otherwise the kind and a number.
    kind : str
        ``static``, ``pivot``, ``straight``, ``cusp`` (extreme front rate), ``fold`` (extreme rear rate),
        ``energy`` (extreme energy).
    lean, steer : float
        [rad].
    rear_rate, front_rate : float
        [rad/s].
    unphysical_because : tuple of str
        Why its motion cannot be ridden; empty if it can.
    """

    name: str
    kind: str
    lean: float
    steer: float
    rear_rate: float
    front_rate: float
    unphysical_because: tuple[str, ...]


def energy_slope(equations: Steady) -> Callable[[Point], float]:
    """Make the derivative of the energy along a family of these equations, by the complex step.

    The potential -torque x steer of a steer torque is part of it, as it is of what a ride conserves.
    """
    c, torque = constants(equations.bicycle), equations.inputs.steer_torque

    def slope(point: Point) -> float:
        change = float(steady_energy(point.unknowns + 1j * STEP * point.tangent, c).imag / STEP)
        return change - torque * float(point.tangent[STEER_UNKNOWN])

    return slope


def special_points(family: Family) -> list[SpecialPoint]:
    """Find all special points of a family where its wheels can stand, in the order of its points."""
    equations = family.equations
    conditions: tuple[tuple[str, Callable[[Point], float]], ...] = (
        ("cusp", front_rate_slope),
        ("fold", rear_rate_slope),
        ("energy", energy_slope(equations)),
    )
    found: list[tuple[int, float, str, Point]] = []
    for kind, condition in conditions:
        for i, point in roots_along(equations, family.points, condition):
            # The squared rear rate is least at the pivoting motion, which is not a fold.
            if kind != "fold" or abs(point.unknowns[REAR_SPEED]) > 1e-6:
                found.append((i, arc_distance(family.points[i], point), kind, point))
    for i, end in zip((0, len(family.points) - 1), family.ends, strict=True):
        if end in ("static", "pivot"):
            found.append((i, 0.0, end, family.points[i]))
    where = equations.bicycle, equations.surface
    if found:
        stands = assess_motions(*where, np.array([point.unknowns for *_, point in found])).rims_clear
        found = [item for item, clear in zip(found, stands, strict=True) if clear]
    ordered = [(kind, equations.motion(point.unknowns)) for *_, kind, point in sorted(found, key=lambda item: item[:2])]
    points = [
        SpecialPoint(name, kind, *_quantities(motion), explain_motion(*where, motion))
        for name, kind, motion in _name_points(family, ordered)
    ]
    if is_level(equations.surface) and family.number in STRAIGHT:
        straight = find_straight_motion(equations.bicycle, *STRAIGHT[family.number])
        points += [] if straight is None else [straight]
    return points


def _smallest_root(determinant: Callable[[float], float], radius: float, squares: np.ndarray) -> float | None:
    """Return the smallest positive squared speed at which a polynomial of the second degree in it is zero.

    Parameters
    ----------
    determinant : callable
        Of the rear rate [rad/s].
    radius : float
        Of the rear wheel [m].
    squares : ndarray, shape (3,)
        Squared speeds that the polynomial is determined from.
    """
    polynomial = np.polyfit(squares, [determinant(float(np.sqrt(square)) / radius) for square in squares], 2)
    sizes = np.abs(polynomial) * squares.max() ** np.array([2, 1, 0])
    # A leading coefficient that is round-off would have a root at a speed without meaning.
    polynomial[sizes < _ROUND_OFF * sizes.max()] = 0
    roots = np.roots(polynomial)
    real = roots.real[(roots.real > 0) & (np.abs(roots.imag) < _ROUND_OFF * np.abs(roots))]
    return float(real.min()) if real.size else None


def find_straight_motion(bicycle: Bicycle, name: str, steer: float) -> SpecialPoint | None:
    """Find the upright straight motion on the plane that neighbouring circular motions tend to (B and C).

    Its capsize eigenvalue is zero: the stiffness of lean and steer, linear in the squared speed, is singular. Of two
    such motions the slower one is returned; None if there is none.
    """
    radius = bicycle.rear_wheel_radius
    block = [LEAN, STEER, LEAN_RATE, STEER_RATE]

    def determinant(rear_rate: float) -> float:
        state = consistent_state(bicycle, Plane(), (0.0, 0.0), 0.0, steer, (0.0, 0.0, rear_rate))
        return float(np.linalg.det(linearise(bicycle, Plane(), *state).jacobian[np.ix_(block, block)]))

    square = _smallest_root(determinant, radius, np.array([1.0, 16.0, 81.0]))
    if square is None:
        return None
    # Once more, where it is: at a hundred times these speeds it is known to some digits only.
    square = _smallest_root(determinant, radius, square * np.array([0.5, 1.0, 1.5])) or square
    near = float(np.sqrt(square)) / radius
    around = near * (1 - 1e-6), near * (1 + 1e-6)
    if np.sign(determinant(around[0])) * np.sign(determinant(around[1])) >= 0:
        return None  # it touches zero: no circles branch off
    rear_rate = find_root(determinant, *around, tolerance=1e-13)
    q, rates = consistent_state(bicycle, Plane(), (0.0, 0.0), 0.0, steer, (0.0, 0.0, rear_rate))
    now = dynamics(bicycle, Plane(), q, rates)
    why = explain_obstacles(bicycle, Plane(), q, now.contact, now.force)
    return SpecialPoint(name, "straight", 0.0, steer, rear_rate, float(rates[FRONT_ANGLE]), why)


def _quantities(motion: CircularMotion) -> tuple[float, float, float, float]:
    return motion.lean, motion.steer, motion.rear_rate, motion.front_rate


def _name_points(family: Family, points: list[tuple[str, CircularMotion]]) -> Iterator[tuple[str, str, CircularMotion]]:
    """Give points the paper's letters where they have one, otherwise their kind and a number.

    The cusps D and I exist while family 2 ends in large circles (at C), or at the edge of the ground on its way there.
    D is then the cusp with the smallest front rate of family 2, and I the cusp with the largest one of family 4, whose
    end is the wheel that runs backward.
    """
    pivot = "H" if family.numbers == (4,) else "G (H)" if 4 in family.numbers else "G"
    # The paper's motions are hands-free.
    letters = {} if family.equations.inputs.steer_torque else {"static": "A", "pivot": pivot}
    cusps = [motion for kind, motion in points if kind == "cusp" and abs(motion.lean) > SMALL_LEAN]
    special, ends = None, family.ends
    if family.number == 2 and cusps and ("large circle" in ends or "edge" in ends):
        special, letters["cusp"] = min(cusps, key=lambda motion: abs(motion.front_rate)), "D"
    if family.number == 4 and cusps and "fast front wheel" in ends:
        special, letters["cusp"] = max(cusps, key=lambda motion: abs(motion.front_rate)), "I"
    count: Counter[str] = Counter()
    for kind, motion in points:
        if kind in letters and (kind != "cusp" or motion is special):
            yield letters[kind], kind, motion
            continue
        count[kind] += 1
        yield f"{kind} {count[kind]}", kind, motion
