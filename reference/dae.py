"""The differential-algebraic equations of motion (Xiong et al. 2020, Eqs. 6-8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .bicycle import Bicycle
from .inputs import NO_INPUTS, Inputs
from .kernels import dynamics as kernel
from .kinematics import LEAN, REAR_ANGLE, STEER, constants
from .surface import Surface, evaluate


@dataclass(frozen=True)
class Dynamics:
    """Accelerations and multipliers at one state.

    Attributes
    ----------
    acceleration : ndarray, shape (9,)
        Second derivatives of the generalised coordinates [m/s^2, rad/s^2].
    force : ndarray, shape (2, 3)
        The six Lagrange multipliers: forces of the ground on the rear and the front wheel in inertial
        axes [N].
    contact : ndarray, shape (2, 3)
        Contact parameters (xi, eta, rim angle) of both wheels [m, m, rad].
    contact_rate : ndarray, shape (2, 3)
        Their time derivatives.
    """

    acceleration: np.ndarray
    force: np.ndarray
    contact: np.ndarray
    contact_rate: np.ndarray


def contact_parameters(bicycle: Bicycle, surface: Surface, q: np.ndarray) -> np.ndarray:
    """Solve the contact equations (Eq. 4) at coordinates (9,); return (6,) [m, m, rad per wheel].

    Raises
    ------
    ValueError
        If Newton's method finds no closest approach of a wheel.
    """
    p = np.empty(6, q.dtype)
    function = surface.function.complex if np.iscomplexobj(q) else surface.function.real
    kernel.guess_contacts(q, p, function, surface.parameters, constants(bicycle))
    if not kernel.find_contacts(q, p, function, surface.parameters, constants(bicycle)):
        raise ValueError(f"no contact point found at q = {q.tolist()}")
    return p


def dynamics(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray, inputs: Inputs = NO_INPUTS) -> Dynamics:
    """Compute the accelerations and contact forces of a state that satisfies the constraints.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (9,)
        Generalised coordinates and rates.
    inputs : Inputs

    Returns
    -------
    Dynamics

    Raises
    ------
    ValueError
        If a wheel has no contact point.
    """
    p = contact_parameters(bicycle, surface, q)
    qdd, force, rate = np.empty(9), np.empty(6), np.empty(6)
    function, parameters = surface.function.real, surface.parameters
    kernel.accelerations(q, qd, p, function, parameters, constants(bicycle, inputs), qdd, force, rate)
    if not np.all(np.isfinite(qdd)):
        qdd, force = _solve_bordered(bicycle, surface, q, qd, p, inputs)
    return Dynamics(qdd, force.reshape(2, 3), p.reshape(2, 3), rate.reshape(2, 3))


def _solve_bordered(
    bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray, p: np.ndarray, inputs: Inputs
) -> tuple[np.ndarray, np.ndarray]:
    """Solve the 15 x 15 system as a whole, where the mass matrix of the tree has no inverse.

    Bodies without inertia make that matrix singular. The whole system is regular where every motion that the
    constraints allow has inertia, see `velodrome.reference.regularity.require_inertia`.
    """
    mass, bias, rows, gamma = bordered_parts(bicycle, surface, q, qd, p, inputs)
    system = np.block([[mass, -rows.T], [rows, np.zeros((6, 6))]])
    solution = np.linalg.solve(system, np.concatenate([-bias, -gamma]))
    return solution[:9], solution[9:]


def bordered_parts(
    bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray, p: np.ndarray, inputs: Inputs = NO_INPUTS
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return M (9, 9), h (9,) less the inputs, J (6, 9), gamma (6,) of M qdd + h = J^T F, J qdd + gamma = 0."""
    mass, bias, rows, gamma, rate = np.empty((9, 9)), np.empty(9), np.empty((6, 9)), np.empty(6), np.empty(6)
    c = constants(bicycle, inputs)
    kernel.mass_and_bias(q, qd, c, mass, bias)
    kernel.rolling(q, qd, p, surface.function.real, surface.parameters, c, rows, gamma, rate)
    return mass, bias, rows, gamma


