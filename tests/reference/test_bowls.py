"""Grounds beside the plane and the paraboloid: derivatives, limits, circular motions, families, rides."""

import math
from collections.abc import Callable
from functools import cache

import numba as nb
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Cone, Sphere, Torus
from velodrome.reference.circular import CircularMotion
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state
from velodrome.reference.families import FAMILIES, find_motion, trace
from velodrome.reference.kinematics import LEAN, REAR_ANGLE, STEER, YAW
from velodrome.reference.profile import PolynomialProfile, Profile, SplineProfile, profile_function
from velodrome.reference.simulate import simulate
from velodrome.reference.stability import free_eigenvalues, linearise
from velodrome.reference.surface import Paraboloid, Plane, Surface, SurfaceOfRevolution, evaluate, is_level

BICYCLE = Bicycle()
STEP = 1e-30


@profile_function
def _cubic(r, c):
    return (c[0] + c[1] * r) * r * r, (2 * c[0] + 3 * c[1] * r) * r, 2 * c[0] + 6 * c[1] * r


KNOTS = np.arange(16.0)


def through(radii: np.ndarray, heights: np.ndarray) -> SplineProfile:
    return SplineProfile(radii.tolist(), heights.tolist())


DISH = through(KNOTS, 0.02 * KNOTS**2 / (1 + 0.01 * KNOTS**2))
TROUGH = Torus(20.0, 5.0)
SURFACES: dict[str, SurfaceOfRevolution] = {
    "sphere": Sphere(20.0),
    "cone": Cone(0.1, 5.0),
    "torus": Torus(2.0, 20.0),
    "trough": TROUGH,
    "polynomial": PolynomialProfile((0.005, 1e-4, -1e-7)),
    "spline": DISH,
    "profile": Profile(_cubic, (0.005, 1e-4)),
}
everywhere = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)


@nb.njit
def _complex_step(function, parameters, x, y, step):
    along_x = function(complex(x, step), complex(y, 0.0), parameters)
    return along_x, function(complex(x, 0.0), complex(y, step), parameters)


@everywhere
@given(st.floats(0.01, 0.95), st.floats(-math.pi, math.pi))
def test_gradient_and_hessian_are_derivatives_of_the_height(
    surface: SurfaceOfRevolution, share: float, angle: float
) -> None:
    inner, outer = surface.extent
    r = inner + share * (min(outer, 40.0) - inner) if inner == 0 else 20.0 + 5.0 * (2 * share - 1) * 0.95
    x, y = r * math.cos(angle), r * math.sin(angle)
    f, fx, fy, fxx, fxy, fyy = evaluate(surface, x, y)
    along_x, along_y = _complex_step(surface.function.complex, surface.parameters, x, y, STEP)
    # The complex step has no error of its own. Within 0.95 of a rim the slope's round-off is that of
    # 1 / sqrt(1 - 0.95^2), and lengths are some 40 m: a hundred units in the last place of the largest.
    size = 1 + abs(f) + abs(fx) + abs(fy) + abs(fxx) + abs(fxy) + abs(fyy)
    assert np.real(along_x) == pytest.approx([f, fx, fy, fxx, fxy, fyy], abs=1e-13 * size)
    assert np.imag(along_x)[:3] / STEP == pytest.approx([fx, fxx, fxy], abs=1e-13 * size)
    assert np.imag(along_y)[:3] / STEP == pytest.approx([fy, fxy, fyy], abs=1e-13 * size)


@everywhere
def test_a_surface_of_revolution_looks_the_same_all_around(surface: SurfaceOfRevolution) -> None:
    inner, outer = surface.extent
    angle, r = np.linspace(0, 6, 9), inner + 0.7 * (min(outer, 30.0) - inner)
    values = evaluate(surface, r * np.cos(angle), r * np.sin(angle))
    assert values[:, 0] == pytest.approx(values[0, 0], rel=1e-13)
    assert np.hypot(values[:, 1], values[:, 2]) == pytest.approx(abs(values[0, 1]), rel=1e-12)


@pytest.mark.parametrize("name", ["sphere", "cone", "polynomial", "spline", "profile"])
def test_the_axis_is_a_regular_point(name: str) -> None:
    surface = SURFACES[name]
    f, fx, fy, fxx, fxy, fyy = evaluate(surface, 0.0, 0.0)
    near = evaluate(surface, 1e-7, 0.0)
    assert (f, fx, fy, fxy) == (0, 0, 0, 0)
    assert fxx == fyy > 0
    # The Hessian of a smooth bowl changes with r^2, that of the cubic profile with r.
    assert near[[3, 5]] == pytest.approx(fxx, abs=1e-8)
    along_x, _ = _complex_step(surface.function.complex, surface.parameters, 0.0, 0.0, STEP)
    assert along_x[1].imag / STEP == fxx


