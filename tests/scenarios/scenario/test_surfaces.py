"""Grounds of scenario files and of the command line, and rides on them in every engine."""

from __future__ import annotations

import json
import tomllib
from typing import Any

import numpy as np
import pytest
import tomli_w

from velodrome.engines.engine import REFERENCE
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.bowls import Cone, Sphere, Torus
from velodrome.reference.circular import SIGMA, Steady
from velodrome.reference.families import trace_all
from velodrome.reference.height_field import HeightField
from velodrome.reference.kinematics import REAR_ANGLE
from velodrome.reference.profile import PolynomialProfile, SplineProfile
from velodrome.reference.surface import InclinedPlane, Paraboloid, Plane, Surface
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.motions import solve_circular
from velodrome.scenarios.motions.families import families_document
from velodrome.scenarios.paper.search import distance, search_motions
from velodrome.scenarios.scenario.schema import load_scenario, validate_scenario
from velodrome.scenarios.scenario.start import make_start
from velodrome.scenarios.scenario.surfaces import describe_surface, make_bowl, name_surface, parse_surface

GRID = [[0.1 * i * j for j in range(6)] for i in range(7)]
SURFACES: list[tuple[str, Surface]] = [
    ("plane", Plane()),
    ("inclined-plane:slope=0.06,direction=1", InclinedPlane(0.06, 1.0)),
    ("paraboloid:alpha=0.005", Paraboloid(0.005)),
    ("sphere:radius=20", Sphere(20.0)),
    ("cone:slope=0.1, rounding=5", Cone(0.1, 5.0)),
    ("torus:ring=20,tube=5", Torus(20.0, 5.0)),
    ("profile:coefficients=[0.005, 1e-4]", PolynomialProfile((0.005, 1e-4))),
    ("profile:radii=[0, 1, 2], heights=[0.0, 0.1, 0.5]", SplineProfile((0.0, 1.0, 2.0), (0.0, 0.1, 0.5))),
    (f"height-field:heights={GRID},spacing=2,origin=[-1,-5]", HeightField(GRID, 2.0, (-1.0, -5.0))),
]


def scenario(surface: dict[str, Any], **motion: Any) -> dict[str, Any]:
    return {
        "title": "A ride",
        "surface": surface,
        "motion": motion or {"rear_rate": 15.0, "family": 2},
        "simulation": {"duration": 0.1},
    }


@pytest.mark.parametrize(("text", "surface"), SURFACES, ids=[text.partition("=")[0] for text, _ in SURFACES])
def test_a_surface_is_what_it_says_in_text_and_file(text: str, surface: Surface) -> None:
    assert parse_surface(text) == surface
    # As `describe_surface` writes it, a scenario file reads it; as the run folder keeps it, too.
    resolved = validate_scenario(scenario(describe_surface(surface), kind="upright", speed=5.0), "a.toml")
    assert resolved.surface.make() == surface
    kept = tomli_w.dumps(resolved.model_dump(exclude_none=True))
    assert json.loads(json.dumps(describe_surface(surface), allow_nan=False)) == describe_surface(surface)
    assert validate_scenario(tomllib.loads(kept), "a.toml") == resolved


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["plane", "height-field"]),
        ("sfere:radius=1", ["'sfere'", "sphere"]),
        ("sphere", ["radius", "missing"]),
        ("sphere:radius", ["KIND:KEY=VALUE"]),
        ("sphere:radius=1,kind='cone'", ["KIND:KEY=VALUE"]),
        ("sphere:radius=1 }\nx = { y = 1", ["KIND:KEY=VALUE"]),
        ("sphere:size=1", ["'size'", "radius"]),
        ("sphere:radius=-1", ["radius", "-1"]),
        ("sphere:radius=true", ["radius", "True"]),
        ("sphere:radius=nan", ["radius", "nan"]),
        ("cone:slope=1,rounding=0", ["rounding", "0"]),
        ("torus:ring=-1,tube=1", ["ring", "-1"]),
        ("profile:radii=[0,1]", ["coefficients", "heights"]),
        ("profile:coefficients=[0]", ["all zero"]),
        ("profile:coefficients=['a']", ["coefficients.0", "'a'"]),
        ("profile:radii=[1,0],heights=[1,2]", ["radii[1]", "0.0"]),
        ("height-field:spacing=1,heights=[[1]]", ["6 x 6"]),
    ],
)
def test_a_surface_that_is_none_is_refused_in_one_line(text: str, words: list[str]) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_surface(text)
    line = str(caught.value).replace(f"surface {text}", "")
    assert "\n" not in line
    assert all(word in line for word in words), line


