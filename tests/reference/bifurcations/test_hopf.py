"""Hopf points of the benchmark bicycle on the bowl of alpha = 1/200, where four stable sections' ends are."""

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bifurcations.energy_level import energy_level
from velodrome.reference.bifurcations.hopf import (
    SUBCRITICAL,
    SUPERCRITICAL,
    HopfPoint,
    examine_hopf,
    section_hopf_points,
)
from velodrome.reference.bifurcations.normal_form import linearise_field
from velodrome.reference.circular import Steady, newton, plane_condition
from velodrome.reference.continuation import metric
from velodrome.reference.curve import sample_curve
from velodrome.reference.dae import consistent_state
from velodrome.reference.families import Family, trace
from velodrome.reference.inputs import Inputs
from velodrome.reference.sections import stable_sections
from velodrome.reference.stability import linearise
from velodrome.reference.surface import Paraboloid, Plane

BICYCLE, BOWL = Bicycle(), Paraboloid(1 / 200)


@lru_cache
def family(number: int) -> Family:
    return trace(BICYCLE, BOWL, number)


@lru_cache
def hopf_points() -> list[HopfPoint]:
    return section_hopf_points(family(2)) + section_hopf_points(family(4))


def test_criticality_and_amplitude_at_the_four_ends() -> None:
    """Slopes in rad^2/J; orbits confirm them, see `test_orbits`."""
    found = [(point.criticality, point.amplitude_slope) for point in hopf_points()]
    expected = [
        (SUBCRITICAL, 4.01763780e-6),
        (SUPERCRITICAL, 4.53289535e-7),
        (SUBCRITICAL, -3.02272935e-6),
        (SUPERCRITICAL, -3.99277721e-6),
    ]
    for (kind, slope), (known_kind, known_slope) in zip(found, expected, strict=True):
        assert kind == known_kind
        assert slope == pytest.approx(known_slope, rel=5e-9)
    for point in hopf_points():
        assert point.amplitude_slope_error is not None
        assert point.amplitude_slope is not None
        assert point.amplitude_slope_error < 1e-10 * abs(point.amplitude_slope)


@pytest.mark.parametrize("index", range(4))
def test_orbits_live_where_the_circle_is_stable_exactly_if_subcritical(index: int) -> None:
    point = hopf_points()[index]
    assert point.form is not None
    assert point.amplitude_slope is not None
    growth_towards_orbits = point.form.growth.value.real * np.sign(point.amplitude_slope)
    assert (growth_towards_orbits < 0) == (point.criticality == SUBCRITICAL)
    assert (point.first_lyapunov_coefficient or 0) * growth_towards_orbits < 0


@pytest.mark.parametrize("index", range(4))
def test_the_level_set_has_the_eigenvalues_without_the_zero(index: int) -> None:
    point = hopf_points()[index]
    level = point.level
    jacobian, _ = linearise_field(lambda y, e: level.field(y, e)[0], level.centre, level.energy)
    all_seven = linearise(BICYCLE, BOWL, *point.motion.state()).eigenvalues
    zero = int(np.abs(all_seven).argmin())
    for value in np.delete(all_seven, zero):
        # Round-off of 1e-15 times an eigenvalue's condition, up to 1e4.
        assert np.abs(np.linalg.eigvals(jacobian) - value).min() < 1e-10