def test_there_is_no_ground_beyond_an_edge() -> None:
    # Sphere: the equator. Trough: its upright walls. Spline: its first and last point. Torus: its tip.
    for surface, x in ((Sphere(3.0), 3.0), (Sphere(3.0), 5.0), (TROUGH, 14.9), (TROUGH, 25.1), (DISH, 15.1)):
        assert np.isnan(evaluate(surface, x, 0.0)).all()
        for row in _complex_step(surface.function.complex, surface.parameters, x, 0.0, STEP):
            assert np.isnan(np.array(row)).all()
    assert np.isnan(evaluate(Torus(2.0, 3.0), 0.0, 0.0)[1:4]).all()
    with pytest.raises(ValueError, match="cannot touch"):
        consistent_state(BICYCLE, TROUGH, (0.0, 0.0), 0.0, 0.0, (0.0, 0.0, 15.0))


def test_a_torus_without_a_ring_is_a_sphere() -> None:
    x, y = np.array([0.0, 1.0, -2.5]), np.array([0.0, 0.3, 1.2])
    np.testing.assert_allclose(evaluate(Torus(0.0, 3.0), x, y), evaluate(Sphere(3.0), x, y), rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("count", [2, 3, 5, 6, 7, 12])
def test_a_spline_goes_through_its_points(count: int) -> None:
    radii = np.linspace(1.0, 9.0, count)
    heights = np.cos(radii)
    found = evaluate(through(radii, heights), radii, np.zeros(count))[:, 0]
    # The square root brings the last point back to round-off of the radius, times the slope.
    inside = np.isfinite(found)
    assert inside[:-1].all()
    # Horner's rule of degree 5 leaves up to 2 x 5 x 1.1e-16 of its terms' sizes, which add up to 420 in one piece
    # over the whole range.
    np.testing.assert_allclose(found[inside], heights[inside], rtol=0, atol=5e-13)


def test_a_spline_through_a_polynomial_is_the_polynomial() -> None:
    radii, polynomial = np.linspace(0.0, 8.0, 13), PolynomialProfile((0.03, -2e-4, 1e-6))
    spline = through(radii, evaluate(polynomial, radii, np.zeros(13))[:, 0])
    x, y = np.array([0.0, 0.4, 3.1, 7.0]), np.array([0.0, 1.0, -2.2, 3.0])
    # Degree 5 in r^2 holds degree 3; the spline's equations lose three digits.
    np.testing.assert_allclose(evaluate(spline, x, y), evaluate(polynomial, x, y), rtol=0, atol=1e-13)


@everywhere
def test_a_surface_comes_from_the_plane(surface: SurfaceOfRevolution) -> None:
    x = 20.0 if surface is TROUGH else 7.0
    x, y = np.array([x, x]), np.array([0.5, 1.0])
    assert surface.flattened(0.0) == Plane()
    np.testing.assert_allclose(evaluate(surface.flattened(1.0), x, y), evaluate(surface, x, y), rtol=1e-14)
    # Linear in the fraction as that vanishes.
    low, half = evaluate(surface.flattened(1e-6), x, y), evaluate(surface.flattened(5e-7), x, y)
    np.testing.assert_allclose(2 * half, low, rtol=1e-9, atol=1e-18)
    assert np.abs(low).max() < 1e-4


def test_only_the_plane_is_level() -> None:
    assert is_level(Plane())
    assert is_level(Paraboloid(0.0))
    for surface in SURFACES.values():
        assert not is_level(surface)
        assert not is_level(surface.flattened(1e-9))
    assert isinstance(Sphere(1.0), SurfaceOfRevolution)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sphere(0.0), "radius is 0.0"),
        (lambda: Sphere(math.inf), "radius is inf"),
        (lambda: Cone(0.0, 1.0), "slope is 0.0"),
        (lambda: Cone(1.0, 0.0), "rounding is 0.0"),
        (lambda: Torus(-1.0, 1.0), "ring is -1.0"),
        (lambda: Torus(1.0, math.nan), "tube is nan"),
        (lambda: PolynomialProfile((0.0, 0.0)), "all zero"),
        (lambda: PolynomialProfile((1.0, math.nan)), r"coefficients\[1\] is nan"),
        (lambda: SplineProfile((0.0, 1.0), (0.0,)), "2 radii and 1 heights"),
        (lambda: SplineProfile((0.0, 1.0, 1.0), (0.0, 1.0, 2.0)), r"radii\[2\] is 1.0"),
        (lambda: SplineProfile((-1.0, 1.0), (0.0, 1.0)), r"radii\[0\] is -1.0"),
        (lambda: SplineProfile((0.0, 1.0), (2.0, 2.0)), "all equal"),
        (lambda: Profile(_cubic, (math.inf,)), r"constants\[0\] is inf"),
        (lambda: Profile(_cubic, (1.0, 0.0), extent=(3.0, 2.0)), "extent"),
        (lambda: Profile(_cubic, (1.0, 0.0), scale=0.0), "scale is 0.0"),
    ],
)
def test_impossible_surfaces_are_refused(make: Callable[[], Surface], words: str) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