def test_a_file_names_the_field_that_is_wrong() -> None:
    with pytest.raises(ScenarioError, match=r"^a.toml: surface.radius: .*-1"):
        validate_scenario(scenario({"kind": "sphere", "radius": -1.0}), "a.toml")
    with pytest.raises(ScenarioError, match=r"^a.toml: surface: .*all equal"):
        validate_scenario(scenario({"kind": "profile", "radii": [0.0, 1.0], "heights": [1.0, 1.0]}), "a.toml")


def test_circular_motions_ask_for_a_surface_of_revolution() -> None:
    field = SURFACES[-1][1]
    with pytest.raises(ScenarioError, match=r"motion: .*surface of revolution.*height-field"):
        make_start(validate_scenario(scenario(describe_surface(field)), "a.toml"))
    with pytest.raises(ScenarioError, match="height-field is none"):
        families_document(field)
    with pytest.raises(ScenarioError, match="alpha is -1"):
        make_bowl(-1)


def test_documents_name_their_surface() -> None:
    assert name_surface(Plane()) == {"alpha": 0.0}
    assert name_surface(Paraboloid(0.2)) == {"alpha": 0.2}
    assert name_surface(Sphere(20.0)) == {"alpha": None, "surface": {"kind": "sphere", "radius": 20.0}}
    found = solve_circular(Bicycle(), Sphere(20.0), 15.0, 2).as_json()
    assert (found["alpha"], found["surface"]["radius"]) == (None, 20.0)
    assert found["lyapunov_stable"]


def test_a_sphere_has_all_four_families() -> None:
    document = families_document(Sphere(20.0))
    json.dumps(document, allow_nan=False)
    assert [family["family"] for family in document["families"]] == [1, 2, 3, 4]
    ((section,),) = [family["stable_sections"] for family in document["families"] if family["stable_sections"]]
    low, high = section["rear_rate"]
    assert low < 15.0 < high, "the library's ride"


def test_a_steep_bowls_document_has_further_curves_after_the_families() -> None:
    document = families_document(0.5)
    json.dumps(document, allow_nan=False)
    assert document["absent"] == {}
    assert [family["family"] for family in document["families"]] == [1, 2, 3, 4, 1]
    # Families 2 and 4 have joined: their curve is listed once.
    assert [family["joined_families"] for family in document["families"]] == [[], [4], [], [], []]
    reversed_circles, slow = document["families"][3:]
    assert reversed_circles["ends"] == ["large circle", "large circle"]
    assert min(reversed_circles["points"]["steer"]) > np.pi / 2
    assert slow["ends"] == ["static", "large circle"]
    assert list(slow["special_points"]) == ["A"]
    for family in document["families"]:
        assert len({len(values) for values in family["points"].values()}) == 1


FOLLOWED = (0.0, 0.005, 0.011, 1 / 33, 0.05, 0.2, 0.36, 0.39, 0.41, 0.44, 0.465, 0.48, 0.5, 0.7, 1.0)


