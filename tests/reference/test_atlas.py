"""The atlas against single curves, and its boundaries against what is known of them."""

from functools import cache

import numpy as np
import pytest

from velodrome.reference.atlas import Atlas, Boundary, compute_atlas, spacing
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.families import FAMILIES, find_motion, trace
from velodrome.reference.sections import stable_sections
from velodrome.reference.stability import growth_rate, linearise
from velodrome.reference.surface import Paraboloid

BICYCLE = Bicycle()
ALPHAS = (0.0, 0.005, 0.009, 0.02, 0.0333, 0.05, 0.3, 0.44, 0.5)
LONGEST = 0.05


@cache
def small() -> Atlas:
    return compute_atlas(BICYCLE, ALPHAS, LONGEST)


def boundary(family: int) -> Boundary:
    (found,) = (one for one in small().boundaries if one.family == family)
    return found


def test_every_family_is_there_or_said_to_be_absent() -> None:
    present = {(curve.alpha, curve.family) for curve in small().curves}
    absent = {(one.alpha, one.family) for one in small().absent}
    assert present | absent == {(alpha, family) for alpha in ALPHAS for family in FAMILIES}
    assert absent == {(0.44, 3), (0.44, 4)}, "from 0.420 to 0.464 there is no pivoting motion to start from"
    assert all("pivoting motion" in one.reason for one in small().absent)


@pytest.mark.parametrize(("alpha", "family"), [(0.0, 4), (0.005, 2), (0.3, 3), (0.5, 1), (0.5, 4)])
def test_a_curve_of_the_atlas_is_the_traced_one(alpha: float, family: int) -> None:
    """Its anchor came from the shape before, not from the plane."""
    (curve,) = (one for one in small().curves if (one.alpha, one.family) == (alpha, family))
    traced = trace(BICYCLE, Paraboloid(alpha), family, LONGEST)
    assert curve.ends == traced.ends
    assert len(curve.samples.lean) == len(traced.points)
    # Both start at the same anchor to round-off; some 100 steps from there pass it on, each a little larger.
    angles = np.array([curve.samples.lean, curve.samples.steer]).T
    expected = np.array([point.unknowns[[3, 5]] for point in traced.points])
    assert np.abs(angles - expected).max() < 1e-8


@pytest.mark.parametrize(("alpha", "family"), [(0.0, 2), (0.005, 4), (0.05, 1), (0.3, 3), (0.5, 2)])
def test_a_point_of_the_atlas_is_a_motion_with_its_growth_rate(alpha: float, family: int) -> None:
    (curve,) = (one for one in small().curves if (one.alpha, one.family) == (alpha, family))
    seen = curve.samples
    for i in np.flatnonzero((seen.rear_rate > 5) & (seen.radius < 20))[::40]:
        near, surface = (float(seen.lean[i]), float(seen.steer[i])), Paraboloid(alpha)
        motion = find_motion(BICYCLE, surface, float(seen.rear_rate[i]), family, near)[1]
        # Next to a fold in the rear rate angles move like its root.
        assert np.hypot(motion.lean - near[0], motion.steer - near[1]) < 1e-7
        alone = linearise(BICYCLE, surface, *motion.state())
        growth = growth_rate(surface, alone.eigenvalues, motion.yaw_rate)
        # Growth rates change by some 10 / s over a radian.
        assert seen.growth_rate[i] == pytest.approx(growth, abs=1e-5)
        assert seen.stable[i] == (growth < 0)


@pytest.mark.parametrize("family", [2, 4])
def test_boundaries_are_the_ends_of_the_stable_sections(family: int) -> None:
    found = boundary(family)
    for alpha, ends in zip(found.alpha, found.ends, strict=True):
        ((start, end),) = stable_sections(trace(BICYCLE, Paraboloid(alpha), family, 0.03))
        for one, other in zip(ends, (start, end), strict=True):
            assert one.cause == other.cause
            # Ends are solved to 1e-9 in the arc; the rear rate changes by some 10 over it.
            assert one.motion.rear_rate == pytest.approx(other.motion.rear_rate, abs=1e-7)


