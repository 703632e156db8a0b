"""The branch of orbits between both ends of family 4's stable section at alpha = 1/200."""

from functools import lru_cache

import numpy as np
import pytest

from velodrome.reference.bifurcations.orbit_branch import OrbitBranch, follow_orbits
from velodrome.reference.bifurcations.orbit_events import FOLD, TORUS, OrbitEvent, find_events
from velodrome.reference.bifurcations.orbit_search import orbits_of_energy
from velodrome.reference.bifurcations.small_orbits import flow_near

from .test_hopf import hopf_points


@lru_cache
def branch(index: int) -> OrbitBranch:
    return follow_orbits(hopf_points()[index])


@lru_cache
def events(index: int) -> dict[str, OrbitEvent]:
    found = find_events(branch(index))
    assert len({event.kind for event in found}) == len(found)
    return {event.kind: event for event in found}


def test_both_ends_of_the_section_lie_on_one_branch() -> None:
    for first, last in ((2, 3), (3, 2)):
        followed, other = branch(first), hopf_points()[last]
        assert followed.end == "hopf"
        final = followed.orbits[-1]
        assert final.lean_amplitude < 2e-3
        assert other.amplitude_slope is not None
        expected = other.energy + final.lean_amplitude**2 / other.amplitude_slope
        # The next order of the amplitude law is some per cent of the first.
        assert final.energy - other.energy == pytest.approx(expected - other.energy, rel=0.05)
        assert final.period == pytest.approx(2 * np.pi / other.frequency, rel=0.01)


def test_events_are_the_same_from_both_ends() -> None:
    there, back = events(2), events(3)
    assert set(there) == set(back) == {FOLD, TORUS}
    for kind, event in there.items():
        assert event.orbit.energy == pytest.approx(back[kind].orbit.energy, abs=1e-8)
        assert event.orbit.lean_amplitude == pytest.approx(back[kind].orbit.lean_amplitude, abs=1e-8)


def test_the_energy_is_extreme_at_the_fold_and_a_multiplier_is_one() -> None:
    fold = events(2)[FOLD].orbit
    assert fold.energy < min(orbit.energy for orbit in branch(2).orbits)
    # A multiplier passes 1 with the root of the distance to the fold: dE / ds is known to 1e-9 J.
    assert np.abs(fold.multipliers[2:] - 1).min() < 1e-6


def test_both_orbits_next_to_a_fold_are_found_between_neighbours() -> None:
    """At an energy that no two neighbours of the branch have between them; they differ by one unstable direction."""
    fold = events(2)[FOLD]
    nearest = min(orbit.energy for orbit in branch(2).orbits)
    energy = fold.orbit.energy + 0.3 * (nearest - fold.orbit.energy)
    found = orbits_of_energy(branch(2), energy)
    assert len(found) == 2
    assert [orbit.energy for orbit in found] == pytest.approx([energy] * 2, abs=1e-8)
    assert found[0].period > fold.orbit.period > found[1].period  # it falls along this branch
    outside = [int((np.abs(orbit.multipliers[2:]) > 1).sum()) for orbit in found]
    assert abs(outside[0] - outside[1]) == 1
    assert orbits_of_energy(branch(2), fold.orbit.energy - 0.1 * (nearest - fold.orbit.energy)) == []


def test_a_complex_pair_crosses_the_unit_circle_where_orbits_lose_stability() -> None:
    torus = events(3)[TORUS]
    pair = torus.orbit.multipliers[2]
    assert pair.imag != 0
    assert abs(pair) == pytest.approx(1, abs=1e-9)
    growths = [orbit.growth for orbit in branch(3).orbits]
    assert max(growths[: torus.place + 1]) < 1
    assert min(growths[torus.place + 1 :]) > 1


def test_the_lean_has_no_larger_and_no_smaller_value_on_an_orbit() -> None:
    """Both of its turning points are extremes: the amplitude is half of the peak-to-peak."""
    for orbit in branch(2).orbits[::3]:
        flow = flow_near(hopf_points()[2]).moved_to(orbit.state)
        durations = np.append(np.full(8, orbit.unknowns[-2] / 8), np.full(8, orbit.unknowns[-1] / 8))
        ends, _ = flow.ride(orbit.state, durations, np.full(16, 8))
        leans = np.real(ends[:, 2])
        assert orbit.state[2] >= leans.max() - 1e-12
        assert leans.min() >= orbit.state[2] - 2 * orbit.lean_amplitude - 1e-12
