"""Engines at the ends of stable sections: where their own Hopf points lie, and how they ride the orbits born there."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import Engine, Problem, Settings
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bifurcations.hopf import SUBCRITICAL, HopfPoint, section_hopf_points
from velodrome.reference.bifurcations.near_circles import state_of_variables
from velodrome.reference.bifurcations.orbits import find_monodromy
from velodrome.reference.bifurcations.small_orbits import flow_near, small_orbits
from velodrome.reference.bifurcations.step_shift import eigenvalue_slope
from velodrome.reference.families import trace
from velodrome.reference.surface import Paraboloid
from velodrome.reports.measure.convergence import observed_orders
from velodrome.reports.measure.orbit_following import follow_orbit, predict_differences
from velodrome.reports.measure.own_circle import OwnCircle, measure_at_start, measure_own_circle
from velodrome.reports.measure.stability_boundary import circle_problem, locate_boundary
from velodrome.reports.measure.step_laws import predict_shift, second_order_method

BICYCLE, BOWL = Bicycle(), Paraboloid(1 / 200)
FASTEST = 20.0  # of the wheels and weaves at these circles [rad/s]
# Windows shorter than half a weave [s]: after gaps have decayed by e^-20, and generalized alpha's own oscillations by
# 0.8^50 at steps up to 10 ms.
REFERENCE, EXUDYN, MULTIPLIERS = "reference", "exudyn", "mujoco-multipliers"
WINDOWS = {MULTIPLIERS: (1.0, 0.2), EXUDYN: (0.5, 0.2)}
OWN: dict[str, dict[str, Any]] = {
    REFERENCE: {"integrator": "modified-euler"},
    EXUDYN: {"newton_relative_tolerance": 1e-12},
    MULTIPLIERS: {},
}


@cache
def point(family: int, index: int) -> HopfPoint:
    return section_hopf_points(trace(BICYCLE, BOWL, family))[index]


def engine_at(name: str, step: float) -> tuple[Engine, Settings]:
    engine = load_engine(name)
    return engine, engine.settings.model_validate(OWN[name] | {"step": step})


def own_circle(name: str, step: float, start: Problem, frequency: float) -> OwnCircle:
    engine, settings = engine_at(name, step)
    if name == REFERENCE:  # its constraints drift from the start on
        return measure_at_start(engine, settings, start, 1j * frequency, step)
    return measure_own_circle(engine, settings, start, 1j * frequency, WINDOWS[name])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings"), [(EXUDYN, {"spectral_radius": 0.6}), (MULTIPLIERS, {"stabilisation": 60.0})]
)
def test_the_law_knows_the_methods_parameters(name: str, settings: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(OWN, name, OWN[name] | settings)
    coarse, fine = (eigenvalue_deviation(name, step, point(2, 1)) for step in (0.005, 0.0025))
    if name == EXUDYN:  # the next power of the step, relative
        assert 0 < fine < FASTEST * 0.0025
        assert fine / coarse == pytest.approx(0.5, abs=0.1)
    else:  # all powers; a stencil's noise of 1e-11 in the eigenvalue, over a change of 1e3 h^4
        assert coarse < 1e-3
        assert fine < 1e-3 + 1e-11 / (1e3 * 0.0025**4)


def eigenvalue_deviation(name: str, step: float, hopf: HopfPoint) -> float:
    """Return by how much the change of the weave's eigenvalue deviates from its law, relative to the law."""
    law = predict_shift(hopf, engine_at(name, step)[1])
    assert law is not None
    weave, rear_rate = 1j * hopf.frequency, hopf.motion.rear_rate
    found = own_circle(name, step, circle_problem(hopf, rear_rate), hopf.frequency)
    slope = eigenvalue_slope(flow_near(hopf), *hopf.motion.state(), weave)
    change = found.eigenvalue - weave - slope * (found.rear_rate - rear_rate)
    return abs(change - law.eigenvalue) / abs(law.eigenvalue)


@pytest.mark.parametrize(("name", "step"), [(REFERENCE, 0.0025), (MULTIPLIERS, 0.01), (EXUDYN, 0.01)])
def test_the_eigenvalue_at_the_fast_end_moves_by_the_law(name: str, step: float) -> None:
    # The next power of the step, relative.
    assert eigenvalue_deviation(name, step, point(2, 1)) < FASTEST * step


