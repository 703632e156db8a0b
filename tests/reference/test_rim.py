"""Whole rims above the ground: held against dense samples, and a ride's end against the geometry there."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Cone, Sphere, Torus
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state, contact_parameters
from velodrome.reference.families import find_motion, trace
from velodrome.reference.height_field import HeightField
from velodrome.reference.kernels import rim as kernel
from velodrome.reference.kernels.contact import equations, first_guess, search
from velodrome.reference.kernels.dynamics import wheels
from velodrome.reference.kinematics import WHEELS, constants
from velodrome.reference.profile import PolynomialProfile, SplineProfile
from velodrome.reference.rim import find_second_touch, require_clear_rims, rim_clearances, rim_search
from velodrome.reference.simulate import simulate, simulate_modified_euler
from velodrome.reference.special import special_points
from velodrome.reference.surface import Paraboloid, Surface, SurfaceFunction, evaluate

BICYCLE = Bicycle()
CASES = Path(__file__).parents[1] / "cases"
RADIUS = 0.35
DENSE = 20000


def rough(spacing: float, height: float) -> HeightField:
    heights = height * np.random.default_rng(7).standard_normal((40, 40))
    return HeightField(heights.tolist(), spacing, (-20 * spacing, -20 * spacing))


GROUNDS = {
    "paraboloid": Paraboloid(1.0),
    "sphere": Sphere(2.5),
    "cone": Cone(0.8, 0.4),
    "torus": Torus(2.0, 0.8),
    "polynomial": PolynomialProfile((1.2, -0.05, 0.001)),
    "spline": SplineProfile(np.linspace(0, 4, 9).tolist(), (0.3 * np.cos(np.arange(9.0))).tolist()),
    "rough": rough(0.25, 0.02),
    "rougher": rough(0.1, 0.02),
}


def contacts(surface: Surface, count: int) -> list[tuple[Any, Any, Any, float]]:
    """Random wheels with a contact of no gap: centre, in-plane axes and the contact's angle."""
    rng, function, parameters = np.random.default_rng(3), surface.function.real, surface.parameters
    found = []
    while len(found) < count:
        x, y, lean, yaw = rng.uniform([-1.5, -1.5, -1.2, -np.pi], [1.5, 1.5, 1.2, np.pi])
        axle = np.array([-np.sin(yaw) * np.cos(lean), np.cos(yaw) * np.cos(lean), np.sin(lean)])
        along, up = kernel.level_axes(tuple(axle))
        centre = np.array([x, y, evaluate(surface, x, y)[0] + RADIUS])
        guess = first_guess(tuple(centre), along, up, RADIUS, function, parameters)
        xi, eta, angle, good = search(tuple(centre), along, up, RADIUS, *guess, function, parameters)
        if not good:
            continue
        here = equations(tuple(centre), along, up, RADIUS, xi, eta, angle, function, parameters)
        if abs(here.gap) < 0.3 and np.isfinite(here.gap):
            found.append((tuple(centre - here.gap * np.array(here.normal)), along, up, angle))
    return found


def heights(surface: Surface, centre: Any, x: Any, z: Any, radius: float, angle: np.ndarray) -> np.ndarray:
    """Height of rim points above the ground."""
    e = -np.sin(angle)[:, None] * np.array(x) - np.cos(angle)[:, None] * np.array(z)
    w = np.array(centre) + radius * e
    return w[:, 2] - evaluate(surface, w[:, 0], w[:, 1])[:, 0]


@pytest.mark.parametrize("name", GROUNDS)
def test_least_clearance_is_that_of_a_dense_sampling(name: str) -> None:
    surface = GROUNDS[name]
    known, where = rim_search(surface, [RADIUS]), (surface.function.real, surface.parameters)
    turn = 2 * np.pi * np.arange(1, DENSE) / DENSE
    touching = 0
    for centre, x, z, angle in contacts(surface, 60):
        with np.errstate(invalid="ignore"):
            dense = heights(surface, centre, x, z, RADIUS, angle + turn) / (RADIUS * (1 - np.cos(turn)))
        # Next to the contact the round-off of a height, 1e-15, is left over a versine.
        far = np.nanmin(dense[(turn > 0.01) & (turn < 2 * np.pi - 0.01)])
        least, d = kernel.least_clearance(centre, x, z, RADIUS, angle, True, known.samples, *where)
        assert kernel.bound(centre, x, z, RADIUS, angle, known, *where) <= least + 1e-9
        if np.isnan(dense).any():
            # Next to an edge the ground may be upright: dense samples miss by how much the rim is inside.
            assert least <= 0 or far > -1e-9
            continue
        # At the contact itself the clearance is a limit that the dense samples come near to.
        near = 0.02 * (1 + abs(least)) if abs(np.sin(d / 2)) < 0.01 else 1e-6 * (1 + abs(far))
        assert least >= far - near
        # A clearance far above zero is not refined: it is at most an eighth of itself too large.
        assert least <= far + 1e-9 + max(least, 0.0) / 8
        touching += least <= 0
    # In a sphere no rim touches twice, in the others few do.
    if name in ("paraboloid", "polynomial", "rough", "rougher"):
        assert 0 < touching < 60


