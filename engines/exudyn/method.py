"""Parameters of generalized alpha."""

from __future__ import annotations

from typing import NamedTuple


class GeneralizedAlpha(NamedTuple):
    """Newmark's beta and gamma, and D = alpha_m - alpha_f: the auxiliary accelerations are those at t_n + D h."""

    beta: float
    gamma: float
    shift: float


def generalized_alpha(spectral_radius: float) -> GeneralizedAlpha:
    """Compute the parameters from the spectral radius at infinite frequency (Chung and Hulbert 1993)."""
    alpha_m, alpha_f = (2 * spectral_radius - 1) / (spectral_radius + 1), spectral_radius / (spectral_radius + 1)
    shift = alpha_m - alpha_f
    gamma = 0.5 - shift
    return GeneralizedAlpha(0.25 * (gamma + 0.5) ** 2, gamma, shift)
