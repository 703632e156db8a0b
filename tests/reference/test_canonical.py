"""Tests of solutions whose bits do not depend on the guess that led to them."""

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.circular import Steady, make_canonical, newton, rear_rate_condition
from velodrome.reference.families import trace
from velodrome.reference.surface import Paraboloid


@pytest.mark.parametrize("family", [1, 2, 3, 4])
def test_bits_do_not_depend_on_the_guess(family):
    """Guesses 1e-4 apart lead to solutions that differ by round-off, and to the same canonical one."""
    rng, surface = np.random.default_rng(family), Paraboloid(0.02)
    equations, compared = Steady(Bicycle(), surface), 0
    for point in trace(Bicycle(), surface, family).points[2:-2:4]:
        u = point.unknowns
        condition = rear_rate_condition(float(equations.motion(u).rear_rate))
        first, certain = make_canonical(equations, u, condition)
        for guess in u * (1 + 1e-4 * rng.standard_normal((3, len(u)))):
            try:
                other, _ = newton(equations, guess, condition)
            except ValueError:
                continue
            if np.abs(other - u).max() > 1e-6 * (1 + np.abs(u).max()):  # on the other side of a fold
                continue
            again, also_certain = make_canonical(equations, other, condition)
            assert also_certain == certain
            if certain:
                compared += 1
                np.testing.assert_array_equal(again, first)
    assert compared > 15


def test_canonical_solution_is_the_solution():
    """The result differs from the given solution by round-off times the equations' condition, about 1e3."""
    surface = Paraboloid(0.02)
    equations = Steady(Bicycle(), surface)
    for point in trace(Bicycle(), surface, 2).points[2:-2]:
        condition = rear_rate_condition(float(equations.motion(point.unknowns).rear_rate))
        full, _ = make_canonical(equations, point.unknowns, condition)
        assert np.abs(full - point.unknowns).max() < 1e-12 * (1 + np.abs(point.unknowns).max())