@pytest.mark.parametrize(
    "alpha", [a if a == 0.5 else pytest.param(a, marks=pytest.mark.slow) for a in FOLLOWED], ids=lambda a: f"{a:.4g}"
)
def test_a_search_without_anchors_finds_no_curve_that_is_not_followed(alpha: float) -> None:
    equations = Steady(Bicycle(), Paraboloid(alpha))
    searched = [curve[curve[:, SIGMA] > 0] for curve in search_motions(equations).curves]
    curves, _ = trace_all(Bicycle(), Paraboloid(alpha), 0.1)
    followed = [np.array([point.unknowns for point in curve.points]) for curve in curves]
    for ones, others in ((searched, followed), (followed, searched)):
        for one in ones:
            # Both in steps of at most 0.1: a point is at most half of one from the other's. Beyond the ends none is.
            gaps = [min(distance(other, u) for other in others) for u in one[2:-2:3]]
            assert max(gaps) < 0.1


def test_on_waves_disturbances_are_those_of_level_ground() -> None:
    _, waves = load_scenario("waves")
    _, level = load_scenario("waves", {"surface": {"kind": "plane"}})
    assert make_start(waves).growth_rate == make_start(level).growth_rate


@pytest.mark.parametrize("name", ["sphere", "waves"])
@pytest.mark.parametrize(("engine", "order"), [("exudyn", 2), ("mujoco-native", 1)])
def test_every_engine_tends_to_the_reference(name: str, engine: str, order: int) -> None:
    _, loaded = load_scenario(name, {"simulation.duration": 0.4, "simulation.output_rate": 50.0})
    problem = make_start(loaded).problem
    exact = _ride(REFERENCE, problem)
    coarse, fine = (np.abs(_ride(engine, problem, step=step) - exact).max() for step in (2e-3, 1e-3))
    # The next order's share of the error is a few percent at these steps; half as much again covers it.
    assert 2**order / 1.5 < coarse / fine < 1.5 * 2**order


def _ride(name: str, problem: Any, **settings: float) -> np.ndarray:
    engine = load_engine(name)
    trajectory = engine.simulate(problem, engine.settings(**settings), lambda _: None)
    assert trajectory.ended is None
    return trajectory.q[:, :3]


def test_an_inclined_plane_speeds_a_straight_ride_up_by_its_slope() -> None:
    """The bicycle's weight along the slope drives its mass and the spin of its wheels: closed form."""
    slope = 0.06
    data = {
        "title": "Straight down",
        "surface": {"kind": "inclined-plane", "slope": slope, "direction": float(np.pi)},
        "motion": {"kind": "upright", "speed": 5.0},
        "simulation": {"duration": 4.0, "output_rate": 10.0},
    }
    start = make_start(validate_scenario(data, "incline"))
    bicycle = start.problem.bicycle
    spin = sum(
        getattr(bicycle, f"{wheel}_Iyy") / getattr(bicycle, f"{wheel}_radius") ** 2
        for wheel in ("rear_wheel", "front_wheel")
    )
    acceleration = bicycle.gravity * np.sin(np.arctan(slope)) * bicycle.mass / (bicycle.mass + spin)
    trajectory = load_engine("reference").simulate(start.problem, load_engine("reference").settings(), lambda _: None)
    speeds = trajectory.qd[:, REAR_ANGLE] * bicycle.rear_wheel_radius
    # The integrator's tolerance is 1e-12, relative to the state.
    np.testing.assert_allclose(speeds, 5.0 + acceleration * trajectory.time, rtol=1e-9)
    assert describe_surface(start.problem.surface) == data["surface"]


def test_an_upright_start_may_be_anywhere_on_the_ground() -> None:
    """A trough around the axis, with no ground at the origin."""
    data = {
        "title": "In a trough",
        "surface": {"kind": "torus", "ring": 6.0, "tube": 5.0},
        "motion": {"kind": "upright", "speed": 4.0},
        "perturbation": {"y": -5.0},
        "simulation": {"duration": 1.0, "output_rate": 10.0},
    }
    start = make_start(validate_scenario(data, "trough"))
    assert start.problem.q[1] == -5.0
    assert start.problem.q[0] == start.problem.bicycle.reference_point[0]
