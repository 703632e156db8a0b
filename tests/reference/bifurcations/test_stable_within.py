import numpy as np
import pytest

from velodrome.reference.bifurcations.orbit_branch import follow_orbits
from velodrome.reference.bifurcations.stable_within import bound_section
from velodrome.reference.sections import stable_sections

from .test_hopf import family, hopf_points
from .test_rides import ride


def test_circles_of_family_4_are_stable_within_a_third_of_a_degree() -> None:
    """At the alpha of 1/200; the bound shrinks to zero at the subcritical end, with the root of the energy."""
    curve, end = family(4), hopf_points()[2]
    branches = [follow_orbits(end)]
    (section,) = stable_sections(curve)
    circles = bound_section(curve, section, branches, 9)
    bounds = [circle.stable_within for circle in circles]
    assert all(bound is not None and 0 < bound < np.radians(1 / 3) for bound in bounds)
    assert end.amplitude_slope is not None
    nearest = min(circles, key=lambda circle: abs(circle.energy - end.energy))
    law = np.sqrt(end.amplitude_slope * (nearest.energy - end.energy))
    assert nearest.stable_within == pytest.approx(law, rel=0.02)


def test_rides_return_within_the_bound_and_leave_beyond_it() -> None:
    """Along the orbit's own direction, on the circle in the middle of family 2's section."""
    curve, end = family(2), hopf_points()[0]
    (section,) = stable_sections(curve)
    (circle,) = bound_section(curve, section, [follow_orbits(end, largest=0.05)], 1)
    assert circle.orbit is not None
    offset, period = circle.orbit.state - circle.state, circle.orbit.period
    inside = ride(end, circle.energy, 0.97 * offset, period, 150)
    outside = ride(end, circle.energy, 1.03 * offset, period, 10)
    assert inside[-1] < 0.2 * inside[0]
    assert outside[-1] > 1.05 * outside[0]
