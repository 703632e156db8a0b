"""Critical shapes of the bowl, each checked from both sides by continuation."""

from dataclasses import replace

import pytest

from velodrome.reference import critical
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.critical import CriticalPoint, describe_gaps, last_stable, reconnections
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


@pytest.mark.slow
def test_the_last_stable_section_of_another_bicycle_vanishes_there_too() -> None:
    bicycle = replace(BICYCLE, trail=0.2)
    point = last_stable(bicycle, 3, largest=0.1)
    assert point is not None
    assert point.residual < 1e-9
    below, above = (
        stable_sections(trace(bicycle, Paraboloid(point.alpha * (1 + sign * 1e-5)), 3, 0.05)) for sign in (-1, 1)
    )
    assert (len(below), len(above)) == (1, 0)


def test_a_family_that_a_bicycle_does_not_have_is_told() -> None:
    bicycle = replace(BICYCLE, trail=0.06)
    said = describe_gaps(bicycle, 2, largest=0.05)
    assert said is not None
    assert said.startswith("no curve at any alpha from 0 to 0.05: its anchor ends in a fold")
    assert describe_gaps(bicycle, 1, largest=0.05) is None


def test_a_family_that_ends_while_it_is_stable_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """No point is made up where the curve is lost."""

    def lose(bicycle: Bicycle, alpha: float, number: int) -> tuple[None, str] | tuple[tuple[str, str], str]:
        return (None, "lost") if alpha > 0.006 else (("static", "flat"), "")

    monkeypatch.setattr(critical, "_follow_at", lose)
    monkeypatch.setattr(critical, "_find_sections", lambda bicycle, alpha, number: [()] if alpha <= 0.006 else [])
    with pytest.raises(ValueError, match=r"it is stable up to alpha = 0\.00599\d+, beyond which it has no curve: lost"):
        critical.vanishing_between(BICYCLE, 2, 0.005, 0.01)
