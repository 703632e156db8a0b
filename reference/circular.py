"""One circular motion: 21 constants (Xiong et al. 2020, Eqs. 9-14).

The eight equations in nine unknowns of `velodrome.reference.kernels.circle` are solved; speeds, contact points and
forces follow from them, and all 22 unknowns of `velodrome.reference.kernels.steady` describe the solution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from .bicycle import Bicycle
from .inputs import NO_INPUTS, Inputs
from .kernels import curve
from .kernels import newton as newton_kernel
from .kernels import steady as kernel
from .kernels.pose import aligned
from .kinematics import constants
from .missing_motion import NoSuchMotion
from .surface import SurfaceOfRevolution

LEAN, PITCH, STEER, YAW_SPEED, REAR_SPEED, FRONT_SPEED, SIGMA = range(3, 10)
CONTACT, FORCE = slice(10, 16), slice(16, 22)


@dataclass(frozen=True)
class CircularMotion:
    """A circular motion, hands-free or under constant inputs, in the heading frame.

    Attributes
    ----------
    position : ndarray, shape (3,)
        Position of D [m].
    lean, pitch, steer : float
        Angles [rad].
    yaw_rate, rear_rate, front_rate : float
        Rates [rad/s].
    contact : ndarray, shape (2, 3)
        Contact parameters (xi, eta, rim angle) of the rear and the front wheel.
    force : ndarray, shape (2, 3)
        Contact forces on the wheels [N].
    residual : float
        Largest of the 21 equations: forces in units of the weight, lengths in m, rolling speeds as fractions of
        the root of the sum of the squared rates.
    straight_speed : float
        Forward speed of a straight motion, the limit of ever larger circles, whose yaw rate is zero [m/s]; D is then
        given from the rear contact. Zero on a circle.
    """

    position: np.ndarray
    lean: float
    pitch: float
    steer: float
    yaw_rate: float
    rear_rate: float
    front_rate: float
    contact: np.ndarray
    force: np.ndarray
    residual: float
    straight_speed: float = 0.0

    @property
    def is_straight(self) -> bool:
        """Whether the motion is straight, without a centre to turn about."""
        return self.straight_speed > 0

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and rates at yaw 0 and wheel angles 0, shapes (9,)."""
        x, y, z = self.position
        q = np.array([x, y, z, 0.0, self.lean, self.pitch, self.steer, 0.0, 0.0])
        w = self.yaw_rate
        forward = self.straight_speed if self.is_straight else -w * y
        return q, np.array([forward, w * x, 0.0, w, 0.0, 0.0, 0.0, self.rear_rate, self.front_rate])


def mirror_motion(motion: CircularMotion) -> CircularMotion:
    """Return the motion with left and right exchanged, of the same bicycle without a steer torque."""
    flip = np.array([1.0, -1.0, 1.0])
    return replace(
        motion,
        position=motion.position * flip,
        lean=-motion.lean,
        steer=-motion.steer,
        yaw_rate=-motion.yaw_rate,
        contact=motion.contact * flip,
        force=motion.force * flip,
    )


class Expansion(NamedTuple):
    """The equations and all unknowns at nine unknowns, to first order.

    Attributes
    ----------
    rows : ndarray, shape (8,)
        Residuals of the equations.
    jacobian : ndarray, shape (8, 9)
        Their Jacobian.
    full : ndarray, shape (22,)
        All unknowns.
    basis : ndarray, shape (22, 9)
        Their derivatives with respect to the nine.
    """

    rows: np.ndarray
    jacobian: np.ndarray
    full: np.ndarray
    basis: np.ndarray