def _figures(surface: SurfaceOfRevolution, rear_rate: float, family: int) -> np.ndarray:
    """Unknowns and free eigenvalues of a circular motion."""
    _, motion = find_motion(BICYCLE, surface, rear_rate, family)
    values = free_eigenvalues(surface, linearise(BICYCLE, surface, *motion.state()).eigenvalues, motion.yaw_rate)
    values = sorted(values, key=lambda value: (value.real, value.imag))
    constants = (motion.lean, motion.pitch, motion.steer, motion.yaw_rate, motion.front_rate)
    return np.concatenate([motion.position, constants, np.real(values), np.imag(values)])


@cache
def _paraboloid_figures(alpha: float, rear_rate: float, family: int) -> np.ndarray:
    return _figures(Paraboloid(alpha), rear_rate, family)


@pytest.mark.parametrize(("rear_rate", "family"), [(15.0, 1), (17.0, 2)])
@pytest.mark.parametrize(
    ("make", "order"),
    [
        # r^4 / (8 R^3) = alpha^3 r^4
        (lambda alpha: Sphere(1 / (2 * alpha)), 3),
        # slope r^4 / (8 rounding^3) = alpha^3 r^4 / slope^2
        (lambda alpha: Cone(0.5, 0.5 / (2 * alpha)), 3),
        # (2 ring r - ring^2) / (2 tube), the ring shrinking like alpha
        (lambda alpha: Torus(40 * alpha, 1 / (2 * alpha)), 2),
        # 5 alpha^3 r^4
        (lambda alpha: PolynomialProfile((alpha, 5 * alpha**3)), 3),
        (lambda alpha: through(KNOTS, alpha * KNOTS**2 - 4 * alpha**3 * KNOTS**4), 3),
        # 3 alpha^2 r^3
        (lambda alpha: Profile(_cubic, (alpha, 3 * alpha**2)), 2),
    ],
    ids=["sphere", "cone", "torus", "polynomial", "spline", "profile"],
)
def test_shallow_bowls_tend_to_the_paraboloid(
    make: Callable[[float], SurfaceOfRevolution], order: int, rear_rate: float, family: int
) -> None:
    """Motion and eigenvalues differ as the heights do, by a power of alpha whose order is known."""
    differences = []
    for alpha in (4e-3, 2e-3, 1e-3):
        difference = _figures(make(alpha), rear_rate, family) - _paraboloid_figures(alpha, rear_rate, family)
        differences.append(np.abs(difference).max())
    first, second = differences[0] / differences[1], differences[1] / differences[2]
    # The motion itself depends on alpha: ratios are 2^order (1 + C alpha), so halving alpha halves what is missing.
    assert abs(second - 2**order) < 0.6 * abs(first - 2**order)
    assert second == pytest.approx(2**order, rel=0.05)


ENDS = {
    "sphere": {
        1: ("edge", "static"),
        2: ("fast front wheel", "flat"),
        3: ("pivot", "flat"),
        4: ("pivot", "edge"),
    },
    "cone": {
        1: ("large circle", "static"),
        2: ("large circle", "flat"),
        3: ("pivot", "flat"),
        4: ("pivot", "fast front wheel"),
    },
    # The rear contact of a pivoting motion stands on the axis: the torus has no normal there, the trough no ground.
    "torus": {1: ("edge", "static"), 2: ("edge", "flat"), 3: None, 4: None},
    "trough": {1: ("edge", "static"), 2: ("flat", "edge"), 3: None, 4: None},
    "spline": {
        1: ("edge", "static"),
        2: ("fast front wheel", "flat"),
        3: ("pivot", "flat"),
        4: ("pivot", "edge"),
    },
}


