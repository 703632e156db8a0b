"""The flow of the seven independent variables, with its derivatives, for shooting at periodic orbits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..circular import Steady
from ..dae import consistent_state, contact_parameters
from ..kernels import flow as kernel
from ..kernels.pose import aligned
from ..kernels.reduced import VARIABLES
from ..kinematics import PITCH, constants
from ..surface import evaluate

_STEP = 1e-30  # complex step: derivatives are exact to round-off


@dataclass(frozen=True, eq=False)
class Legs:
    """A ride over m durations one after another.

    Attributes
    ----------
    ends : ndarray, shape (m, 7)
        Independent variables after each.
    start_derivatives : ndarray, shape (m, 7, 7)
        Derivatives of the ends by the variables at the start.
    duration_derivatives : ndarray, shape (m, 7, m)
        Derivatives of the ends by the durations.
    energy : float
        At the start [J].
    energy_gradient : ndarray, shape (7,)
    """

    ends: np.ndarray
    start_derivatives: np.ndarray
    duration_derivatives: np.ndarray
    energy: float
    energy_gradient: np.ndarray


@dataclass(frozen=True, eq=False)
class Flow:
    """The flow of the independent variables `velodrome.reference.stability.VARIABLES`, x and y in the heading frame.

    Attributes
    ----------
    equations : Steady
    near : ndarray, shape (24,)
        A state (coordinates, rates, contact parameters) at yaw 0, near which others are placed on the ground.
    """

    equations: Steady
    near: np.ndarray

    @cached_property
    def ground(self) -> tuple:
        """Arguments of compiled kernels: the state near by, the surface for complex numbers, and the bicycle."""
        surface, c = self.equations.surface, constants(self.equations.bicycle, self.equations.inputs)
        return self.near, surface.function.complex, surface.parameters, c, aligned(c)

    def ride(self, start: np.ndarray, durations: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, complex]:
        """Ride over durations one after another; all may be complex.

        Parameters
        ----------
        start : ndarray, shape (7,)
        durations : ndarray, shape (m,)
            [s].
        steps : ndarray of int, shape (m,)
            Numbers of steps of each.

        Returns
        -------
        ends : ndarray, shape (m, 7), complex
        energy : complex
            At the start [J].

        Raises
        ------
        ValueError
            If the start cannot be placed on the ground, or the ride is not finite.
        """
        ends = np.empty((len(durations), VARIABLES), complex)
        energy, placed = kernel.flow_legs(start.astype(complex), durations.astype(complex), steps, *self.ground, ends)
        if not placed or not np.all(np.isfinite(ends)):
            raise ValueError("the bicycle does not ride from there")
        return ends, energy

    def ride_legs(self, start: np.ndarray, durations: np.ndarray, steps: np.ndarray) -> Legs:
        """Ride over durations one after another, with all derivatives; see `ride`."""
        count = len(durations)
        by_start, by_duration = np.empty((count, VARIABLES, VARIABLES)), np.empty((count, VARIABLES, count))
        gradient, ends, energy = np.empty(VARIABLES), np.empty((count, VARIABLES)), 0.0
        for j in range(VARIABLES):
            changed = start + 1j * _STEP * np.eye(VARIABLES)[j]
            there, level = self.ride(changed, durations, steps)
            ends, energy = np.real(there), level.real
            by_start[:, :, j], gradient[j] = np.imag(there) / _STEP, level.imag / _STEP
        for j in range(count):
            there, _ = self.ride(start, durations + 1j * _STEP * np.eye(count)[j], steps)
            by_duration[:, :, j] = np.imag(there) / _STEP
        return Legs(ends, by_start, by_duration, float(energy), gradient)

    def moved_to(self, start: np.ndarray) -> Flow:
        """Return the same flow, with the state of independent variables (7,) as the one to place others near."""
        surface, bicycle = self.equations.surface, self.equations.bicycle
        x, y, lean, steer, *rates = start.tolist()
        ascent = float(evaluate(surface, x, y)[0] - evaluate(surface, self.near[0], self.near[1])[0])
        guess = float(self.near[2]) + ascent, float(self.near[PITCH])
        q, qd = consistent_state(bicycle, surface, (x, y), lean, steer, (rates[0], rates[1], rates[2]), guess=guess)
        return Flow(self.equations, np.concatenate([q, qd, contact_parameters(bicycle, surface, q)]))

    def rates(self, start: np.ndarray) -> np.ndarray:
        """Return the time derivatives (7,) of the independent variables."""
        out = np.full(VARIABLES, np.nan)
        kernel.variable_rates(start.astype(complex), *self.ground, out)
        return out