@dataclass(frozen=True)
class Steady:
    """The equations of circular motions of one bicycle on one surface of revolution, under constant inputs.

    Attributes
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    inputs : Inputs
        Steer damping changes the eigenvalues of circular motions, not the motions.

    Raises
    ------
    NoSuchMotion
        If there is a torque on the rear wheel, with which no wheel rolls steadily.
    """

    bicycle: Bicycle
    surface: SurfaceOfRevolution
    inputs: Inputs = NO_INPUTS

    def __post_init__(self) -> None:
        torque = self.inputs.rear_wheel_torque
        if torque != 0:
            raise NoSuchMotion(
                f"no circular motion exists with a rear-wheel torque of {torque!r} N m: a rolling wheel would gain the "
                "power torque x rear rate, and nothing takes it up; it would be steady only where the rear wheel "
                "stands. rear_wheel_torque = 0 has circular motions"
            )

    @cached_property
    def where(self) -> tuple[Any, Any, np.ndarray, Any]:
        """Arguments of compiled kernels: the surface for real and for complex numbers, its parameters, the bicycle."""
        function = self.surface.function
        return function.real, function.complex, self.surface.parameters, aligned(constants(self.bicycle, self.inputs))

    @property
    def all_arguments(self) -> tuple[Any, Any, np.ndarray, Any, Any]:
        """Arguments of `velodrome.reference.kernels.newton`: those of `where`, and the constants before alignment."""
        return *self.where, constants(self.bicycle, self.inputs)

    def expand(self, chosen: np.ndarray) -> Expansion:
        """Evaluate the eight equations and all 22 unknowns at the nine, shape (9,), with their Jacobians.

        All is nan where the equations have no value, as where nothing has inertia.
        """
        out = Expansion(np.empty(8), np.empty((8, 9)), np.empty(kernel.UNKNOWNS), np.empty((kernel.UNKNOWNS, 9)))
        try:
            curve.expanded(chosen, *self.where[1:], *out)
        except ZeroDivisionError:  # compiled code raises it for complex numbers, where real ones give inf
            for part in out:
                part.fill(np.nan)
        return out

    def residual(self, unknowns: np.ndarray) -> np.ndarray:
        """Evaluate the 21 equations and the normalisation of the speeds, shape (22,)."""
        out, function = np.empty(kernel.UNKNOWNS), self.surface.function.real
        kernel.steady_residual(unknowns, function, self.surface.parameters, constants(self.bicycle, self.inputs), out)
        return out

    def jacobian(self, unknowns: np.ndarray) -> np.ndarray:
        """Evaluate the Jacobian of `residual`, shape (22, 22), rank 21: power balance makes one equation redundant."""
        out = np.empty((kernel.UNKNOWNS, kernel.UNKNOWNS))
        function = self.surface.function.complex
        kernel.steady_jacobian(unknowns, function, self.surface.parameters, constants(self.bicycle, self.inputs), out)
        return out

    def motion(self, unknowns: np.ndarray) -> CircularMotion:
        """Return the motion of a solution, run so that the rear wheel rolls forward (`kernels.steady.direction`).

        Raises
        ------
        ValueError
            If the solution is no motion (sigma < 0).
        """
        u = unknowns
        if u[SIGMA] < -1e-12:  # round-off of a static equilibrium
            raise ValueError(f"no motion: the squared speed is {u[SIGMA]!r}")
        yaw_rate, rear_rate, front_rate = kernel.running_rates(u)
        weight = self.bicycle.mass * self.bicycle.gravity
        return CircularMotion(
            position=u[:3].copy(),
            lean=float(u[LEAN]),
            pitch=float(u[PITCH]),
            steer=float(u[STEER]),
            yaw_rate=yaw_rate,
            rear_rate=rear_rate,
            front_rate=front_rate,
            contact=u[CONTACT].reshape(2, 3).copy(),
            force=weight * u[FORCE].reshape(2, 3),
            residual=float(np.abs(self.residual(u)[:21]).max()),
        )


def find_unknowns(equations: Steady, motion: CircularMotion) -> np.ndarray:
    """Return the 22 unknowns of a circular motion, from which `Steady.motion` makes it."""
    rates = np.array([motion.yaw_rate, motion.rear_rate, motion.front_rate])
    speed = float(np.linalg.norm(rates))
    weight = equations.bicycle.mass * equations.bicycle.gravity
    return np.concatenate(
        [
            motion.position,
            [motion.lean, motion.pitch, motion.steer],
            rates / speed,
            [speed**2 / kernel.SIGMA_UNIT],
            motion.contact.ravel(),
            motion.force.ravel() / weight,
        ]
    )


def reverse_speeds(unknowns: np.ndarray) -> np.ndarray:
    """Return the same solution, or its tangent, (22,) each, with the signs of all three speeds reversed."""
    other = unknowns.copy()
    other[YAW_SPEED : FRONT_SPEED + 1] *= -1
    return other


def as_solved(unknowns: np.ndarray) -> np.ndarray:
    """Return the same solution (22,) with the signs of the speeds that the solvers use: a turn to the left."""
    return reverse_speeds(unknowns) if unknowns[YAW_SPEED] < 0 else unknowns


@dataclass(frozen=True)
class Condition:
    """One more equation, value = 0, that picks a point of a family: its value and gradient."""

    value: float
    gradient: np.ndarray


@dataclass(frozen=True)
class PickedPoint:
    """A condition that compiled code knows; called with unknowns (22,), it returns their `Condition`.

    Attributes
    ----------
    terms : PointCondition
        See `velodrome.reference.kernels.newton`.
    """

    terms: newton_kernel.PointCondition

    def __call__(self, u: np.ndarray) -> Condition:
        """Evaluate the condition at unknowns (22,)."""
        index, _, scale = self.terms
        gradient = np.zeros(kernel.UNKNOWNS)
        if index == newton_kernel.REAR_RATE:
            gradient[SIGMA] = scale * u[REAR_SPEED] ** 2
            gradient[REAR_SPEED] = 2 * scale * u[SIGMA] * u[REAR_SPEED]
        else:
            gradient[index] = scale
        return Condition(float(newton_kernel.condition_value(self.terms, u)), gradient)


