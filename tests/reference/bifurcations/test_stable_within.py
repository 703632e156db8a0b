from functools import lru_cache

import numpy as np
import pytest

from velodrome.reference.bifurcations.orbit_branch import follow_orbits
from velodrome.reference.bifurcations.stable_within import BoundedCircle, bound_circle, bound_section
from velodrome.reference.circular import CircularMotion, Steady, mirror_motion
from velodrome.reference.families import find_motion, trace
from velodrome.reference.inputs import Inputs
from velodrome.reference.sections import stable_sections
from velodrome.reference.surface import Plane

from .test_hopf import BICYCLE, BOWL, family, hopf_points
from .test_rides import ride


@lru_cache
def circles_of_family_4() -> list[BoundedCircle]:
    """Bounds by orbits of the branch from the subcritical end."""
    curve = family(4)
    (section,) = stable_sections(curve)
    return bound_section(curve, section, [follow_orbits(hopf_points()[2])], 9)


def find_circle(bounded: BoundedCircle, number: int) -> CircularMotion:
    _, _, lean, steer, _, _, rear_rate = bounded.state.tolist()
    return find_motion(BICYCLE, BOWL, rear_rate, number, (lean, steer))[1]


def test_circles_of_family_4_are_stable_within_a_third_of_a_degree() -> None:
    """At the alpha of 1/200; the bound shrinks to zero at the subcritical end, with the root of the energy."""
    circles, end = circles_of_family_4(), hopf_points()[2]
    bounds = [circle.stable_within for circle in circles]
    assert all(bound is not None and 0 < bound < np.radians(1 / 3) for bound in bounds)
    assert end.amplitude_slope is not None
    nearest = min(circles, key=lambda circle: abs(circle.energy - end.energy))
    law = np.sqrt(end.amplitude_slope * (nearest.energy - end.energy))
    assert nearest.stable_within == pytest.approx(law, rel=0.02)


def test_a_circle_alone_has_the_bound_that_its_section_gives_it() -> None:
    """Its curve is followed from itself, and orbits from both ends; here in a turn to the right."""
    known = circles_of_family_4()[2]
    found = bound_circle(Steady(BICYCLE, BOWL), mirror_motion(find_circle(known, 4)))
    assert found.why_not is None
    assert found.energy == pytest.approx(known.energy, rel=1e-12)
    # A multiplier within 1e-3 of 1 makes round-off of 1e-13 one of 1e-10.
    assert found.stable_within == pytest.approx(known.stable_within, abs=1e-9)
    assert found.orbit is not None
    assert found.orbit.state[2] < 0


@pytest.mark.slow
@pytest.mark.parametrize("place", [0, 4, 8])
def test_a_circle_of_family_2_has_the_bound_that_its_section_gives_it(place: int) -> None:
    curve = family(2)
    (section,) = stable_sections(curve)
    known = bound_section(curve, section, [follow_orbits(hopf_points()[0], largest=0.05)], 9)[place]
    found = bound_circle(Steady(BICYCLE, BOWL), find_circle(known, 2))
    assert found.stable_within == pytest.approx(known.stable_within, abs=1e-9)


def test_circles_without_orbits_say_why() -> None:
    curve = trace(BICYCLE, Plane(), 2)
    ((_, end),) = stable_sections(curve)
    for equations, motion, words in (
        (Steady(BICYCLE, Plane()), end.motion, "the circle's centre is free"),
        (Steady(BICYCLE, BOWL, Inputs(steer_damping=0.1)), hopf_points()[0].motion, "the energy is not conserved"),
    ):
        found = bound_circle(equations, motion)
        assert found.stable_within is None
        assert words in (found.why_not or "")


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