def steady_forces(bicycle: Bicycle, surface: Surface, q: np.ndarray, qd: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Compute the contact forces of a state without accelerations.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (9,)
        Generalised coordinates and rates.
    p : ndarray, shape (6,)
        Contact parameters.

    Returns
    -------
    ndarray, shape (2, 3)
        Forces of the ground on the rear and the front wheel in inertial axes [N].
    """
    _, bias, rows, _ = bordered_parts(bicycle, surface, q, qd, p)
    # Nine equations for six forces, which are consistent where the accelerations are zero.
    return np.linalg.lstsq(rows.T, bias, rcond=None)[0].reshape(2, 3)


def mass_matrix(bicycle: Bicycle, q: np.ndarray) -> np.ndarray:
    """Compute the mass matrix of the unconstrained four-body tree at coordinates (9,), shape (9, 9)."""
    mass, bias = np.empty((9, 9)), np.empty(9)
    kernel.mass_and_bias(q, np.zeros(9), constants(bicycle), mass, bias)
    return mass


def residual(
    bicycle: Bicycle,
    surface: Surface,
    q: np.ndarray,
    qd: np.ndarray,
    qdd: np.ndarray,
    p: np.ndarray,
    force: np.ndarray,
    *,
    inputs: Inputs = NO_INPUTS,
) -> np.ndarray:
    """Compute the residual of all 21 equations (Eq. 8).

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd, qdd : ndarray, shape (9,)
        Coordinates, rates, accelerations.
    p : ndarray, shape (6,)
        Contact parameters of the rear wheel, then of the front wheel.
    force : ndarray, shape (6,)
        Contact forces on the rear wheel, then on the front wheel, in inertial axes [N].
    inputs : Inputs

    Returns
    -------
    ndarray, shape (21,)
        Nine equations of motion in units of the weight, six contact equations [m, m, -], two gaps
        [m], four rolling constraints [m/s].
    """
    out = np.empty(21, q.dtype)
    function = surface.function.complex if np.iscomplexobj(q) else surface.function.real
    kernel.residual(q, qd, qdd, p, force, function, surface.parameters, constants(bicycle, inputs), out)
    return out


def consistent_state(
    bicycle: Bicycle,
    surface: Surface,
    position: tuple[float, float],
    lean: float,
    steer: float,
    rates: tuple[float, float, float],
    yaw: float = 0.0,
    guess: tuple[float, float] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Solve for the state on all constraints from seven independent variables: x, y, lean, steer and three rates.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    position : tuple of float
        x and y of D [m].
    lean, steer : float
        Angles [rad].
    rates : tuple of float
        Lean, steer and rear-wheel rate [rad/s].
    yaw : float
        Heading [rad].
    guess : tuple of float, optional
        Height of D [m] and pitch [rad] from which Newton's method starts.

    Returns
    -------
    q, qd : ndarray, shape (9,)

    Raises
    ------
    ValueError
        If both wheels cannot touch the ground at these values, or the rolling constraints leave the
        remaining speeds undetermined.
    """
    x, y = position
    if guess is None:
        guess = (float(evaluate(surface, np.array(x), np.array(y))[0]) + bicycle.front_wheel_radius * np.cos(lean), 0.0)
    q = np.array([x, y, guess[0], yaw, lean, guess[1], steer, 0.0, 0.0])
    qd = np.zeros(9)
    qd[[LEAN, STEER, REAR_ANGLE]] = rates
    p, c = np.empty(6), constants(bicycle)
    function, parameters = surface.function.real, surface.parameters
    kernel.guess_contacts(q, p, function, parameters, c)
    if not kernel.settle(q, p, function, parameters, c) or not np.all(np.isfinite(q)):
        where = f"x = {x!r}, y = {y!r}, lean = {lean!r}, steer = {steer!r}"
        raise ValueError(f"both wheels cannot touch the ground at {where}")
    kernel.complete_velocity(q, qd, p, function, parameters, c)
    if not np.all(np.isfinite(qd)) or np.abs(qd).max() > 1e9:
        raise ValueError(f"the rolling constraints do not determine the speeds at lean = {lean!r}, steer = {steer!r}")
    return q, qd