def rear_rate_condition(rear_rate: float) -> PickedPoint:
    """Make the condition of a given rear-wheel rate: sigma b^2 = rate^2, in units of the rate's square or of 1."""
    scale = kernel.SIGMA_UNIT / max(rear_rate**2, 1.0)
    terms = newton_kernel.PointCondition(newton_kernel.REAR_RATE, rear_rate**2 / kernel.SIGMA_UNIT, scale)
    return PickedPoint(terms)


def unknown_condition(index: int, value: float) -> PickedPoint:
    """Make the condition that one unknown has a given value."""
    return PickedPoint(newton_kernel.PointCondition(index, float(value), 1.0))


def nearest_condition():
    """Make an empty condition: least squares takes the guess to the nearest point of the curve."""
    return lambda u: Condition(0.0, np.zeros(kernel.UNKNOWNS))


def plane_condition(start: np.ndarray, tangent: np.ndarray, distance: float):
    """Make the condition of pseudo-arclength: ``distance`` from ``start`` along ``tangent`` (a weighted covector)."""

    def condition(u: np.ndarray) -> Condition:
        return Condition(float(tangent @ (u - start)) - distance, tangent)

    return condition


def newton(equations: Steady, unknowns: np.ndarray, condition, most: int = 12) -> tuple[np.ndarray, int]:
    """Solve the equations and one condition by Newton's method.

    Parameters
    ----------
    equations : Steady
    unknowns : ndarray, shape (22,)
        Guess.
    condition : callable
        Maps the unknowns to a `Condition`.
    most : int
        Largest number of iterations.

    Returns
    -------
    unknowns : ndarray, shape (22,)
    iterations : int

    Raises
    ------
    ValueError
        If it does not converge.
    """
    u = unknowns[curve.CHOSEN]
    if isinstance(condition, PickedPoint):
        full = np.empty(kernel.UNKNOWNS)
        try:
            iterations, _ = newton_kernel.solve_motion(u, condition.terms, most, *equations.all_arguments, full)
        except ZeroDivisionError:  # see `Steady.expand`
            iterations = 0
        if iterations:
            return full, iterations
        raise ValueError("Newton's method finds no circular motion there")
    for iteration in range(1, most + 1):
        here = equations.expand(u)
        extra = condition(here.full)
        values = np.append(here.rows, extra.value)
        matrix = np.vstack([here.jacobian, extra.gradient @ here.basis])
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(matrix))):
            break
        # Without a condition the last row is zero.
        step = np.linalg.lstsq(matrix, -values, rcond=None)[0]
        size = float(np.abs(step / (1 + np.abs(u))).max())
        u = u + step * min(1.0, 0.5 / size if size > 0 else 1.0)
        if size < 1e-9:  # convergence is quadratic: what remains is round-off
            full = equations.expand(u).full
            # Least squares may also settle where the equations have no solution.
            where, parameters = equations.surface.function.real, equations.surface.parameters
            if not newton_kernel.is_solution(full, where, parameters, constants(equations.bicycle, equations.inputs)):
                break
            return full, iteration
    raise ValueError("Newton's method finds no circular motion there")


def make_canonical(equations: Steady, unknowns: np.ndarray, condition: PickedPoint) -> tuple[np.ndarray, bool]:
    """Compute a solution anew, so that its bits do not depend on the guess that led to it.

    The unknowns are rounded, and a fixed number of Newton's steps is taken from there.

    Parameters
    ----------
    equations : Steady
    unknowns : ndarray, shape (22,)
        A solution of the equations and the condition, to 1e-10.
    condition : PickedPoint

    Returns
    -------
    unknowns : ndarray, shape (22,)
        The solution as given where the steps do not settle, next to a fold.
    certain : bool
        Whether no other guess would have led to other bits. False where the steps do not settle, and where an unknown
        lies within 1e-10 of the middle between two roundings: about once in 1e4 solutions.
    """
    u, full = unknowns[curve.CHOSEN], np.empty(kernel.UNKNOWNS)
    try:
        outcome = newton_kernel.canonical(u, condition.terms, *equations.all_arguments, full)
    except ZeroDivisionError:  # see `Steady.expand`
        outcome = newton_kernel.UNSETTLED
    return unknowns if outcome == newton_kernel.UNSETTLED else full, outcome == newton_kernel.CANONICAL
