"""The coefficients kept here against those of scipy, of which they are a copy, and their own order conditions."""

from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853

from velodrome.reference.tableau import TABLEAU


def test_coefficients_are_those_of_scipy() -> None:
    theirs = (DOP853.A, DOP853.B, DOP853.E3, DOP853.E5, DOP853.A_EXTRA, DOP853.D)
    for own, other in zip(TABLEAU, theirs, strict=True):
        np.testing.assert_array_equal(own, other)


def test_order_conditions_hold() -> None:
    """Quadrature of powers up to order 8, to the round-off of twelve terms of coefficients up to 7."""
    stages, weights = TABLEAU[0], TABLEAU[1]
    nodes = stages.sum(axis=1)
    for order in range(1, 9):
        np.testing.assert_allclose(weights @ nodes ** (order - 1), 1 / order, rtol=0, atol=2e-14)
