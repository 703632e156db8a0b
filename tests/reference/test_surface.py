import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state
from velodrome.reference.simulate import simulate
from velodrome.reference.surface import Paraboloid, Plane, Surface, SurfaceFunction, evaluate, surface_function

coordinate = st.floats(-50, 50)


@surface_function
def _waves(x, y, parameters):
    a, k = parameters[0], parameters[1]
    s, c = a * np.sin(k * x), a * k * np.cos(k * x)
    return s + a * y * y, c, 2 * a * y, -k * k * s, 0 * x, 2 * a + 0 * x


@dataclass(frozen=True)
class Waves:
    """A surface that the suite does not know: a wavy trough."""

    @property
    def function(self) -> SurfaceFunction:
        return _waves

    @property
    def parameters(self) -> np.ndarray:
        return np.array([0.02, 1.5])


@given(st.sampled_from([Plane(), Paraboloid(0.005), Paraboloid(1.0), Waves()]), coordinate, coordinate)
def test_gradient_and_hessian_are_derivatives_of_the_height(surface: Surface, x: float, y: float) -> None:
    f, fx, fy, fxx, fxy, fyy = evaluate(surface, np.array(x), np.array(y))
    # Central differences: error h^2 f''' / 6 + eps |f| / h, f''' <= 0.07 on the waves.
    h = 1e-4
    right, left = evaluate(surface, np.array(x + h), np.array(y)), evaluate(surface, np.array(x - h), np.array(y))
    ahead, behind = evaluate(surface, np.array(x), np.array(y + h)), evaluate(surface, np.array(x), np.array(y - h))
    tolerance = h**2 + 4 * np.finfo(float).eps * (1 + abs(f) + abs(fx) + abs(fy)) * (1 + abs(x) + abs(y)) / h
    assert np.allclose((right - left)[:3] / (2 * h), [fx, fxx, fxy], rtol=0, atol=tolerance)
    assert np.allclose((ahead - behind)[[0, 2]] / (2 * h), [fy, fyy], rtol=0, atol=tolerance)


def test_a_flat_bowl_is_the_plane() -> None:
    x = np.linspace(-3, 3, 7)
    assert np.array_equal(evaluate(Paraboloid(0.0), x, x), evaluate(Plane(), x, x))
    assert np.array_equal(evaluate(Plane(), x, x), np.zeros((7, 6)))


@pytest.mark.parametrize("alpha", [-1e-9, math.nan, math.inf, True, "0.1"])
def test_impossible_bowls_are_refused(alpha: float) -> None:
    with pytest.raises(ValueError, match="alpha"):
        Paraboloid(alpha)


def test_a_surface_of_ones_own_carries_a_ride() -> None:
    bicycle, surface = Bicycle(), Waves()
    q, qd = consistent_state(bicycle, surface, (0.3, 0.2), 0.1, 0.05, (0.1, 0.0, 15.0))
    motion = simulate(bicycle, surface, q, qd, np.linspace(0, 2, 101))
    seen = observe(bicycle, surface, motion.q, motion.qd)
    energy = seen.kinetic_energy + seen.potential_energy
    assert motion.ended is None
    # The integrator's tolerance is 1e-13 a step: some hundred steps.
    assert np.abs(energy / energy[0] - 1).max() < 1e-11
    assert np.abs(seen.gap).max() < 1e-12
    assert np.abs(seen.slip).max() < 1e-11