def test_on_the_plane_one_end_is_an_energy_extremum_and_in_a_bowl_none_is() -> None:
    for family in (2, 4):
        causes = [tuple(end.cause for end in ends) for ends in boundary(family).ends]
        assert causes[0] == ("energy", "hopf")
        assert set(causes[1:]) == {("hopf", "hopf")}


def test_boundaries_end_in_the_critical_points() -> None:
    for family, last in ((2, 0.0333), (4, 0.009)):
        found = boundary(family)
        vanishing = found.vanishing
        assert vanishing is not None
        (following,) = (alpha for i, alpha in enumerate(ALPHAS) if ALPHAS[i - 1] == last)
        assert last < vanishing.alpha < following
        # Both ends close in on it like the root of the distance in alpha, from the last of the curves on.
        first = found.alpha.index(last)
        assert first < len(found.alpha) - 1
        widths = []
        for alpha, (start, end) in list(zip(found.alpha, found.ends, strict=True))[first:]:
            low, high = sorted([start.motion.lean, end.motion.lean])
            assert low < vanishing.motion.lean < high
            widths.append((high - low) / np.sqrt(vanishing.alpha - alpha))
        assert max(widths) < 1.1 * min(widths)


def test_every_end_in_a_bowl_has_a_criticality_and_on_the_plane_none_has() -> None:
    for family in (2, 4):
        on_plane, *in_bowls = boundary(family).hopf
        assert on_plane[0] is None, "the energy is extreme there"
        assert on_plane[1] is not None
        assert "centre is free" in (on_plane[1].why_undefined or "")
        for point in (point for points in in_bowls for point in points):
            assert point is not None
            assert point.amplitude_slope is not None
            assert point.amplitude_slope_error is not None
            # Third derivatives have ten digits; the pair nearly touches the axis next to the end of a region.
            assert point.amplitude_slope_error < 1e-7 * abs(point.amplitude_slope)


@pytest.mark.parametrize(
    ("family", "side", "alpha", "before", "after"),
    [
        (2, 0, 0.031055750472, ["subcritical", "supercritical"], ["supercritical", "supercritical"]),
        (4, 1, 0.009106767627, ["subcritical", "supercritical"], ["subcritical", "subcritical"]),
    ],
)
def test_an_end_changes_its_criticality_at_one_degenerate_point(
    family: int, side: int, alpha: float, before: list[str], after: list[str]
) -> None:
    """That of family 4 lies between the last of these shapes and the one where both ends meet."""
    found = boundary(family)
    ((where, degenerate),) = found.bautin
    assert where == ("start", "end")[side]
    assert degenerate.alpha == pytest.approx(alpha, abs=1e-11)
    for shape, points in list(zip(found.alpha, found.hopf, strict=True))[1:]:
        kinds = [point.criticality for point in points if point is not None]
        assert kinds == (before if shape < alpha else after)
    assert found.vanishing is not None
    assert alpha < found.vanishing.alpha


def test_families_one_and_three_have_no_boundary() -> None:
    assert {one.family for one in small().boundaries} == {2, 4}


def test_spacing_gives_the_asked_number_of_motions() -> None:
    size = 6000
    found = compute_atlas(BICYCLE, *spacing(size, largest=0.04))
    # The length of the arcs, taken as a constant, changes by a sixth with alpha.
    assert found.size == pytest.approx(size, rel=0.3)
    assert found.alphas[0] == 0
    assert found.alphas[-1] == pytest.approx(0.04)
    assert np.all(np.diff(found.alphas) > 0)


def test_spacing_is_fine_where_things_happen() -> None:
    alphas, longest = spacing()
    assert np.diff(alphas[alphas <= 0.04]).max() < 3e-4
    assert alphas[-1] == 1.0
    assert longest < LONGEST
