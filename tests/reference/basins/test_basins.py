"""Basins of Q2, the stable circle of family 2 on the bowl of alpha = 1/200, at a rear rate of 18 rad/s."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from velodrome.reference.basins import riding
from velodrome.reference.basins.disturbance import disturb, disturb_on_level, start_energies
from velodrome.reference.basins.edge import find_edge, make_shoot, narrow
from velodrome.reference.basins.edge_state import follow_edge
from velodrome.reference.basins.neighbours import MIRROR, NotStable, StableNeighbours, find_stable_neighbours
from velodrome.reference.basins.outcome import (
    ELSEWHERE,
    FELL,
    KINDS,
    LOST_CONTACT,
    NO_START,
    ORBIT,
    RETURNED,
    UNDECIDED,
    RideOutcome,
)
from velodrome.reference.basins.riding import choose_patience, ride_out
from velodrome.reference.basins.stretch import _find_first_zero, find_lost_contact
from velodrome.reference.basins.survey import count_share, draw_box, map_outcomes
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bifurcations.orbit_search import find_bounding_orbit
from velodrome.reference.circular import mirror_motion
from velodrome.reference.families import find_motion
from velodrome.reference.simulate import RideStart, simulate
from velodrome.reference.stability import VARIABLES, independent
from velodrome.reference.surface import Paraboloid

BICYCLE, BOWL = Bicycle(), Paraboloid(1 / 200)
LEAN, STEER, LEAN_RATE, STEER_RATE = (VARIABLES.index(name) for name in ("lean", "steer", "lean_rate", "steer_rate"))


@lru_cache
def q2() -> StableNeighbours:
    return find_stable_neighbours(BICYCLE, BOWL, find_motion(BICYCLE, BOWL, 18.0, 2)[1])


def change(index: int, *sizes: float) -> np.ndarray:
    return np.outer(sizes, np.eye(7)[index])


def ride(changes: Sequence[np.ndarray] | np.ndarray, relative: float = 1e-3) -> list[RideOutcome]:
    found = q2()
    return ride_out(found, disturb(found.equations, found.motion, np.array(changes)), choose_patience(found, relative))


def test_circles_between_the_solved_ones_are_circles_and_decay_as_the_modes_say() -> None:
    """The interpolated circles are held against Newton's method, and the slowest mode against printed eigenvalues."""
    found = q2()
    assert found.interpolation_error < 1e-7  # a thousandth of the smallest orbit's amplitude that bounds a ride
    assert found.own_modes.slowest.real == pytest.approx(-0.01111, abs=5e-6)
    assert found.own_modes.slowest.imag == pytest.approx(2.35022, abs=2e-4)
    energies = np.linspace(*found.limits, 7)[1:-1]
    circles = found.interpolate_circles(energies)
    for energy, circle in zip(energies, circles, strict=True):
        rates = found.flow.moved_to(circle).rates(circle)
        assert np.abs(rates).max() < 1e-6
        state = found.flow.moved_to(circle).near
        start = RideStart(BICYCLE, BOWL, state[:9], state[9:18])
        assert start_energies([start])[0] == pytest.approx(energy, rel=1e-9)


def test_the_size_of_a_deviation_decays_as_the_eigenvalues_say() -> None:
    """In the slowest mode alone, a deviation of 1e-6 has exp(-gamma t) of its size left after t, to second order."""
    found = q2()
    forms, slowest = found.own_modes.forms, found.own_modes.slowest
    (start,) = disturb_on_level(found.equations, found.motion, change(LEAN_RATE, 1e-5))
    assert start is not None
    motion = simulate(BICYCLE, BOWL, start.q, start.qd, np.linspace(0.0, 40.0, 401))
    deviations = independent(motion.q, motion.qd) - independent(*found.motion.state())
    sizes = np.sqrt(np.einsum("mi,ij,mj->m", deviations, forms[0], deviations))
    assert sizes[-1] / sizes[0] == pytest.approx(np.exp(slowest.real * 40.0), rel=1e-3)


def test_small_disturbances_return_and_their_rides_end_on_the_circle_of_their_energy() -> None:
    """Decided after less than a minute, the ride is 900 s later within e^(-0.0111 * 900) of its circle."""
    found = q2()
    outcomes = ride(change(LEAN_RATE, 0.1))
    assert [outcome.kind for outcome in outcomes] == [RETURNED]
    (start,) = disturb(found.equations, found.motion, change(LEAN_RATE, 0.1))
    assert start is not None
    motion = simulate(BICYCLE, BOWL, start.q, start.qd, np.array([0.0, 900.0]), tolerance=1e-11)
    off = independent(motion.q[-1], motion.qd[-1]) - found.interpolate_circles(np.array([outcomes[0].energy]))[0]
    assert np.abs(off).max() < 1e-4


