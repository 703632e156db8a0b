"""Whether motions can be ridden, held against dense samples of both rims and against the forces themselves."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Sphere, Torus
from velodrome.reference.circular import LEAN, PITCH, STEER
from velodrome.reference.dae import consistent_state, contact_parameters
from velodrome.reference.families import Family, find_motion, trace, trace_all
from velodrome.reference.height_field import HeightField
from velodrome.reference.kernels.dynamics import wheels
from velodrome.reference.kernels.rideability import PUSHED
from velodrome.reference.kinematics import YAW, constants
from velodrome.reference.profile import PolynomialProfile
from velodrome.reference.rideability import (
    OBSTACLES,
    assess_motions,
    assess_state,
    explain_motion,
    explain_obstacles,
    require_standing,
)
from velodrome.reference.rideable_parts import assess_family, find_rideable_parts, find_rideable_parts_of_section
from velodrome.reference.sections import SectionEnd, sample_family, stable_sections
from velodrome.reference.special import special_points
from velodrome.reference.surface import Paraboloid, Plane, Surface, evaluate, unit_normals

BICYCLE = Bicycle()
WEIGHT = BICYCLE.mass * BICYCLE.gravity
UP = np.array([[0.0, 0.0, 0.5 * WEIGHT]] * 2)
DENSE = 20000


def rim_heights(surface: Surface, q: np.ndarray, contact: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Angles from the contact of wheel k, and heights of its rim there above the ground."""
    centre, x, _, z, radius = wheels(q, constants(BICYCLE))[k]
    turn = np.pi * np.linspace(-1, 1, DENSE + 1)
    angle = contact[3 * k + 2] + turn
    radial = -np.sin(angle)[:, None] * np.array(x) - np.cos(angle)[:, None] * np.array(z)
    w = np.array(centre) + radius * radial
    return turn, w[:, 2] - evaluate(surface, w[:, 0], w[:, 1])[:, 0]


