"""The flow of the seven independent variables, with its derivatives, for shooting at periodic orbits."""

from __future__ import annotations

from collections.abc import Sequence
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
    """Rides over m legs, each from a start of its own.

    Attributes
    ----------
    ends : ndarray, shape (m, 7)
        Independent variables after each.
    start_derivatives : ndarray, shape (m, 7, 7)
        Derivatives of the ends by the variables at the start of the leg.
    duration_derivatives : ndarray, shape (m, 7)
        Derivatives of the ends by the duration of the leg.
    energies : ndarray, shape (m,)
        At the starts [J].
    energy_gradients : ndarray, shape (m, 7)
    """

    ends: np.ndarray
    start_derivatives: np.ndarray
    duration_derivatives: np.ndarray
    energies: np.ndarray
    energy_gradients: np.ndarray


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


def ride_legs(flows: Sequence[Flow], starts: np.ndarray, durations: np.ndarray, steps: int) -> Legs:
    """Ride m legs, each from a start of its own, with all derivatives.

    Parameters
    ----------
    flows : sequence of Flow, length m
        Each near the start of its leg.
    starts : ndarray, shape (m, 7)
    durations : ndarray, shape (m,)
        [s].
    steps : int
        Number of steps of each.

    Returns
    -------
    Legs

    Raises
    ------
    ValueError
        See `Flow.ride`.
    """
    count, number = len(durations), np.array([steps])
    ends, by_duration, gradients = (np.empty((count, VARIABLES)) for _ in range(3))
    by_start, energies = np.empty((count, VARIABLES, VARIABLES)), np.empty(count)
    for i, (flow, start, duration) in enumerate(zip(flows, starts, durations[:, None], strict=True)):
        for j in range(VARIABLES):
            there, level = flow.ride(start + 1j * _STEP * np.eye(VARIABLES)[j], duration, number)
            by_start[i, :, j], gradients[i, j] = np.imag(there[0]) / _STEP, level.imag / _STEP
        there, level = flow.ride(start, duration + 1j * _STEP, number)
        ends[i], by_duration[i], energies[i] = np.real(there[0]), np.imag(there[0]) / _STEP, level.real
    return Legs(ends, by_start, by_duration, energies, gradients)