def test_the_boundary_of_the_papers_method_moves_by_the_law() -> None:
    hopf = point(2, 1)
    # The law is that of the step itself; that a ride leaves the constraints is of the next power of the step.
    assert boundary_ratio(REFERENCE, 0.0025, hopf) == pytest.approx(1, abs=FASTEST * 0.0025)


def boundary_ratio(name: str, step: float, hopf: HopfPoint) -> float:
    """Return the shift of an engine's boundary, from where its own weave neither grows nor dies out, over the law's."""
    law = predict_shift(hopf, engine_at(name, step)[1])
    assert law is not None
    found = locate_boundary(hopf, lambda start: own_circle(name, step, start, hopf.frequency))
    assert found.error < 1e-2 * abs(law.rear_rate)
    return (found.rear_rate - hopf.motion.rear_rate) / law.rear_rate


@pytest.mark.slow
@pytest.mark.parametrize("hopf", [(2, 0), (2, 1), (4, 0), (4, 1)])
@pytest.mark.parametrize("name", [REFERENCE, EXUDYN])
def test_shifts_of_second_order_tend_to_their_law(name: str, hopf: tuple[int, int]) -> None:
    """At halved steps the deviation, of the next power, is halved; the rest is of the power after that."""
    ratios = [boundary_ratio(name, step, point(*hopf)) for step in (0.01, 0.005, 0.0025)]
    assert ratios[-1] == pytest.approx(1, abs=0.1)
    for coarse, fine, step in ((ratios[0], ratios[1], 0.01), (ratios[1], ratios[2], 0.005)):
        assert 2 * fine - coarse == pytest.approx(1, abs=(FASTEST * step) ** 2)


@pytest.mark.slow
@pytest.mark.parametrize("hopf", [(2, 0), (2, 1), (4, 0), (4, 1)])
def test_shifts_of_fourth_order_follow_the_step_itself(hopf: tuple[int, int]) -> None:
    """The law has all powers of the step; a stencil's noise of 1e-11 is below a hundredth of shifts from 1e-7 on."""
    for step in (0.02, 1 / 75, 0.01, 1 / 150, 0.005):
        assert boundary_ratio(MULTIPLIERS, step, point(*hopf)) == pytest.approx(1, abs=0.02)


def test_the_modified_equation_of_the_trapezoidal_rule() -> None:
    """(2 / h) tanh(h D / 2) = D (1 - (h D)^2 / 12 + ...): the limit of generalized alpha for a spectral radius of 1."""
    velocity, acceleration = second_order_method(1.0)
    assert velocity == pytest.approx(-1 / 12, abs=1e-15)
    assert acceleration == pytest.approx(-1 / 6, abs=1e-15)


def test_no_law_is_claimed_for_other_methods() -> None:
    hopf = point(2, 1)
    for name, settings in (
        (REFERENCE, {}),
        (EXUDYN, {"solver": "trapezoidal-index2"}),
        (MULTIPLIERS, {"integrator": "Euler"}),
        ("mujoco-native", {}),
    ):
        assert predict_shift(hopf, load_engine(name).settings.model_validate(settings)) is None


# End of family 2 and amplitude of an orbit [rad].
ORBITS = {"unstable": ((2, 0), 0.02), "stable": ((2, 1), 0.005)}


def differences(name: str, kind: str, steps: int, periods: int) -> tuple[np.ndarray, np.ndarray]:
    """Return an engine's differences from an orbit after whole periods, and the predicted ones."""
    where, amplitude = ORBITS[kind]
    (orbit,) = small_orbits(point(*where), [amplitude])
    flow = flow_near(point(*where)).moved_to(orbit.state)
    engine, settings = engine_at(name, orbit.period / steps)
    found = follow_orbit(engine, settings, flow, orbit, periods)
    return found, predict_differences(found, find_monodromy(flow, orbit), settled=2)


def check_order(levels: list[np.ndarray], order: int) -> None:
    """Check that differences at halved steps, divided by h^p, converge to others than zero: with a power of the step.

    The power is the first at least: the next one of the method, or what is quadratic in the differences.
    """
    scaled = [found[1:] * 2.0 ** (order * level) for level, found in enumerate(levels)]
    assert observed_orders(scaled)[0] > 0.85
    assert np.abs(scaled[-1] - scaled[-2]).max() < 0.25 * np.abs(scaled[-1]).max()