@pytest.mark.parametrize("number", FAMILIES)
@pytest.mark.parametrize("name", ENDS)
def test_families_reach_both_ends(name: str, number: int) -> None:
    surface, ends = SURFACES[name], ENDS[name][number]
    if ends is None:
        with pytest.raises(ValueError, match="no pivoting motion"):
            trace(BICYCLE, surface, number, 0.1)
        return
    family = trace(BICYCLE, surface, number, 0.1)
    assert family.ends == ends
    assert len(family.points) < 250
    motions = [family.equations.motion(point.unknowns) for point in family.points]
    # Rows are of order one but for the heights on large circles; next to the edge, where the slope is some
    # 20 to 50, so is their round-off.
    slope = [np.hypot(*evaluate(surface, *motion.contact[0, :2])[1:3]) for motion in motions]
    size = [(1 + np.abs(point.unknowns).max()) * (1 + s) for point, s in zip(family.points, slope, strict=True)]
    assert max(motion.residual / s for motion, s in zip(motions, size, strict=True)) < 1e-12
    steps = np.diff([[motion.lean, motion.steer] for motion in motions], axis=0)
    assert np.abs(steps).max() <= 0.2, "a jump to another branch"


RIDES = {"sphere": (15.0, 2), "cone": (17.0, 2), "torus": (17.0, 2), "trough": (18.0, 1), "spline": (15.0, 2)}


@pytest.mark.parametrize("name", RIDES)
def test_a_ride_keeps_energy_contact_and_rolling(name: str) -> None:
    surface = SURFACES[name]
    _, motion = find_motion(BICYCLE, surface, *RIDES[name])
    ride = simulate(BICYCLE, surface, *_disturbed(surface, motion, np.eye(7)[4] * 0.05), np.linspace(0, 2, 101))
    seen = observe(BICYCLE, surface, ride.q, ride.qd)
    energy = seen.kinetic_energy + seen.potential_energy
    assert ride.ended is None
    # The integrator's tolerance is 1e-13 a step: some hundred steps.
    assert np.abs(energy / energy[0] - 1).max() < 1e-11
    # Both are projected to round-off of lengths and speeds of some 20 m and 20 m/s.
    assert np.abs(seen.gap).max() < 2e-13
    assert np.abs(seen.slip).max() < 2e-13


def _disturbed(surface: Surface, motion: CircularMotion, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """State of a circular motion with a change (7,) of the independent variables."""
    q, qd = motion.state()
    at = (float(q[0] + change[0]), float(q[1] + change[1]))
    rates = (qd[LEAN] + change[4], qd[STEER] + change[5], qd[REAR_ANGLE] + change[6])
    angles = (float(q[LEAN] + change[2]), float(q[STEER] + change[3]))
    return consistent_state(BICYCLE, surface, at, *angles, rates, guess=(float(q[2]), float(q[5])))


@pytest.mark.parametrize(("name", "rear_rate", "family"), [("sphere", 15.0, 1), ("trough", 18.0, 1)])
def test_disturbances_grow_as_the_eigenvalue_says(name: str, rear_rate: float, family: int) -> None:
    surface = SURFACES[name]
    _, motion = find_motion(BICYCLE, surface, rear_rate, family)
    jacobian = linearise(BICYCLE, surface, *motion.state()).jacobian
    values, vectors = np.linalg.eig(jacobian)
    fastest = int(np.argmax(np.real(values)))
    # A left eigenvector sees its own mode alone: w . dv grows exactly like exp(lambda t).
    left, direction = np.linalg.inv(vectors)[fastest], np.real(vectors[:, fastest])
    assert values[fastest].real > 0.1
    epsilon, times = 1e-4, np.linspace(0, 1, 11)
    sides = []
    for sign in (1, -1):
        ride = simulate(BICYCLE, surface, *_disturbed(surface, motion, sign * epsilon * direction), times)
        cosine, sine = np.cos(ride.q[:, YAW]), np.sin(ride.q[:, YAW])
        x, y = cosine * ride.q[:, 0] + sine * ride.q[:, 1], cosine * ride.q[:, 1] - sine * ride.q[:, 0]
        sides.append(
            np.column_stack([x, y, ride.q[:, [LEAN, STEER]], ride.qd[:, [LEAN, STEER]], ride.qd[:, [REAR_ANGLE]]])
        )
    seen = (sides[0] - sides[1]) @ left / (2 * epsilon)
    # Of the central difference remain third derivatives times epsilon^2, 1e-8 times some hundred, and the
    # integrator's 1e-11 over epsilon.
    np.testing.assert_allclose(seen, seen[0] * np.exp(values[fastest] * times), rtol=0, atol=2e-6 * np.abs(seen).max())


def test_a_ride_over_the_edge_ends_with_a_reason() -> None:
    """Straight up the wall of a dish that ends at 15 m, at 15 m/s."""
    state = consistent_state(BICYCLE, DISH, (1.0, 0.0), 0.0, 0.0, (0.0, 0.0, 50.0))
    ride = simulate(BICYCLE, DISH, *state, np.linspace(0, 3, 301))
    assert ride.ended is not None
    assert 14.5 < np.abs(ride.contact[-1, 1, 0]) <= 15
    assert np.isfinite(ride.q).all()
