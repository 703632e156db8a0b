import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bifurcations.bautin import find_bautin_points, solve_bautin
from velodrome.reference.bifurcations.hopf import section_hopf_points
from velodrome.reference.bifurcations.small_orbits import small_orbits
from velodrome.reference.families import trace
from velodrome.reference.surface import Paraboloid

# Number of the family, index of the end of its stable sections, alpha.
KNOWN = [(2, 0, 0.031055750472), (4, 1, 0.009106767627)]


@pytest.mark.parametrize(("number", "end", "alpha"), KNOWN)
def test_orbits_confirm_that_the_first_coefficient_is_zero(number: int, end: int, alpha: float) -> None:
    """The energy of orbits is E0 + c A^4 + O(A^6) there, and a multiplier leaves 1 with A^4."""
    point = section_hopf_points(trace(Bicycle(), Paraboloid(alpha), number))[end]
    small, large = small_orbits(point, [2.5e-4, 5e-4])
    energies = [orbit.energy - point.energy for orbit in (small, large)]
    departures = [np.abs(orbit.multipliers[2:] - 1).min() for orbit in (small, large)]
    # The next order is some per cent at the larger amplitude; with a coefficient of A^2 the powers would be 2.
    assert np.log2(energies[1] / energies[0]) == pytest.approx(4, abs=0.1)
    assert np.log2(departures[1] / departures[0]) == pytest.approx(4, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "end", "alpha"), KNOWN)
def test_degenerate_points_are_found_between_two_shapes(number: int, end: int, alpha: float) -> None:
    (found,) = find_bautin_points(Bicycle(), number, (alpha - 3e-5, alpha + 2e-5))
    # A coefficient of 1e3 with an error of 1e-9 has a slope of 1e7 in alpha.
    assert found.alpha == pytest.approx(alpha, abs=1e-12)
    again = section_hopf_points(trace(Bicycle(), Paraboloid(found.alpha), number))[end]
    assert found.point.motion.lean == again.motion.lean


def test_a_coefficient_that_jumps_is_no_degenerate_point() -> None:
    """As if the other end of the section were that at the larger alpha."""
    alpha = 0.005
    slow, fast = section_hopf_points(trace(Bicycle(), Paraboloid(alpha), 2))
    with pytest.raises(ValueError, match=r"changes its sign at alpha = 0\.005 without being zero"):
        solve_bautin(Bicycle(), 2, 0, (alpha - 1e-13, slow), (alpha, fast))


def test_no_point_is_found_where_the_sign_stays() -> None:
    assert find_bautin_points(Bicycle(), 2, (0.004, 0.006)) == []