def check_orbits(name: str, kind: str, coarse: int, order: int, periods: int) -> None:
    rides = [differences(name, kind, steps, periods) for steps in (coarse, 2 * coarse, 4 * coarse)]
    check_order([found for found, _ in rides], order)
    found, predicted = rides[-1]
    # What is quadratic in the differences, over amplitudes, and grows with the number of periods.
    assert np.abs(predicted - found)[-1].max() < 0.05 * np.abs(found[-1]).max()


@pytest.mark.parametrize(("kind", "coarse"), [("unstable", 256), ("stable", 64)])
def test_multipliers_follow_orbits_with_order_four(kind: str, coarse: int) -> None:
    check_orbits(MULTIPLIERS, kind, coarse, order=4, periods=6)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "coarse"), [("unstable", 512), ("stable", 256)])
def test_exudyn_follows_orbits_with_order_two(kind: str, coarse: int) -> None:
    check_orbits(EXUDYN, kind, coarse, order=2, periods=12)


def test_the_papers_method_follows_orbits_with_order_two() -> None:
    """Its error in a period grows with its constraints' drift, so that multipliers do not predict it."""
    check_order([differences(REFERENCE, "stable", 256 * 2**level, 12)[0] for level in range(3)], order=2)


_LOOKS = 32  # samples in a period: extremes are missed by (pi / 32)^2 / 2, 5e-3


def amplitudes(name: str, hopf: HopfPoint, steps: int, energy: float, shift: np.ndarray, ride: Any) -> np.ndarray:
    """Return the lean amplitudes in each period of an engine's ride at an energy, from a shift (7,) off its circle."""
    period, periods = ride
    start = hopf.level.circle(energy) + shift
    _, rear_rate = hopf.level.field(start[None, :6], np.array([energy]))
    start[6] = np.real(rear_rate[0])
    state = state_of_variables(flow_near(hopf), start)
    engine, settings = engine_at(name, period / steps)
    times = np.arange(periods * _LOOKS + 1) * period / _LOOKS
    ridden = ride_engine(engine, Problem(BICYCLE, BOWL, *state, times), settings, lambda _: None)
    assert ridden.ended is None
    return np.ptp(ridden.q[:-1, 4].reshape(periods, _LOOKS), axis=1) / 2


# End of family 2, amplitude of the orbit [rad], periods, and steps in a period of each engine with which its own
# boundary moves by less than a fiftieth of the orbit's distance from it.
SIDES = (
    ((2, 0), 0.02, 22, {REFERENCE: 4096, EXUDYN: 512, MULTIPLIERS: 256}),
    ((2, 1), 0.01, 60, {REFERENCE: 1024, EXUDYN: 256, MULTIPLIERS: 128}),
)


@pytest.mark.slow
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", OWN)
def test_engines_see_the_criticality(name: str, side: Any) -> None:
    """At an orbit's energy rides tend to it or away from it on both sides, as `reference.bifurcations.test_rides`."""
    where, amplitude, periods, steps = side
    hopf = point(*where)
    (orbit,) = small_orbits(hopf, [amplitude])
    offset, change = orbit.state - hopf.level.circle(orbit.energy), orbit.energy - hopf.energy
    ride = (orbit.period, periods)
    inside = amplitudes(name, hopf, steps[name], orbit.energy, 0.8 * offset, ride)
    # From beyond an unstable orbit the bicycle falls before the other rides end.
    outside = amplitudes(name, hopf, steps[name], orbit.energy, 1.1 * offset, (orbit.period, periods // 2))
    beyond = amplitudes(name, hopf, steps[name], hopf.energy - change / 4, 0.1 * offset, ride)
    if hopf.criticality == SUBCRITICAL:
        assert inside[-1] < 0.8 * inside[3] < 0.7 * amplitude
        assert outside[-1] > 1.1 * outside[3] > 1.2 * amplitude
        assert beyond[-1] > 1.3 * beyond[3]
    else:
        # The law of amplitudes, with the boundary's shift, a fiftieth, and the samples' error.
        for ending in (inside[-1], outside[-1]):
            assert ending == pytest.approx(amplitude, rel=0.02 + (np.pi / _LOOKS) ** 2 / 2)
        assert inside[0] < 0.85 * amplitude < 1.05 * amplitude < outside[0]
        assert beyond[-1] < 0.5 * beyond[3]