def test_the_edge_along_the_lean_rate_is_sharp_and_independent_of_tolerance_and_stretch() -> None:
    """Both sides differ by 1e-6; coarser integration, and judging after other times, move the edge by less."""
    found, direction = q2(), np.eye(7)[LEAN_RATE]
    patience = choose_patience(found, 1e-6)
    edge = find_edge(make_shoot(found, direction, patience), direction, np.geomspace(0.05, 0.8, 9), 1e-6)
    assert edge.size == pytest.approx(0.187291, abs=1e-6)
    assert edge.error is not None
    assert edge.error < 1e-6
    assert edge.inside is not None
    assert edge.outside is not None
    assert edge.inside.outcome.kind == RETURNED
    assert edge.outside.outcome.kind == LOST_CONTACT
    assert edge.outside.outcome.detail == "rear"
    other = replace(patience, tolerance=1e-12, stretch=0.7 * patience.stretch, interval=0.5 * patience.interval)
    again = make_shoot(found, direction, other)(np.array([edge.inside.size - 1e-6, edge.outside.size + 1e-6]))
    assert [shot.outcome.survived for shot in again] == [True, False]


def test_the_edge_leads_to_the_orbit_that_bounds_the_circle() -> None:
    """Two independent ways: bisected rides followed along the edge, and the branch born at the Hopf point.

    The ride ends within 1e-3 of the orbit, as it is followed until it repeats itself to that; the orbit that is then
    solved for from it is the branch's to the residual of both.
    """
    found, direction = q2(), np.eye(7)[LEAN_RATE]
    patience = choose_patience(found, 1e-6)
    shoot = make_shoot(found, direction, patience)
    survived, lost = shoot(np.array([0.1872, 0.1874]))
    inside, outside = narrow(shoot, survived, lost, 1e-6)
    state = follow_edge(found, inside, outside, patience, 600.0)
    assert state is not None
    assert state.settled
    assert state.orbit is not None
    known = find_bounding_orbit(found.branches[0], state.energy)
    assert known is not None
    assert state.lean_amplitude == pytest.approx(known.lean_amplitude, rel=2e-3)
    assert state.period == pytest.approx(known.period, rel=2e-3)
    assert state.orbit.lean_amplitude == pytest.approx(known.lean_amplitude, rel=1e-9)
    assert (np.abs(state.orbit.multipliers[2:]) > 1).sum() == 1


def test_what_a_bowl_and_a_mirror_make_of_a_disturbance() -> None:
    """Faster circles weave on; large disturbances lift a wheel at once, or cannot be started at all."""
    kinds = [outcome.kind for outcome in ride([*change(STEER, 0.12, -0.36), *change(LEAN, 0.9)])]
    assert kinds == [ORBIT, LOST_CONTACT, NO_START]
    found = q2()
    mirrored = replace(
        found,
        motion=mirror_motion(found.motion),
        hand=-found.hand,
        circles=found.circles * MIRROR,
    )
    starts = disturb(found.equations, mirrored.motion, MIRROR * change(LEAN_RATE, 0.15, 0.25))
    there = ride_out(mirrored, starts, choose_patience(found, 1e-3))
    here = ride(change(LEAN_RATE, 0.15, 0.25))
    assert [outcome.kind for outcome in there] == [RETURNED, LOST_CONTACT] == [outcome.kind for outcome in here]


@pytest.mark.slow
def test_the_mirror_image_of_q2_is_found_on_the_same_section() -> None:
    found = find_stable_neighbours(BICYCLE, BOWL, mirror_motion(q2().motion))
    assert found.hand == -q2().hand
    assert np.allclose(found.circles, MIRROR * q2().circles, rtol=1e-8)


def test_a_ride_to_a_circle_of_another_family_is_seen() -> None:
    """Near a stable circle of family 4, whose energy no stable circle of family 2 has."""
    _, other = find_motion(BICYCLE, BOWL, 11.1, 4, (0.479, 2.615))
    found = q2()
    (start,) = disturb(found.equations, other, change(LEAN_RATE, 1e-4))
    patience = replace(choose_patience(found, 0.5), longest=1.0)
    (outcome,) = ride_out(found, [start], patience)
    assert not found.are_inside(np.array([outcome.energy]))[0]
    assert outcome.kind == ELSEWHERE


def test_rides_that_have_not_left_the_edge_are_undecided() -> None:
    found = q2()
    starts = disturb(found.equations, found.motion, change(LEAN_RATE, 0.1872910))
    (outcome,) = ride_out(found, starts, replace(choose_patience(found, 1e-2), longest=1.0))
    assert outcome.kind == UNDECIDED
    assert not outcome.survived
    assert not outcome.lost


