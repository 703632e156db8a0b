"""The small equations of circular motions and their compiled 7 x 7, held against the full forms."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from tests.reference.test_lean import BICYCLES, ROUND_OFF, SURFACES, conditioning, riding, states
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.circular import REAR_SPEED
from velodrome.reference.contact import observe
from velodrome.reference.continuation import follow_curve
from velodrome.reference.curve import sample_curve
from velodrome.reference.families import FAMILIES, Family, trace
from velodrome.reference.kernels import dynamics as full
from velodrome.reference.kernels.circle import STEP
from velodrome.reference.kernels.curve import CHOSEN
from velodrome.reference.kernels.pose import aligned
from velodrome.reference.kernels.reduced import FRONT, REAR, reduced_jacobian
from velodrome.reference.kinematics import constants
from velodrome.reference.sections import sample_family
from velodrome.reference.stability import linearise
from velodrome.reference.surface import Paraboloid

BICYCLE = Bicycle()
CURVES = [(0.0, 1), (0.0, 2), (0.005, 2), (0.005, 4), (0.2, 3), (0.5, 2), (1.0, 1)]


@cache
def family(alpha: float, number: int, longest: float = 0.1) -> Family:
    return trace(BICYCLE, Paraboloid(alpha), number, longest)


@pytest.mark.parametrize(("alpha", "number"), CURVES)
def test_points_and_tangents_solve_the_full_equations(alpha: float, number: int) -> None:
    """All 21 equations with contact points and forces, and their derivative along the curve."""
    curve = family(alpha, number)
    for point in curve.points:
        size = 1 + np.abs(point.unknowns).max()
        assert np.abs(curve.equations.residual(point.unknowns)).max() < 1e-12 * size
        jacobian = curve.equations.jacobian(point.unknowns)
        # A tangent is known as well as the point: round-off times the condition of the curve's equations,
        # some 1e4, which counts once for each of the 22 products.
        along = np.abs(jacobian @ point.tangent)
        assert np.all(along < 22 * 1e4 * ROUND_OFF * np.abs(jacobian).max())


@pytest.mark.parametrize("number", FAMILIES)
def test_the_small_equations_lose_no_rank_at_rest_or_at_the_pivot(number: int) -> None:
    curve = family(0.005, number)
    for point in (curve.points[0], curve.points[-1]):
        jacobian = curve.equations.expand(point.unknowns[CHOSEN]).jacobian
        rows = jacobian / np.abs(jacobian).max(axis=1, keepdims=True)
        # Rows of size one; regular means far above round-off.
        assert np.linalg.svd(rows)[1][-1] > 1e-4


def full_reduction(bicycle: Bicycle, surface: Any, y: np.ndarray) -> np.ndarray:
    """dX/dv (7, 7) by the complex step through the system of 15 equations, the rear rate the last of v."""
    c, function = constants(bicycle), surface.function.complex
    base = y[[0, 1, 4, 6, 13, 15, 16]]
    columns = []
    for j in range(7):
        v = base.astype(complex)
        v[j] += 1j * STEP
        q, p, qd = y[:9].astype(complex), y[18:].astype(complex), np.zeros(9, complex)
        q[[0, 1, 3, 4, 6]] = v[0], v[1], 0, v[2], v[3]
        qd[[4, 6, 7]] = v[4:]
        assert full.settle(q, p, function, surface.parameters, c)
        full.complete_velocity(q, qd, p, function, surface.parameters, c)
        qdd, force, rate = np.empty((3, 9), complex)
        full.accelerations(q, qd, p, function, surface.parameters, c, qdd, force[:6], rate[:6])
        field = np.array([qd[0] + qd[3] * v[1], qd[1] - qd[3] * v[0], v[4], v[5], qdd[4], qdd[6], qdd[7]])
        columns.append(np.imag(field) / STEP)
    return np.array(columns).T


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
@pytest.mark.parametrize("bicycle", BICYCLES.values(), ids=BICYCLES)
@given(state=states)
def test_the_reduced_jacobian_is_that_of_the_full_system(bicycle: Bicycle, surface: Any, state: dict) -> None:
    y = riding(bicycle, surface, state | {"yaw": 0.0})
    field, jacobian = np.empty(7), np.empty((7, 7))
    where = surface.function.complex, surface.parameters, aligned(constants(bicycle))
    reduced_jacobian(y, REAR, *where, field, jacobian)
    expected = full_reduction(bicycle, surface, y)
    # A derivative of a solve is a solve with what another solve gave: round-off counts with the condition twice.
    bound = 15 * ROUND_OFF * conditioning(bicycle, surface, y) ** 2
    assert np.abs(jacobian - expected).max() <= bound * (1 + np.abs(expected).max())


@pytest.mark.parametrize(("alpha", "number"), [(0.005, 2), (0.2, 3), (1.0, 1)])
def test_eigenvalues_do_not_depend_on_the_wheel_that_tells_the_speed(alpha: float, number: int) -> None:
    curve = family(alpha, number)
    where = curve.equations.where[1:]
    for point in curve.points[2:-2:7]:
        motion = curve.equations.motion(point.unknowns)
        y = np.concatenate([*motion.state(), motion.contact.ravel()])
        coefficients = []
        for spin in (REAR, FRONT):
            field, jacobian = np.empty(7), np.empty((7, 7))
            reduced_jacobian(y, spin, *where, field, jacobian)
            # Times in units of the fastest mode: the characteristic polynomial's coefficients are of order one.
            coefficients.append(np.poly(jacobian / np.abs(np.linalg.eigvals(jacobian)).max()))
        ratio = max(abs(y[FRONT] / y[REAR]), abs(y[REAR] / y[FRONT]))
        # The change of variable stretches by the ratio of the rates, squared in the product of both sides;
        # entries of 1e4 / s^2 stand beside modes of 10 / s.
        assert np.abs(coefficients[0] - coefficients[1]).max() < 1e3 * 49 * ROUND_OFF * ratio**2


@pytest.mark.parametrize(("alpha", "number", "end"), [(0.005, 3, 0), (0.005, 4, 0), (0.5, 2, 0)])
def test_the_pivoting_motion_has_its_neighbours_eigenvalues(alpha: float, number: int, end: int) -> None:
    """The rear wheel stands there: its rate tells no speed. Eigenvalues are smooth in the arc all the same."""
    curve = family(alpha, number)
    at = curve.points[end]
    assert abs(at.unknowns[REAR_SPEED]) < 1e-12
    gaps = []
    for distance in (1e-3, 1e-4):
        near = next(p for i, p in enumerate(follow_curve(curve.equations, at.unknowns, at.tangent, distance)) if i == 1)
        seen = sample_curve(curve.equations, np.array([at.unknowns, near.unknowns]))
        gaps.append(np.abs(seen.eigenvalues[0] - seen.eigenvalues[1]).max())
    # First order in the distance; the second order is the distance times rates of change of some 1e1.
    assert gaps[0] / gaps[1] == pytest.approx(10, rel=0.1)


@pytest.mark.parametrize(("alpha", "number"), CURVES)
def test_samples_are_what_single_motions_give(alpha: float, number: int) -> None:
    curve = family(alpha, number)
    seen, weight = sample_family(curve), BICYCLE.mass * BICYCLE.gravity
    for i in range(1, len(curve.points) - 1, 9):
        motion = curve.equations.motion(curve.points[i].unknowns)
        q, qd = motion.state()
        assert (seen.rear_rate[i], seen.front_rate[i], seen.yaw_rate[i]) == pytest.approx(
            (motion.rear_rate, motion.front_rate, motion.yaw_rate), rel=1e-14
        )
        surface = curve.equations.surface
        contacts = observe(BICYCLE, surface, q[None], qd[None])
        energy = contacts.kinetic_energy[0] + contacts.potential_energy[0]
        assert seen.energy[i] == pytest.approx(energy, rel=1e-13)
        normal = np.einsum("wi,wi->w", motion.force, contacts.normal[0])
        # Normals are known like the contact point, to round-off of the coordinates.
        size = 1 + np.abs(q[:3]).max()
        assert np.abs(seen.normal_force[i] - normal).max() < 100 * ROUND_OFF * size * weight
        alone = linearise(BICYCLE, surface, q, qd)
        # Both take the same path from states that differ by round-off: the coefficients of the
        # characteristic polynomial, in units of the fastest mode, differ by that times the entries' size.
        fastest = np.abs(alone.eigenvalues).max()
        one, other = (np.poly(values / fastest) for values in (alone.eigenvalues, seen.eigenvalues[i]))
        assert np.abs(one - other).max() < 1e3 * 49 * ROUND_OFF * size
        assert seen.radius[i] == np.hypot(q[0], q[1])


@pytest.mark.parametrize(
    ("alpha", "ends"), [(0.0171, ("pivot", "fast front wheel")), (0.0176, ("pivot", "large circle"))]
)
def test_long_steps_do_not_cross_over_where_two_families_nearly_touch(alpha: float, ends: tuple[str, str]) -> None:
    """Families 2 and 4 touch at alpha = 0.01732: near it their curves are 0.02 apart, less than a step."""
    for longest in (0.15, 0.05, 0.02):
        assert family(alpha, 4, longest).ends == ends
