"""Upright straight motion: canonical matrices, eigenvalues, and the speeds at which stability changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.stability import VARIABLES, linearise
from velodrome.reference.surface import Plane
from velodrome.reference.upright import (
    canonical_matrices,
    capsize_speed,
    name_modes,
    speed_deviations,
    stability_changes,
    stable_speeds,
    weave_speed,
)

BENCHMARK = canonical_matrices(Bicycle())
OTHER = replace(Bicycle(), trail=0.03, steer_axis_tilt=0.2, front_frame_mass=9.0, rear_frame_x=0.4)


def test_matrices_are_the_published_ones() -> None:
    """Meijaard et al. (2007), section 5 (c), printed to 14 digits."""
    printed = {
        "M": [[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]],
        "K0": [[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]],
        "K2": [[0, 76.59734589573222], [0, 2.65431523794604]],
        "C1": [[0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]],
    }
    for name, matrix in printed.items():
        np.testing.assert_allclose(getattr(BENCHMARK, name), matrix, rtol=0, atol=5e-15 * 100)


def test_speeds_are_the_published_ones() -> None:
    """Meijaard et al. (2007), section 5 (d): the weave and capsize speeds to 15 digits."""
    assert weave_speed(BENCHMARK) == pytest.approx(4.29238253634111, abs=1e-13)
    assert capsize_speed(BENCHMARK) == pytest.approx(6.02426201538837, abs=1e-13)
    assert stable_speeds(BENCHMARK) == [(weave_speed(BENCHMARK), capsize_speed(BENCHMARK))]


@pytest.mark.parametrize("bicycle", [Bicycle(), OTHER])
@pytest.mark.parametrize("speed", [0.7, 4.0, 9.0])
def test_eigenvalues_are_those_of_the_nonlinear_equations(bicycle: Bicycle, speed: float) -> None:
    rate = speed / bicycle.rear_wheel_radius
    state = consistent_state(bicycle, Plane(), (0.0, 0.0), 0.0, 0.0, (0.0, 0.0, rate))
    block = [VARIABLES.index(name) for name in ("lean", "steer", "lean_rate", "steer_rate")]
    expected = np.linalg.eigvals(linearise(bicycle, Plane(), *state).jacobian[np.ix_(block, block)])
    found = canonical_matrices(bicycle).eigenvalues(speed)[0]
    gaps = np.abs(found[:, None] - expected).min(axis=1)
    assert gaps.max() < 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize("bicycle", [Bicycle(), OTHER])
def test_stability_changes_where_an_eigenvalue_is_on_the_imaginary_axis(bicycle: Bicycle) -> None:
    matrices = canonical_matrices(bicycle)
    changes = stability_changes(matrices)
    assert changes
    for change in changes:
        values = matrices.eigenvalues(change.speed)[0]
        nearest = values[np.abs(np.real(values)).argmin()]
        assert abs(nearest.real) < 1e-9
        assert (abs(nearest.imag) > 1e-3) == (change.mode == "weave")
        below, above = (
            values[np.abs(values - nearest).argmin()].real
            for values in matrices.eigenvalues([change.speed - 1e-4, change.speed + 1e-4])
        )
        assert (below > 0 > above) if change.stabilises else (below < 0 < above)


@pytest.mark.parametrize("bicycle", [Bicycle(), OTHER, replace(Bicycle(), trail=-0.1)])
def test_no_change_of_stability_is_missed(bicycle: Bicycle) -> None:
    matrices = canonical_matrices(bicycle)
    speeds = np.linspace(0.05, 30, 20_000)
    stable = np.real(matrices.eigenvalues(speeds)[:, -1]) < 0
    inside = np.zeros(speeds.size, bool)
    for start, end in stable_speeds(matrices):
        inside |= (speeds > start) & (speeds < end)
    ends = np.array([change.speed for change in stability_changes(matrices)])
    far = np.abs(speeds[:, None] - ends).min(axis=1, initial=np.inf) > 1e-6
    np.testing.assert_array_equal(stable[far], inside[far])


def test_modes_are_followed_by_continuity() -> None:
    values, modes = name_modes(BENCHMARK, [0.0, 3.0, 5.0, 8.0])
    assert list(modes) == ["weave", "weave", "capsize", "castering"]
    # At rest the bicycle falls over and its steer turns, both ways of time: +-3.13 and +-5.53 1/s.
    np.testing.assert_allclose(sorted(np.real(values[0])), [-5.530944, -3.131643, 3.131643, 5.530944], atol=1e-6)
    assert values[1, 0].imag < 0 < values[1, 1].imag
    assert np.real(values[2]).max() < 0
    assert values[3, 2].real == np.real(values[3]).max() > 0
    assert np.all(np.real(values[1:, 3]) < np.real(values[1:, 2]))


@pytest.mark.parametrize(
    "bicycle",
    [
        # Without tilt and trail a root of weave and that of capsize meet, and oscillate at low speeds.
        replace(Bicycle(), steer_axis_tilt=0.0, trail=0.0),
        replace(Bicycle(), front_frame_mass=0.0, **{f"front_frame_I{axes}": 0.0 for axes in ("xx", "yy", "zz", "xz")}),
        Bicycle(),
    ],
)
def test_no_pair_of_eigenvalues_is_divided_between_modes(bicycle: Bicycle) -> None:
    matrices, speeds = canonical_matrices(bicycle), np.linspace(0.0, 10.0, 101)
    followed, names = name_modes(matrices, speeds)
    assert list(names) == ["weave", "weave", "capsize", "castering"]
    np.testing.assert_array_equal(np.sort_complex(followed), np.sort_complex(matrices.eigenvalues(speeds)))
    for pair in (followed[:, :2], followed[:, 2:]):
        oscillates = np.abs(np.imag(pair)).max(axis=1) > 1e-6 * np.abs(pair).max(axis=1)
        assert np.array_equal(pair[oscillates, 1], pair[oscillates, 0].conj())


def test_deviations_of_the_speeds_are_those_of_a_sample() -> None:
    deviations = {"trail": 2e-4, "rear_frame_z": 2e-3, "rear_frame_Ixz": 0.02, "gravity": 0.01}
    found = speed_deviations(Bicycle(), deviations)
    random, samples = np.random.default_rng(1), 2000
    speeds = []
    for _ in range(samples):
        drawn = {name: getattr(Bicycle(), name) + size * random.standard_normal() for name, size in deviations.items()}
        matrices = canonical_matrices(replace(Bicycle(), **drawn))
        speeds.append((weave_speed(matrices), capsize_speed(matrices)))
    # The deviation of a sample of n is known to 1 / sqrt(2 n): four times that.
    np.testing.assert_allclose(
        np.array([found["weave"], found["capsize"]], float),
        np.std(np.array(speeds, float), axis=0),
        rtol=4 / np.sqrt(2 * samples),
    )


def test_a_bicycle_without_stable_speeds_has_none() -> None:
    matrices = canonical_matrices(replace(Bicycle(), trail=-0.1))
    assert stable_speeds(matrices) == []