def test_a_ride_on_its_way_back_that_is_left_too_early_is_undecided_and_not_elsewhere() -> None:
    """Half of the orbit's size is not reached yet after one stretch, though the deviation decays."""
    found = q2()
    assert found.orbit is not None
    circle = independent(*found.motion.state())
    state = found.flow.moved_to(circle + 0.75 * (found.orbit.state - circle)).near
    start = RideStart(BICYCLE, BOWL, state[:9], state[9:18], until_fall=True)
    patience = choose_patience(found, 1e-2)
    (early,) = ride_out(found, [start], replace(patience, longest=1.0))
    (late,) = ride_out(found, [start], patience)
    assert [early.kind, late.kind] == [UNDECIDED, RETURNED]
    assert late.time > 2 * patience.stretch


def test_disturbances_at_a_fixed_energy_keep_it() -> None:
    found = q2()
    changes = np.array([[0, 0, 0.02, 0, 0.1, -0.2, 0], [0, 0, 0, 0.03, 0, 0, 0], [0, 0, 0, 0, 1e3, 0, 0]], float)
    starts = disturb_on_level(found.equations, found.motion, changes)
    energies = start_energies(starts)
    assert energies[:2] == pytest.approx(found.energy, rel=1e-13)
    assert starts[2] is None or energies[2] == pytest.approx(found.energy, rel=1e-13)
    for start, made in zip(starts[:2], changes, strict=False):
        assert start is not None
        off = independent(start.q, start.qd) - independent(*found.motion.state())
        assert off[:6] == pytest.approx(made[:6], abs=1e-12)
        assert abs(off[6]) > 1e-3  # the rear rate makes up for it


def test_a_map_has_the_outcomes_of_its_rides_and_their_share() -> None:
    found = q2()
    values = np.array([-0.1, 0.15]), np.array([-1.0, 0.0, 0.3])
    seen = map_outcomes(found, ("lean_rate", "steer_rate"), values, choose_patience(found, 1e-2))
    changes = [change(LEAN_RATE, x)[0] + change(STEER_RATE, y)[0] for y in values[1] for x in values[0]]
    alone = ride(np.array(changes))
    share = count_share(alone)
    assert share.survived == sum(outcome.survived for outcome in alone)
    assert 0 < share.survived < share.rides == 6
    assert [KINDS[k] for k in seen.kinds.ravel()] == [outcome.kind for outcome in alone]


def test_draws_fill_their_box_evenly() -> None:
    reach = np.array([0, 0, 0, 0.5, 2.0, 1.0, 0])
    drawn = draw_box(reach, 4000)
    assert np.all(np.abs(drawn) <= reach)
    # A variance of reach^2 / 3, to its standard error of a part in 44.
    assert drawn[:, 3:6].std(axis=0) == pytest.approx(reach[3:6] / 3**0.5, rel=0.05)
    assert np.array_equal(drawn, draw_box(reach, 4000))
    assert not np.array_equal(drawn, draw_box(reach, 4000, seed=1))


def test_contact_is_lost_where_a_force_passes_zero_between_samples() -> None:
    times = np.arange(9) * 0.1
    dip = (times - 0.43) ** 2 - 1e-4  # positive in every sample
    assert dip.min() > 0
    assert _find_first_zero(times, dip) == pytest.approx(0.43, abs=1e-12)
    assert _find_first_zero(times, dip + 2e-4) is None
    assert _find_first_zero(times, 0.25 - times) == pytest.approx(0.25)
    assert _find_first_zero(times, times - 0.25) == 0.0


def test_contact_of_a_ride_is_lost_where_its_force_is() -> None:
    (start,) = disturb(q2().equations, q2().motion, change(LEAN_RATE, 0.6))
    assert start is not None
    motion = simulate(BICYCLE, BOWL, start.q, start.qd, np.arange(500) * 1e-3)
    found = find_lost_contact(BOWL, motion)
    assert found is not None
    (outcome,) = ride(change(LEAN_RATE, 0.6))
    assert outcome.kind == LOST_CONTACT
    assert outcome.detail == found[1]
    assert outcome.time == pytest.approx(found[0], abs=7e-3)  # an eighth of the samples' interval: a straight line


def test_unstable_circles_have_no_basin() -> None:
    _, q1 = find_motion(BICYCLE, BOWL, 18.0, 1)
    with pytest.raises(NotStable, match="no stable section"):
        find_stable_neighbours(BICYCLE, BOWL, q1)


def test_bicycles_fall_where_wheels_may_be_pulled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(riding, "find_lost_contact", lambda surface, motion: None)
    (outcome,) = ride(change(LEAN_RATE, 0.6))
    assert outcome.kind == FELL
    found = q2()
    (start,) = disturb(found.equations, found.motion, change(LEAN_RATE, 0.6))
    assert start is not None
    motion = simulate(BICYCLE, BOWL, start.q, start.qd, np.array([0.0, 100.0]), until_fall=True)
    assert motion.fall is not None
    assert outcome.time == pytest.approx(motion.fall.time[0], abs=1e-6)
