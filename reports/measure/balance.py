"""The energy balance of a ride under inputs: the work of torques, and what steer damping takes.

Without inputs a rolling bicycle conserves its energy E. With them (`velodrome.reference.inputs`)

    E(t) - steer_torque (steer(t) - steer(0)) - rear_wheel_torque (rear_angle(t) - rear_angle(0))
         + steer_damping int steer_rate^2 dt

is constant. The work of the torques follows from the coordinates. The integral is computed from the samples of steer
and steer rate: their Hermite polynomial through six samples, of degree 11, is differentiated, squared and integrated
exactly. The steer rate then has an error of order 11 in the output interval. The error of the integral is estimated by
the change with four samples in place of six, which overestimates it as long as the motion is resolved at all. Nothing
but the ride's own coordinates and rates enters, neither equations of motion nor contacts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...engines.engine import Trajectory
from ...reference.inputs import Inputs
from ...reference.kinematics import REAR_ANGLE, STEER, unwrap

_SAMPLES = 6  # samples per polynomial
_FEWER = 4  # of the polynomial by whose result the error is estimated
_CHUNK = 10_000  # intervals integrated at once: bounds the memory


@dataclass(frozen=True)
class InputWork:
    """Work of a ride's inputs since its start.

    Attributes
    ----------
    work : ndarray, shape (n,)
        Work at each sample, negative where the damping takes more than the torques give [J].
    error : float
        Estimated error of the work by the integral over the damping's power; 0 without damping [J].
    """

    work: np.ndarray
    error: float


def measure_work(trajectory: Trajectory, inputs: Inputs) -> InputWork:
    """Measure the work that inputs have done on a ride's bicycle since its first sample.

    Parameters
    ----------
    trajectory : Trajectory
        n samples.
    inputs : Inputs

    Returns
    -------
    InputWork
    """
    time, q, qd = trajectory.time, trajectory.q, trajectory.qd
    work, error = np.zeros(len(time)), 0.0
    if inputs.steer_torque != 0:
        work += inputs.steer_torque * (q[:, STEER] - q[0, STEER])
    if inputs.rear_wheel_torque != 0:
        # An engine may leave out whole turns of the wheel.
        turned = unwrap(time, q[:, REAR_ANGLE], qd[:, REAR_ANGLE])
        work += inputs.rear_wheel_torque * (turned - turned[0])
    if inputs.steer_damping != 0 and len(time) > 1:
        parts, fewer = (
            inputs.steer_damping * _integrate_squared_rate(time, q[:, STEER], qd[:, STEER], samples)
            for samples in (_SAMPLES, _FEWER)
        )
        work[1:] -= np.cumsum(parts)
        error = float(np.abs(parts - fewer).sum())
    return InputWork(work, error)


def conserved_energy(trajectory: Trajectory, inputs: Inputs) -> np.ndarray | None:
    """Return kinetic plus potential energy less the work of the inputs, shape (n,) [J]; None without energies.

    This does not change in an exact ride.
    """
    if trajectory.kinetic_energy is None or trajectory.potential_energy is None:
        return None
    return trajectory.kinetic_energy + trajectory.potential_energy - measure_work(trajectory, inputs).work


def _integrate_squared_rate(time: np.ndarray, angle: np.ndarray, rate: np.ndarray, samples: int) -> np.ndarray:
    """Return the integrals (n - 1,) of the squared derivative of the Hermite polynomials through nearest samples.

    Between two samples the polynomial through the ``samples`` nearest ones is taken, or through all if there are fewer.
    """
    n, interval = len(time), np.diff(time)
    samples = min(samples, n)
    first = np.clip(np.arange(n - 1) - (samples // 2 - 1), 0, n - samples)
    nearest = first[:, None] + np.arange(samples)
    nodes = (time[nearest] - time[:-1, None]) / interval[:, None]
    # On an even grid all stencils except those at the ends are the same.
    _, kinds, kind = np.unique(np.round(nodes, 9), axis=0, return_index=True, return_inverse=True)
    # The squared derivative has the degree 2 (2 samples - 2).
    points, weights = np.polynomial.legendre.leggauss(2 * samples - 1)
    maps = np.stack([_differentiate_hermite(nodes[k], 0.5 * (points + 1)) for k in kinds])
    integrals = np.empty(n - 1)
    for begin in range(0, n - 1, _CHUNK):
        part = slice(begin, begin + _CHUNK)
        # In units of the interval.
        values = [angle[nearest[part]] - angle[:-1][part, None], rate[nearest[part]] * interval[part, None]]
        slope = np.einsum("kgs,ks->kg", maps[kind.reshape(-1)[part]], np.concatenate(values, axis=1))
        integrals[part] = 0.5 * (slope**2 @ weights) / interval[part]
    return integrals


def _differentiate_hermite(nodes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the matrix (g, 2 s) from values and derivatives at nodes (s,) to the derivative at points (g,).

    The derivative is that of the polynomial of degree 2 s - 1 with these values and derivatives.
    """
    # Powers of a variable between -1 and 1 keep the matrix well conditioned.
    middle, half = 0.5 * (nodes[0] + nodes[-1]), 0.5 * (nodes[-1] - nodes[0])
    powers = np.arange(2 * len(nodes))
    at_nodes, at_points = ((x[:, None] - middle) / half for x in (nodes, points))
    value = at_nodes**powers
    derivative = powers * at_nodes ** np.maximum(powers - 1, 0) / half
    wanted = powers * at_points ** np.maximum(powers - 1, 0) / half
    return np.linalg.solve(np.concatenate([value, derivative]).T, wanted.T).T
