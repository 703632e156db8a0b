"""Critical shapes of the bowl, each checked from both sides by continuation."""

import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.critical import CriticalPoint, last_stable, reconnections
from velodrome.reference.families import find_motion, trace
from velodrome.reference.sections import stable_sections
from velodrome.reference.surface import Paraboloid

BICYCLE = Bicycle()


def exchanged(point: CriticalPoint, number: int, share: float) -> bool:
    """Whether a family ends elsewhere just above the point's alpha than just below."""
    below, above = (trace(BICYCLE, Paraboloid(point.alpha * (1 + sign * share)), number, 0.02).ends for sign in (-1, 1))
    return below != above


def test_families_two_and_four_touch_where_the_cusps_meet() -> None:
    (point,) = reconnections(BICYCLE, largest=0.03)
    assert point.families == (2, 4)
    # Rows of order one to round-off.
    assert point.residual < 1e-12
    # Continuation steps over gaps that are small against its own steps: the curves part like the root of
    # what alpha is off, so a hundredth of it opens some hundredths of a radian.
    assert exchanged(point, 2, 1e-2)
    assert exchanged(point, 4, 1e-2)
    assert 0.011 < point.alpha < 1 / 33, "the paper's figures have D and I at 1/200, neither at 1/20"
    # The touching point is a motion of both families' curves nearby.
    for number in (2, 4):
        near = (point.motion.lean, point.motion.steer)
        found = find_motion(BICYCLE, Paraboloid(point.alpha * 0.999), point.motion.rear_rate * 1.02, number, near)[1]
        assert abs(found.lean - point.motion.lean) < 0.05


@pytest.mark.slow
def test_families_touch_three_times_up_to_one() -> None:
    points = reconnections(BICYCLE)
    assert [point.families[0] for point in points] == [2, 1, 1]
    assert points[1].families == (1, 3)
    for point in points:
        assert point.residual < 1e-12
        assert exchanged(point, point.families[0], 1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("number", [2, 4])
def test_last_stable_sections_vanish_there(number: int) -> None:
    point = last_stable(BICYCLE, number)
    assert point is not None
    # A growth rate is known to some 1e-11, and changes with alpha by tens: alpha to 1e-11.
    assert point.residual < 1e-9
    below, above = (
        stable_sections(trace(BICYCLE, Paraboloid(point.alpha * (1 + sign * 1e-5)), number, 0.05)) for sign in (-1, 1)
    )
    assert len(below) == 1
    assert not above


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 3])
def test_families_one_and_three_are_never_stable(number: int) -> None:
    assert last_stable(BICYCLE, number) is None