def random_states(surface: Surface, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Coordinates at yaw 0, both wheels on the ground at random places, leans and steers; and contact parameters."""
    rng, found, near = np.random.default_rng(9), [], 1.0
    while len(found) < count:
        # Every other one has its front wheel near the axis, where bowls are flat and rims touch twice.
        near = 1.1 - near
        x, y, lean, steer = rng.uniform([-1.5, -1.5, -1.0, -2.5], [2.5, 1.5, 1.0, 2.5]) * [near, near, 1, 1]
        try:
            q, _ = consistent_state(BICYCLE, surface, (x, y), lean, steer, (0.0, 0.0, 0.0))
            contact = contact_parameters(BICYCLE, surface, q)
        except ValueError:
            continue
        assert q[YAW] == 0
        # A contact that is found anew may be another place of the rim, where the wheel does not touch.
        if all(abs(rim_heights(surface, q, contact, k)[1][DENSE // 2]) < 1e-12 for k in range(2)):
            found.append((q, contact))
    return found


GROUNDS: dict[str, Surface] = {
    "plane": Plane(),
    "paraboloid": Paraboloid(2.5),
    "sphere": Sphere(2.5),
    "torus": Torus(1.0, 0.5),
    "polynomial": PolynomialProfile((2.5, -0.05, 0.001)),
    "rough": HeightField((0.02 * np.random.default_rng(7).standard_normal((50, 50))).tolist(), 0.12, (-3.0, -3.0)),
}


@cache
def curves(alpha: float) -> list[Family]:
    return trace_all(BICYCLE, Paraboloid(alpha), 0.05)[0]


def count_clear(surface: Surface, q: np.ndarray, contact: np.ndarray) -> int:
    """Hold the margins of both rims against dense samples of them; return how many of the two are clear."""
    clear = 0
    for k, margin in enumerate(assess_state(BICYCLE, surface, q, contact.reshape(2, 3), UP).margins[0, 2:4]):
        turn, height = rim_heights(surface, q, contact, k)
        # Ground that ends above a rim leaves no height. Next to the contact, round-off of heights is all there is:
        # 1e-15 over the versine of 1e-3 is 2e-9.
        seen = np.isfinite(height) & (np.abs(turn) > 1e-3)
        least = (height[seen] / (1 - np.cos(turn[seen]))).min()
        # A margin is a clearance in radii, or a bound of it, less round-off of up to 1e-4.
        assert least > 0 if margin > 0 else least < 1e-4, (q.tolist(), k, margin)
        clear += margin > 0
    return clear


@pytest.mark.parametrize("name", GROUNDS)
def test_rims_are_clear_where_dense_samples_of_them_are(name: str) -> None:
    clear = [count_clear(GROUNDS[name], q, contact) for q, contact in random_states(GROUNDS[name], 40)]
    assert sum(clear) > 40
    assert min(clear) < 2 or name not in ("torus", "rough")


def test_rims_of_motions_are_clear_where_dense_samples_of_them_are() -> None:
    clear = []
    for curve in curves(5.0):
        for point in curve.points[::7]:
            motion = curve.equations.motion(point.unknowns)
            if np.hypot(*motion.position[:2]) < 100:  # beyond, heights lose the digits that a rim needs
                clear.append(count_clear(Paraboloid(5.0), motion.state()[0], motion.contact.ravel()))
    assert {1, 2} <= set(clear)


def test_grazing_rims_and_wheels_without_force_fall_on_one_side_of_round_off() -> None:
    """Upright in a bowl of the wheel's own curvature, alpha = 1 / (2 R); and a wheel that carries nothing."""
    state, _ = random_states(Plane(), 1)[0]
    for change in (0.0, 1e-14, -1e-14):
        bowl = Paraboloid((1 + change) / (2 * BICYCLE.front_wheel_radius))
        # The front wheel stands on the axis: D is 0.05 m or so away from its centre, so both are placed by hand.
        q = np.zeros(9)
        centre = np.array(wheels(q, constants(BICYCLE))[1][0])
        q[:3] = np.array([0.0, 0.0, BICYCLE.front_wheel_radius]) - centre
        contact = np.zeros((2, 3))
        margins = assess_state(BICYCLE, bowl, q, contact, UP).margins[0]
        assert -1e-4 < margins[3] < 0
        looser = Paraboloid((1 - 1e-6) / (2 * BICYCLE.front_wheel_radius))
        assert assess_state(BICYCLE, looser, q, contact, UP).margins[0, 3] > 0
        contact = contact_parameters(BICYCLE, Plane(), state).reshape(2, 3)
        unloaded = np.array([[0.0, 0.0, change * WEIGHT], [0.0, 0.0, WEIGHT]])
        (first, *_) = explain_obstacles(BICYCLE, Plane(), state, contact, unloaded)
        assert first.startswith("the ground does not push the rear wheel: ")
        unloaded[0, 2] += 10 * PUSHED * WEIGHT
        loaded = assess_state(BICYCLE, Plane(), state, contact, unloaded)
        assert loaded.physical.all()


@pytest.mark.parametrize("alpha", [0.2, 1.0])
def test_forces_and_friction_are_those_of_the_motions(alpha: float) -> None:
    for curve in curves(alpha):
        seen, surface = assess_family(curve), Paraboloid(alpha)
        normal = sample_family(curve).normal_force
        np.testing.assert_allclose(WEIGHT * (seen.margins[:, :2] + PUSHED), normal, rtol=0, atol=1e-9 * WEIGHT)
        for point, friction, motion_margins in zip(
            curve.points[::9], seen.friction[::9], seen.margins[::9], strict=True
        ):
            motion = curve.equations.motion(point.unknowns)
            for k in range(2):
                n = unit_normals(surface, *motion.contact[k, :2])
                pressure = motion.force[k] @ n
                tangential = np.linalg.norm(np.cross(motion.force[k], n))
                if motion_margins[k] > 0:
                    # Tangential forces are differences of numbers of the size of the force.
                    assert friction[k] == pytest.approx(tangential / pressure, rel=1e-9)
                else:
                    assert friction[k] == np.inf


def test_codes_and_lists_name_the_same_obstacles() -> None:
    for curve in curves(5.0):
        seen = assess_family(curve)
        for code, names, physical in zip(seen.codes.tolist(), seen.list_obstacles(), seen.physical, strict=True):
            assert code == sum(2**k for k, name in enumerate(OBSTACLES) if name in names)
            assert physical == (not names)


def test_an_unridden_motion_says_what_and_how_much() -> None:
    """Near the pivoting motion in a bowl of alpha = 5/m, tighter than both wheels."""
    curve = next(curve for curve in curves(5.0) if 3 in curve.numbers and curve.ends[0] == "pivot")
    motion, surface = curve.equations.motion(curve.points[3].unknowns), Paraboloid(5.0)
    number, found = find_motion(BICYCLE, surface, motion.rear_rate, near=(motion.lean, motion.steer))
    assert number is not None
    assert found.steer == pytest.approx(motion.steer, abs=1e-9)
    pulled, inside = explain_motion(BICYCLE, surface, found)
    normal = found.force[1] @ unit_normals(surface, *found.contact[1, :2])
    assert pulled == f"the ground would have to pull the front wheel: {normal:.3g} N"
    turn, height = rim_heights(surface, found.state()[0], found.contact.ravel(), 0)
    centre, x, _, z, radius = wheels(found.state()[0], constants(BICYCLE))[0]
    angle = found.contact[0, 2] + turn
    w = np.array(centre) + radius * (-np.sin(angle)[:, None] * np.array(x) - np.cos(angle)[:, None] * np.array(z))
    slope = np.hypot(*evaluate(surface, w[:, 0], w[:, 1])[:, 1:3].T)
    depth = -1e3 * (height / np.hypot(1, slope)).min()
    assert inside == f"the rear rim touches the ground at a second place: {depth:.3g} mm inside"
    with pytest.raises(ValueError, match=r"^no bicycle can ride the solution at lean .* inside the ground at x = "):
        require_standing(BICYCLE, surface, found)


@pytest.mark.parametrize(
    ("alpha", "number", "cause", "rate"),
    [(0.005, 4, "rear wheel not pushed", 2.6289), (1.0, 2, "front wheel not pushed", 20.9181)],
)
def test_parts_end_where_a_wheel_is_no_longer_pushed(alpha: float, number: int, cause: str, rate: float) -> None:
    curve = next(curve for curve in curves(alpha) if curve.number == number and curve.ends[0] == "pivot")
    ((start, end),) = find_rideable_parts(curve)
    (one,) = [side for side in (start, end) if side.cause != "end"]
    assert one.cause == cause
    assert one.motion.rear_rate == pytest.approx(rate, abs=5e-5)
    k = OBSTACLES.index(cause)
    normal = one.motion.force[k] @ unit_normals(Paraboloid(alpha), *one.motion.contact[k, :2])
    # The root is solved for; forces have a residual of 1e-12 weights.
    assert normal / WEIGHT == pytest.approx(PUSHED, abs=1e-10)
    # Points followed with another step fall on the same sides of it.
    finer = trace(BICYCLE, Paraboloid(alpha), number, 0.03)
    physical = assess_family(finer).physical
    turns = np.flatnonzero(physical[1:] != physical[:-1])
    assert len(turns) == 1
    beside = [finer.equations.motion(finer.points[i].unknowns).rear_rate for i in (turns[0], turns[0] + 1)]
    assert min(beside) < one.motion.rear_rate < max(beside)


def test_stable_sections_of_the_benchmark_are_ridden_wholly() -> None:
    for curve in curves(0.005):
        for section in stable_sections(curve):
            ((start, end),) = find_rideable_parts_of_section(curve, section)
            assert (start.motion, end.motion) == (section[0].motion, section[1].motion)
            assert (start.cause, end.cause) == (section[0].cause, section[1].cause)
            inside = curve.points[section[0].place + 1 : section[1].place + 1]
            stable = sample_family(curve).stable
            assert [point.unknowns[STEER] for point in inside] == [
                point.unknowns[STEER]
                for k, point in enumerate(curve.points)
                if stable[k] and section[0].place < k <= section[1].place
            ]


def test_special_points_say_why_they_cannot_be_ridden() -> None:
    found = {point.name: point for curve in curves(1.0) for point in special_points(curve)}
    (why,) = found["G (H)"].unphysical_because
    assert why.startswith("the ground would have to pull the front wheel: -749 N")
    assert not any(point.unphysical_because for curve in curves(0.005) for point in special_points(curve))


def test_assessing_many_is_assessing_each() -> None:
    curve = curves(5.0)[1]
    unknowns = np.array([point.unknowns for point in curve.points])
    many = assess_motions(BICYCLE, Paraboloid(5.0), unknowns)
    for u, margins in zip(unknowns[::10], many.margins[::10], strict=True):
        q = np.array([*u[:3], 0.0, u[LEAN], u[PITCH], u[STEER], 0.0, 0.0])
        one = assess_state(BICYCLE, Paraboloid(5.0), q, u[10:16], WEIGHT * u[16:22])
        np.testing.assert_allclose(one.margins[0], margins, rtol=1e-12, atol=1e-14)


@cache
def trough_curve() -> Family:
    """Family 2 in a trough of 0.5 m radius: flat enough circles bring the rear rim, then both, against its wall."""
    return trace(BICYCLE, Torus(3.0, 0.5), 2, 0.05)


def test_parts_end_where_a_rim_grazes_the_ground() -> None:
    curve, surface = trough_curve(), Torus(3.0, 0.5)
    ((start, end),) = find_rideable_parts(curve)
    assert (start.cause, end.cause) == ("end", "rear rim touches twice")
    turn, height = rim_heights(surface, end.motion.state()[0], end.motion.contact.ravel(), 0)
    seen = np.isfinite(height) & (np.abs(turn) > 1e-3)
    # Zero but for round-off of up to 1e-4, see `rideability`, and for the samples' distance squared.
    assert abs((height[seen] / (1 - np.cos(turn[seen]))).min()) < 2e-4
    physical = assess_family(curve).physical
    (last,) = np.flatnonzero(physical[:-1] & ~physical[1:]).tolist()
    rates = [curve.equations.motion(curve.points[k].unknowns).rear_rate for k in (last, last + 1)]
    assert min(rates) <= end.motion.rear_rate <= max(rates)


def test_a_section_that_leaves_the_rideable_part_is_ridden_up_to_there() -> None:
    curve = trough_curve()
    ((_, grazing),) = find_rideable_parts(curve)
    physical = assess_family(curve).physical
    (last,) = np.flatnonzero(physical[:-1] & ~physical[1:]).tolist()

    def make_end(k: int) -> SectionEnd:
        return SectionEnd("hopf", curve.equations.motion(curve.points[k].unknowns), 1j, curve.points[k], k)

    ((start, end),) = find_rideable_parts_of_section(curve, (make_end(last - 4), make_end(last + 4)))
    assert (start.cause, end.cause) == ("hopf", "rear rim touches twice")
    assert end.motion.rear_rate == pytest.approx(grazing.motion.rear_rate, rel=1e-12)
    assert find_rideable_parts_of_section(curve, (make_end(last + 1), make_end(last + 5))) == []
