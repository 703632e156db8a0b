"""The reduced flow on the level sets of energy near a circular motion.

The flow of the seven independent variables conserves the energy H. A circular motion therefore has a zero eigenvalue,
and lies on a curve of circular motions. On a level set {H = E}, of six dimensions, it is isolated, and E is a
parameter: bifurcations there are those of a generic vector field with one parameter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..circular import CircularMotion, Steady
from ..dae import contact_parameters
from ..kernels.dynamics import energies
from ..kernels.energy_level import LEVEL_VARIABLES, level_field
from ..kinematics import constants
from ..stability import VARIABLES, independent

# The rear rate, the last of the independent variables, follows from the energy.
CHART = VARIABLES[:LEVEL_VARIABLES]

_STEP = 1e-30  # complex step: derivatives are exact to round-off
_MOST = 30  # Newton's iterations
_CONVERGED = 1e-9  # of quadratic convergence: what remains is round-off


@dataclass(frozen=True, eq=False)
class EnergyLevel:
    """The reduced vector field on level sets of energy near a circular motion.

    Attributes
    ----------
    equations : Steady
        Bicycle and surface; without inputs, which may do work.
    state : ndarray, shape (24,)
        Coordinates, rates and contact parameters of the motion.
    centre : ndarray, shape (6,)
        The variables `CHART` of the motion.
    rear_rate : float
        Of the motion [rad/s]; not zero, since the energy could not be solved for it.
    energy : float
        Of the motion, kinetic and potential, the latter zero at z = 0 [J].
    """

    equations: Steady
    state: np.ndarray
    centre: np.ndarray
    rear_rate: float
    energy: float

    def field(self, variables: np.ndarray, energy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Evaluate the vector field, an analytic function of all its arguments.

        Parameters
        ----------
        variables : ndarray, shape (n, 6), complex
            The variables `CHART`, near the motion.
        energy : ndarray, shape (n,), complex
            Energies of the level sets [J].

        Returns
        -------
        rates : ndarray, shape (n, 6), complex
            Time derivatives of the variables; nan if a point cannot be reached, or if the bicycle's nine coordinates
            have a singular mass matrix, as where a wheel has no mass.
        rear_rate : ndarray, shape (n,), complex
            [rad/s].
        """
        y, level = np.ascontiguousarray(variables, complex), np.ascontiguousarray(energy, complex)
        rates, rear_rate = np.full(y.shape, np.nan, complex), np.full(len(y), np.nan, complex)
        surface, c = self.equations.surface, constants(self.equations.bicycle)
        try:
            found = level_field(y, level, self.state, surface.function.complex, surface.parameters, c, rates, rear_rate)
        except ZeroDivisionError:  # see `velodrome.reference.circular.Steady.expand`
            found = False
        if not found:
            rates[:] = complex(np.nan, np.nan)  # derivatives are taken of imaginary parts
        return rates, rear_rate

    def circle(self, energy: float) -> np.ndarray:
        """Return the seven independent variables of the circular motion of another energy, near by.

        Raises
        ------
        ValueError
            If Newton's method does not converge.
        """
        y, step, rear_rate = self.centre.copy(), np.inf, self.rear_rate
        for _ in range(_MOST):
            changed = y + 1j * _STEP * np.eye(LEVEL_VARIABLES + 1, LEVEL_VARIABLES)  # the last row is not changed
            rates, rear_rates = self.field(changed, np.full(len(changed), complex(energy)))
            rear_rate = float(np.real(rear_rates[-1]))
            if step < _CONVERGED or not np.all(np.isfinite(rates)):
                break
            change = -np.linalg.solve(np.imag(rates[:-1]).T / _STEP, np.real(rates[-1]))
            y, step = y + change, float(np.abs(change).max())
        if not step < _CONVERGED:
            raise ValueError(f"no circular motion of energy {energy!r} J is found near that of {self.energy!r} J")
        return np.append(y, rear_rate)


def energy_level(equations: Steady, motion: CircularMotion) -> EnergyLevel:
    """Return the reduced vector field on the level sets of energy near a circular motion.

    Raises
    ------
    ValueError
        If the rear wheel stands, or a wheel has no contact.
    """
    if motion.rear_rate == 0:
        raise ValueError("the energy does not determine the rear rate of a pivoting motion")
    q, qd = motion.state()
    contacts = contact_parameters(equations.bicycle, equations.surface, q)
    kinetic, potential = energies(q, qd, constants(equations.bicycle))
    return EnergyLevel(
        equations,
        np.concatenate([q, qd, contacts]),
        independent(q, qd)[:LEVEL_VARIABLES],
        motion.rear_rate,
        float(kinetic + potential),
    )