def test_the_bound_is_the_least_clearance_in_a_paraboloid() -> None:
    surface = Paraboloid(1.0)
    known, where = rim_search(surface, [RADIUS]), (surface.function.real, surface.parameters)
    for centre, x, z, angle in contacts(surface, 40):
        least, _ = kernel.least_clearance(centre, x, z, RADIUS, angle, True, known.samples, *where)
        # A clearance far above zero is not refined. Golden section finds a least value to round-off of heights.
        bound = kernel.bound(centre, x, z, RADIUS, angle, known, *where)
        assert least - max(least, 0.0) / 8 - 1e-9 <= bound <= least + 1e-9
        if least < 0:
            assert bound == pytest.approx(least, abs=1e-9)


def test_bounds_of_bowls_hold_within_a_wheel() -> None:
    rng = np.random.default_rng(5)
    for name in ("sphere", "torus", "polynomial", "spline", "cone", "rough", "rougher"):
        surface = GROUNDS[name]
        known = rim_search(surface, [RADIUS])
        for x, y in rng.uniform(-1.5, 1.5, (200, 2)):
            distance = np.hypot(x, y)
            ring = int(distance / known.width)
            bend = known.bends[ring] if ring < len(known.bends) else np.inf
            turn, away = rng.uniform(0, 2 * np.pi, 50), 2 * RADIUS * rng.uniform(0, 1, 50)
            values = evaluate(surface, x + away * np.cos(turn), y + away * np.sin(turn))
            fxx, fxy, fyy = values[:, 3], values[:, 4], values[:, 5]
            largest = (fxx + fyy) / 2 + np.hypot((fxx - fyy) / 2, fxy)
            # Round-off of second derivatives.
            assert np.nanmax(largest, initial=-np.inf) <= bend * (1 + 1e-12) + 1e-12


def case(name: str) -> tuple[Surface, np.ndarray, np.ndarray]:
    """Ground and start of one of the cases, all of them upright on a height field."""
    data = tomllib.loads((CASES / name).read_text())
    ground = data["surface"]
    surface = HeightField(ground["heights"], ground["spacing"], tuple(ground["origin"]))
    rates = (data.get("perturbation", {}).get("lean_rate", 0.0), 0.0, data["motion"]["speed"] / 0.3)
    return surface, *consistent_state(BICYCLE, surface, (float(BICYCLE.reference_point[0]), 0.0), 0.0, 0.0, rates)


