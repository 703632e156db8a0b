"""Ground from a grid of heights."""

import math
from functools import cache
from itertools import product

import numba as nb
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state
from velodrome.reference.height_field import HeightField
from velodrome.reference.simulate import simulate
from velodrome.reference.surface import SurfaceOfRevolution, evaluate, is_level

BICYCLE = Bicycle()


@cache
def sampled(spacing: float, length: float = 12.0) -> HeightField:
    """0.3 sin(x) cos(y) on a square from (-2, -6)."""
    x = np.arange(round(length / spacing) + 1) * spacing
    return HeightField(_waves(x[:, None] - 2, x[None, :] - 6)[0].tolist(), spacing, (-2.0, -6.0))


def _waves(x, y):
    s, c = 0.3 * np.sin(x), 0.3 * np.cos(x)
    u, v = np.cos(y), np.sin(y)
    return np.array([s * u, c * u, -s * v, -s * u, -c * v, -s * u])


@nb.njit
def _complex_step(function, parameters, x, y, step):
    along_x = function(complex(x, step), complex(y, 0.0), parameters)
    return along_x, function(complex(x, 0.0), complex(y, step), parameters)


@given(st.floats(-2, 10), st.floats(-6, 6))
def test_gradient_and_hessian_are_derivatives_of_the_height(x: float, y: float) -> None:
    field = sampled(1.0)
    f, fx, fy, fxx, fxy, fyy = evaluate(field, x, y)
    along_x, along_y = _complex_step(field.function.complex, field.parameters, x, y, 1e-30)
    # The complex step has no error of its own: what is left is round-off of numbers of order one.
    assert np.imag(along_x)[:3] / 1e-30 == pytest.approx([fx, fxx, fxy], abs=1e-14)
    assert np.imag(along_y)[:3] / 1e-30 == pytest.approx([fy, fxy, fyy], abs=1e-14)
    assert np.real(along_x) == pytest.approx([f, fx, fy, fxx, fxy, fyy], abs=1e-14)


def test_it_goes_through_the_heights() -> None:
    field = sampled(1.0)
    x = np.arange(13.0)
    found = evaluate(field, x[:, None] - 2, x[None, :] - 6)[..., 0]
    np.testing.assert_allclose(found, field.heights, rtol=0, atol=1e-15)


def test_quintic_ground_is_met_exactly_up_to_the_edge() -> None:
    rng = np.random.default_rng(1)
    powers = rng.normal(size=(6, 6)) / [[math.factorial(i) * math.factorial(j) for j in range(6)] for i in range(6)]
    x = np.linspace(-1, 1, 9)
    field = HeightField(np.polynomial.polynomial.polygrid2d(x, x, powers).tolist(), 0.25, (-1.0, -1.0))
    u, v = rng.uniform(-1, 1, (2, 200))
    expected = np.polynomial.polynomial.polyval2d(u, v, powers)
    # The splines' equations lose two digits each way.
    np.testing.assert_allclose(evaluate(field, u, v)[:, 0], expected, rtol=0, atol=1e-11)


def test_errors_fall_with_the_known_orders() -> None:
    """Order 6 for the height, one less for each derivative along an axis (de Boor 1978)."""
    rng = np.random.default_rng(2)
    # Away from the edge, whose errors have the same orders but larger constants, and reach two cells deep.
    x, y = rng.uniform(0, 8, 8000), rng.uniform(-4, 4, 8000)
    coarse, fine = (np.abs(evaluate(sampled(h), x, y) - _waves(x, y).T).max(axis=0) for h in (0.25, 0.125))
    ratio = coarse / fine
    # The next term is smaller by the square of the spacing, 1/16; a largest error is met within some percent.
    for columns, order in (([0], 6), ([1, 2, 4], 5), ([3, 5], 4)):
        assert np.log2(ratio[columns]) == pytest.approx(order, abs=np.log2(1 + 1 / 16 + 0.05))


def test_derivatives_do_not_jump_between_cells() -> None:
    field, h = sampled(1.0), 1e-9
    for x, y in product((0.0, 3.0), (-2.0, 1.3)):
        # The Hessian's own slope times the distance.
        assert evaluate(field, x + h, y) == pytest.approx(evaluate(field, x - h, y), abs=1e-8)


def test_there_is_no_ground_outside_the_grid() -> None:
    field = sampled(1.0)
    for x, y in ((-2.001, 0), (10.001, 0), (0, -6.001), (0, 6.001), (math.nan, 0), (1e300, 0)):
        assert np.isnan(evaluate(field, x, y)).all()
    for x, y in ((-2, -6), (10, 6), (-2, 6), (10, -6)):
        assert np.isfinite(evaluate(field, x, y)).all()


def test_it_is_neither_level_nor_round() -> None:
    assert not is_level(sampled(1.0))
    assert not isinstance(sampled(1.0), SurfaceOfRevolution)


def test_it_prints_in_a_line() -> None:
    assert len(str(sampled(0.25))) < 80


@pytest.mark.parametrize(
    ("heights", "spacing", "origin", "words"),
    [
        (np.eye(5).tolist(), 1.0, (0.0, 0.0), "6 x 6"),
        ([[0.0] * 6] * 5 + [[0.0] * 7], 1.0, (0.0, 0.0), "one length"),
        (np.ones((6, 6)), 1.0, (0.0, 0.0), "all equal"),
        (np.full((6, 6), math.nan), 1.0, (0.0, 0.0), r"heights\[0\]\[0\] is nan"),
        (np.eye(6).tolist(), 0.0, (0.0, 0.0), "spacing is 0.0"),
        (np.eye(6).tolist(), 1.0, (0.0, math.inf), "origin"),
    ],
)
def test_impossible_grids_are_refused(heights, spacing, origin, words) -> None:
    with pytest.raises(ValueError, match=words):
        HeightField(heights, spacing, origin)


def test_a_ride_keeps_energy_contact_and_rolling_and_ends_at_the_edge() -> None:
    field = HeightField((0.05 * np.array(sampled(2.0, 24.0).heights)).tolist(), 2.0, (-2.0, -12.0))
    state = consistent_state(BICYCLE, field, (1.0, 0.0), 0.1, 0.0, (0.0, 0.0, 17.0))
    ride = simulate(BICYCLE, field, *state, np.linspace(0, 6, 601))
    seen = observe(BICYCLE, field, ride.q, ride.qd)
    energy = seen.kinetic_energy + seen.potential_energy
    # The integrator's tolerance is 1e-13 a step, some two hundred of them.
    assert np.abs(energy / energy[0] - 1).max() < 2e-11
    assert np.abs(seen.gap).max() < 2e-13
    assert np.abs(seen.slip).max() < 2e-13
    assert ride.ended is not None
    assert 20 < seen.point[-1, 1, 0] <= 22 or abs(seen.point[-1, 1, 1]) > 10