@pytest.mark.parametrize("index", range(4))
def test_the_eigenvalue_moves_with_energy_as_along_the_family(index: int) -> None:
    """Central differences along the arc, whose errors of second and fourth order Richardson's rule removes."""
    point = hopf_points()[index]
    curve = family(2 if index < 2 else 4)
    ends = [end for section in stable_sections(curve) for end in section]
    end = ends[index % 2]
    equations, start = curve.equations, end.point
    covector = metric(start.unknowns) * start.tangent

    def difference(step: float) -> complex:
        eigenvalues, energies = [], []
        for distance in (-step, step):
            unknowns, _ = newton(
                equations,
                start.unknowns + distance * start.tangent,
                plane_condition(start.unknowns, covector, distance),
            )
            sample = sample_curve(equations, unknowns[None])
            nearest = int(np.abs(sample.eigenvalues[0] - end.eigenvalue).argmin())
            eigenvalues.append(sample.eigenvalues[0, nearest])
            energies.append(sample.energy[0])
        return complex(np.diff(eigenvalues)[0] / np.diff(energies)[0])

    by_step = [difference(step) for step in (4e-3, 2e-3, 1e-3)]
    second = [(4 * fine - coarse) / 3 for coarse, fine in pairwise(by_step)]
    limit = (16 * second[1] - second[0]) / 15
    assert point.form is not None
    # What is left is of sixth order; its size is that of the last correction times (1/4)^2 at most.
    assert abs(point.form.growth.value - limit) < abs(second[1] - second[0]) + 1e-9 * abs(limit)


def test_the_field_on_a_level_set_is_that_of_the_reduced_equations() -> None:
    """At states off the circle; the accelerations are computed by another elimination there."""
    level, rng = hopf_points()[1].level, np.random.default_rng(3)
    for _ in range(5):
        energy = level.energy * (1 + 0.01 * rng.normal())
        variables = level.centre + 0.02 * rng.normal(size=6)
        rates, rear_rate = level.field(variables[None], np.array([energy]))
        x, y, lean, steer, lean_rate, steer_rate = variables
        speeds = (lean_rate, steer_rate, float(rear_rate[0].real))
        state = consistent_state(BICYCLE, BOWL, (x, y), lean, steer, speeds, guess=(level.state[2], level.state[5]))
        np.testing.assert_allclose(np.real(rates[0]), linearise(BICYCLE, BOWL, *state).field[:6], atol=1e-11)
        assert not np.imag(rates).any()


def test_circles_of_other_energies_are_motions_of_the_family() -> None:
    level = hopf_points()[0].level
    circle = level.circle(level.energy + 5.0)
    x, y, lean, steer, _, _, rear_rate = circle
    state = consistent_state(
        BICYCLE, BOWL, (x, y), lean, steer, (0, 0, rear_rate), guess=(level.state[2], level.state[5])
    )
    assert np.abs(linearise(BICYCLE, BOWL, *state).field).max() < 1e-10


def test_the_amplitude_is_undefined_on_the_plane_and_with_damping() -> None:
    curve, point = family(2), hopf_points()[0]
    end = stable_sections(curve)[0][0]
    level_curve = Family(2, Steady(BICYCLE, Plane()), curve.points)
    with pytest.raises(ValueError, match="pivoting"):
        energy_level(curve.equations, end.motion.__class__(**{**vars(end.motion), "rear_rate": 0.0}))
    damped = Family(2, Steady(BICYCLE, BOWL, Inputs(steer_damping=0.1)), curve.points)
    found = examine_hopf(damped, end.motion, end.eigenvalue.imag)
    assert found.amplitude_slope is None
    assert "not conserved" in (found.why_undefined or "")
    assert found.energy == point.energy
    assert examine_hopf(level_curve, end.motion, end.eigenvalue.imag).amplitude_slope is None


def test_a_bicycle_with_a_massless_wheel_has_no_normal_form_and_says_why() -> None:
    """The field on level sets of energy needs the mass matrix of all coordinates, of which the wheel's angle is one."""
    massless = replace(BICYCLE, rear_wheel_mass=0.0, rear_wheel_Ixx=0.0, rear_wheel_Iyy=0.0)
    curve = trace(massless, BOWL, 2)
    point = examine_hopf(curve, curve.equations.motion(curve.points[len(curve.points) // 2].unknowns), 2.0)
    assert point.form is None
    assert "a part of the bicycle has no inertia" in (point.why_undefined or "")
