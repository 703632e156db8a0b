"""Steady motions on the level plane in lean and steer alone, up to straight ones.

At a given rear-wheel rate and constant angles the bicycle runs steadily where its reduced equations of motion leave the
angles at rest,

    lean''(lean, steer) = 0,    steer''(lean, steer) = 0

(`velodrome.reference.kernels.reduced`, whose derivatives are exact). The rate of the rear wheel is then constant as
well, since energy is. No radius occurs, so these equations are regular where circles become straight lines; those of
`velodrome.reference.circular`, whose unknowns are positions relative to the centre, are not.

By symmetry the upright bicycle runs straight at any rate, with its handlebar forward (steer = 0) or reversed
(steer = pi). These motions are constructed, not solved for, so that their yaw rate is exactly zero.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .anchors import above_ground
from .bicycle import Bicycle
from .circular import CircularMotion, Steady
from .dae import consistent_state, contact_parameters, residual, steady_forces
from .inputs import NO_INPUTS, Inputs
from .kernels.circle import SIGMA_UNIT
from .kernels.curve import CHOSEN
from .kernels.steady import UNKNOWNS
from .kinematics import FRONT_ANGLE, PITCH, REAR_ANGLE, YAW
from .stability import VARIABLES, linearise
from .surface import Plane, SurfaceOfRevolution

_ANGLES = [VARIABLES.index("lean"), VARIABLES.index("steer")]
_ACCELERATIONS = [VARIABLES.index("lean_rate"), VARIABLES.index("steer_rate")]
_MOST = 25  # iterations of Newton's method
_LARGEST_STEP = 0.1  # [rad] of an iteration
# Iterations end where the step is round-off times a condition number of 1e2 to 1e4, as of eigenvalues in `stability`.
_CONVERGED = 1e-11
# At a relative distance d from the speed at which circles branch off straight motion their angles are about the root
# of d. With d known to 1e-15, smaller angles cannot be told from straight motion.
SMALLEST_ANGLE = 1e-7


def straight_motions(bicycle: Bicycle, surface: SurfaceOfRevolution, rear_rate: float) -> Iterator[CircularMotion]:
    """Yield the straight upright motions on level ground, with the handlebar forward and reversed.

    The rear contact is in the origin, since a straight line has no centre.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
        Level.
    rear_rate : float
        Positive [rad/s].
    """
    for steer in (0.0, np.pi):
        try:
            yield make_straight_motion(bicycle, surface, rear_rate, steer)
        except ValueError:
            continue  # reversed, a wheel may not reach the ground


def make_straight_motion(
    bicycle: Bicycle, surface: SurfaceOfRevolution, rear_rate: float, steer: float = 0.0
) -> CircularMotion:
    """Return the straight upright motion on level ground at a steer of 0 or pi.

    Raises
    ------
    ValueError
        If both wheels do not reach the ground.
    """
    place = (float(bicycle.reference_point[0]), 0.0)
    q, qd = consistent_state(bicycle, surface, place, 0.0, steer, (0.0, 0.0, rear_rate))
    p = contact_parameters(bicycle, surface, q)
    force = steady_forces(bicycle, surface, q, qd, p)
    rows = residual(bicycle, surface, q, qd, np.zeros(9), p, force.ravel())
    rows[17:] /= float(np.linalg.norm(qd[[YAW, REAR_ANGLE, FRONT_ANGLE]]))
    return CircularMotion(
        position=q[:3].copy(),
        lean=0.0,
        pitch=float(q[PITCH]),
        steer=steer,
        yaw_rate=0.0,
        rear_rate=rear_rate,
        front_rate=float(qd[FRONT_ANGLE]),
        contact=p.reshape(2, 3),
        force=force,
        residual=float(np.abs(rows).max()),
        straight_speed=float(qd[0]),
    )


def solve_steady_turn(
    bicycle: Bicycle,
    surface: SurfaceOfRevolution,
    rear_rate: float,
    lean: float,
    steer: float,
    inputs: Inputs = NO_INPUTS,
) -> CircularMotion | None:
    """Solve for the steady turn on level ground that Newton's method reaches from a lean and a steer.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
        Level.
    rear_rate : float
        Positive [rad/s].
    lean, steer : float
        Guess [rad].
    inputs : Inputs

    Returns
    -------
    CircularMotion or None
        None where it does not converge, or converges to a straight motion.
    """
    angles, converged = np.array([lean, steer]), False
    for _ in range(_MOST):
        try:
            lean, steer = map(float, angles)
            q, qd = consistent_state(bicycle, Plane(), (0.0, 0.0), lean, steer, (0.0, 0.0, rear_rate))
            reduced = linearise(bicycle, Plane(), q, qd, inputs)
        except ValueError:
            return None
        if converged:
            break
        if reduced.variables != VARIABLES:
            return None  # the rear wheel nearly stands: a pivoting motion is no limit of straight ones
        jacobian = reduced.jacobian[np.ix_(_ACCELERATIONS, _ANGLES)]
        step = np.linalg.lstsq(jacobian, -reduced.field[_ACCELERATIONS], rcond=None)[0]
        size = float(np.abs(step).max())
        angles = angles + step * min(1.0, _LARGEST_STEP / size if size > 0 else 1.0)
        converged = size < _CONVERGED
    else:
        return None
    yaw_rate = float(qd[YAW])
    if np.hypot(angles[0], np.sin(angles[1])) < SMALLEST_ANGLE or yaw_rate == 0:
        return None
    centre = np.array([-qd[1], qd[0]]) / yaw_rate  # from D; the velocity of D is yaw_rate times the turned position
    return _circle(Steady(bicycle, surface, inputs), q, qd, -centre)


def _circle(equations: Steady, q: np.ndarray, qd: np.ndarray, place: np.ndarray) -> CircularMotion | None:
    """Return the circular motion of a steady state, D at a place relative to the centre."""
    moved = q.copy()
    moved[:2] = place
    p = contact_parameters(equations.bicycle, equations.surface, moved)
    unknowns = np.zeros(UNKNOWNS)
    unknowns[:6] = moved[[0, 1, 2, 4, 5, 6]]
    unknowns[9] = float(qd[[YAW, REAR_ANGLE, FRONT_ANGLE]] @ qd[[YAW, REAR_ANGLE, FRONT_ANGLE]]) / SIGMA_UNIT
    unknowns[10:16] = p
    full = equations.expand(unknowns[CHOSEN]).full
    return equations.motion(full) if above_ground(equations, full) else None