def front_heights(surface: Surface, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles from the contact, and heights of the front rim above the ground there."""
    centre, x, _, z, radius = wheels(q, constants(BICYCLE))[1]
    angle = contact_parameters(BICYCLE, surface, q)[5]
    turn = np.pi * np.linspace(-1, 1, DENSE)
    return turn, heights(surface, centre, x, z, radius, angle + turn)


@pytest.mark.parametrize(("name", "shown"), [("hollow.toml", "0.722178"), ("curb.toml", "0.605196")])
def test_a_ride_ends_where_the_front_rim_touches_a_second_place(name: str, shown: str) -> None:
    surface, q, qd = case(name)
    ride = simulate(BICYCLE, surface, q, qd, np.arange(151) / 100)
    assert ride.ended == f"the front rim touches the ground at a second place at t = {shown} s"
    time = float(shown)
    assert ride.time[-1] <= time < ride.time[-1] + 0.01
    seen = observe(BICYCLE, surface, ride.q, ride.qd, ride.contact)
    assert seen.found
    assert np.abs(seen.gap).max() <= 1e-12
    assert np.abs(seen.slip).max() <= 1e-11
    # Contacts searched from the poses alone are the same: those where the rims are deepest.
    alone = observe(BICYCLE, surface, ride.q, ride.qd)
    np.testing.assert_allclose(alone.point, seen.point, rtol=0, atol=1e-9)
    # Whatever the output times: they only say what is kept.
    coarse = simulate(BICYCLE, surface, q, qd, np.array([0.0, 1.5]))
    assert coarse.ended == ride.ended
    euler = simulate_modified_euler(BICYCLE, surface, q, qd, np.arange(16) / 10)
    assert euler.ended is not None
    assert "the front rim touches the ground at a second place" in euler.ended
    # 1 us before (half of the last digit shown is 0.5 us) the rim is clear, and next to touching: closing at most at
    # the speed of 3 m/s, 2 us leave 6 um.
    last = simulate(BICYCLE, surface, q, qd, np.array([0.0, time - 1e-6]))
    assert last.ended is None
    turn, height = front_heights(surface, last.q[-1])
    assert height.min() >= -1e-12
    assert height[np.abs(turn) > 0.3].min() < 6e-6
    assert find_second_touch(BICYCLE, surface, ride.time, ride.q, ride.qd) is None


def test_a_touch_after_the_last_output_is_none_of_the_ride() -> None:
    surface, q, qd = case("hollow.toml")
    assert simulate(BICYCLE, surface, q, qd, np.array([0.0, 0.7221])).ended is None


@dataclass(frozen=True)
class Blind:
    """A ground of which nobody is told that it bends."""

    ground: Surface
    bend = 0.0

    @property
    def function(self) -> SurfaceFunction:
        return self.ground.function

    @property
    def parameters(self) -> np.ndarray:
        return self.ground.parameters


@pytest.mark.parametrize(("name", "time"), [("hollow.toml", 0.722178), ("curb.toml", 0.605196)])
def test_samples_of_any_ride_are_looked_at(name: str, time: float) -> None:
    surface, q, qd = case(name)
    ride = simulate(BICYCLE, Blind(surface), q, qd, np.arange(1501) / 1000)
    assert ride.time[-1] > time
    ending = find_second_touch(BICYCLE, surface, ride.time, ride.q, ride.qd)
    assert ending is not None
    assert "the front rim touches the ground at a second place" in ending.why
    # A sample is 3 mm, over which the clearance is next to linear; the cubics between samples are as good.
    assert ending.time == pytest.approx(time, abs=1e-4)


def test_a_start_inside_the_ground_is_refused() -> None:
    surface, q, qd = case("ripples-tight.toml")
    with pytest.raises(ValueError, match=r"^the front rim lies 36\.2 mm inside the ground at x = 0\.8187 m, y = 0 m$"):
        require_clear_rims(BICYCLE, surface, q)
    with pytest.raises(ValueError, match="inside the ground"):
        simulate(BICYCLE, surface, q, qd, np.array([0.0, 1.0]))
    # By samples alone: the normal distance is the height over |N|, to first order.
    centre, x, _, z, radius = wheels(q, constants(BICYCLE))[1]
    assert heights(surface, centre, x, z, radius, np.linspace(-np.pi, np.pi, DENSE)).min() < -0.0362


def test_no_wheel_stands_in_a_bowl_tighter_than_itself() -> None:
    """Upright on the axis of z = alpha r^2 a wheel of radius R touches once if alpha < 1 / (2 R)."""
    c = constants(BICYCLE)
    for k in range(2):
        radius = wheels(np.zeros(9), c)[k][4]
        for factor in (0.999, 1.001):
            surface = Paraboloid(factor / (2 * radius))
            known = rim_search(surface, [radius])
            where = ((0.0, 0.0, radius), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), radius, 0.0)
            bound = kernel.bound(*where, known, surface.function.real, surface.parameters)
            assert bound == pytest.approx(1 - factor, abs=1e-12), WHEELS[k]


@pytest.mark.slow
def test_families_list_no_motion_on_which_no_wheel_stands() -> None:
    family = trace(BICYCLE, Paraboloid(5.0), 2, 0.05)
    assert "pivot" in family.ends
    assert all(point.kind != "pivot" for point in special_points(family))


def test_motions_of_the_library_s_bowls_stand() -> None:
    _, motion = find_motion(BICYCLE, Paraboloid(0.2), 10.0, 1)
    q, _ = motion.state()
    assert np.all(rim_clearances(BICYCLE, Paraboloid(0.2), q, motion.contact.ravel()) > 0.5)
