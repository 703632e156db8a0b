"""`--bicycle`: another bicycle in the commands, what they say of it, and motions that it does not have."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.upright import canonical_matrices
from velodrome.scenarios.scenario.bicycle_file import read_bicycle_file

CASES = Path(__file__).parents[2] / "cases"
SKATE = str(CASES / "tms-exact.toml")
UPRIGHT = """
title = "Straight"
surface = { kind = "plane" }
motion = { rear_rate = 15.0, near = { lean = 0.0, steer = 0.0 } }
perturbation = { lean_rate = 0.02 }
simulation = { duration = 0.1 }
"""
LONG = asdict(replace(Bicycle(), wheelbase=1.1, rear_frame_mass=70.0))
NEAR_STRAIGHT = ("circular", "--alpha", "0", "--near", "0,0", "--json")


@pytest.fixture
def measured() -> Path:
    """A bicycle of BicycleParameters whose moments of inertia break the triangle inequality."""
    peer = pytest.importorskip("bicycleparameters")
    return Path(peer.__file__).parent / "app-data/bicycles/Browser/Parameters/BrowserBenchmark.txt"


def test_straight_motion_of_the_command_has_the_eigenvalues_of_the_bicycle(velodrome) -> None:
    found = velodrome(*NEAR_STRAIGHT, "--rear-rate", "40", "--bicycle", SKATE).json()
    assert (found["family"], found["yaw_rate"], found["lean"], found["steer"]) == (None, 0.0, 0.0, 0.0)
    assert found["bicycle"]["name"] == "tms-exact"
    bicycle = Bicycle(**found["bicycle"]["parameters"])
    expected = canonical_matrices(bicycle).eigenvalues(40 * bicycle.rear_wheel_radius)[0]
    values = np.array(found["eigenvalues"]) @ np.array([1, 1j])
    assert np.count_nonzero(np.abs(values) < 1e-12) == 3
    np.testing.assert_allclose(np.sort_complex(values[np.abs(values) >= 1e-12]), np.sort_complex(expected), atol=1e-9)
    assert found["lyapunov_stable"] == (expected.real.max() < 0)
    table = velodrome("circular", "--alpha", "0", "--near", "0,0", "--rear-rate", "40", "--bicycle", SKATE).stdout
    assert table.startswith("bicycle: tms-exact\n")
    assert "none: straight motion" in table


def test_a_measured_bicycle_is_named_and_warned_of(velodrome, measured: Path) -> None:
    result = velodrome(*NEAR_STRAIGHT, "--rear-rate", "15", "--bicycle", str(measured))
    found = result.json()
    assert found["bicycle"] == {"name": measured.stem, "parameters": asdict(read_bicycle_file(measured).bicycle)}
    assert len(found["warnings"]) == 1
    assert "rear_frame: the largest principal moment exceeds" in found["warnings"][0]
    table = velodrome("circular", "--alpha", "0", "--near", "0,0", "--rear-rate", "15", "--bicycle", str(measured))
    assert f"warning: {found['warnings'][0]}" in table.stdout


def test_a_run_rides_the_given_bicycle_and_states_every_number(velodrome, tmp_path: Path, measured: Path) -> None:
    (tmp_path / "ride.toml").write_text(UPRIGHT + "bicycle = { trail = 0.2 }\n")
    more = ("--bicycle", str(measured), "--set", "bicycle.rear_frame_mass=12", "--engine", "reference")
    result = velodrome("run", "ride.toml", *more, "--json")
    assert result.status == 0
    expected = replace(read_bicycle_file(measured).bicycle, rear_frame_mass=12.0)
    folder = Path(result.json()["runs"][0]["folder"])
    stored = velodrome("bicycle", str(folder / "scenario.toml"), "--speeds", "5,6", "--json").json()
    assert stored["parameters"] == asdict(expected)
    assert "bicycle" in (folder / "scenario.toml").read_text()
    assert measured.stem not in (folder / "scenario.toml").read_text()


@pytest.mark.slow
def test_families_and_their_figure_are_those_of_the_bicycle(velodrome, tmp_path: Path) -> None:
    (tmp_path / "long.toml").write_text("\n".join(f"{key} = {value!r}" for key, value in LONG.items()))
    found = velodrome("families", "--alpha", "0.2", "--bicycle", "long.toml", "--out", "found", "--json").json()
    assert found["bicycle"] == {"name": "long", "parameters": LONG}
    assert {path.name for path in (tmp_path / "found").iterdir()} == {"families.json", "families.html", "families.png"}
    for family in found["families"]:
        points = family["points"]
        total = np.add(points["normal_force_rear"], points["normal_force_front"])
        assert np.all(np.isfinite(total))
    benchmark = velodrome("families", "--alpha", "0.2", "--json").json()
    assert benchmark["bicycle"]["name"] == "benchmark"
    assert benchmark["families"] != found["families"]


@pytest.mark.parametrize("json", [True, False])
@pytest.mark.parametrize(
    "arguments",
    [
        ("circular", "--alpha", "0.005", "--rear-rate", "10", "--family", "2"),
        ("run", "q2", "--engine", "reference", "--set", "motion.rear_rate=10"),
        ("precision", "q2", "--engine", "reference", "--set", "motion.rear_rate=10"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_motion_that_is_not_there_is_no_bad_input(velodrome, arguments: tuple[str, ...], json: bool) -> None:
    result = velodrome(*arguments, *(["--json"] if json else []))
    assert result.status == 1
    if json:
        document = result.json()
        assert set(document) == {"schema_version", "reason", "message"}
        assert document["reason"] == "no-such-motion"
        assert "no circular motion found with rear rate 10.0 rad/s" in document["message"]
    else:
        assert result.stdout == ""
        assert result.stderr.count("\n") == 1
        assert "no circular motion found with rear rate 10.0 rad/s" in result.stderr


def test_a_search_that_broke_off_is_told_from_one_that_found_nothing(
    velodrome, monkeypatch: pytest.MonkeyPatch
) -> None:
    from velodrome.reference import families
    from velodrome.reference.missing_motion import SearchFailed

    def lose(*_: object) -> None:
        raise SearchFailed("its anchor is lost 5 % of the way")

    monkeypatch.setattr(families, "anchor", lose)
    monkeypatch.setattr(families, "_follow_families", lambda *_: [])
    result = velodrome("circular", "--alpha", "0.005", "--rear-rate", "18", "--family", "2", "--json")
    assert (result.status, result.json()["reason"]) == (1, "search-failed")
    assert "the search is not complete; family 2: its anchor is lost" in result.json()["message"]


SINGULAR = SKATE, "front_frame_mass = 1.0", "front_frame_mass = 0.0"


@pytest.mark.parametrize(
    "arguments",
    [("run", "singular.toml"), ("bicycle", "singular.toml"), (*NEAR_STRAIGHT, "--rear-rate", "20")],
    ids=lambda arguments: arguments[0],
)
def test_singular_equations_are_refused_with_the_motion_without_inertia(
    velodrome, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    source, old, new = SINGULAR
    (tmp_path / "singular.toml").write_text(Path(source).read_text().replace(old, new))
    more = ("--bicycle", "singular.toml") if arguments[0] == "circular" else ()
    result = velodrome(*arguments, *more)
    assert (result.status, result.stdout, result.stderr.count("\n")) == (2, "", 1)
    assert "steer has no inertia" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "q2", "--bicycle", "nowhere.txt"), "--bicycle: nowhere.txt: there is no such file"),
        ((*NEAR_STRAIGHT, "--rear-rate", "20", "--bicycle", "warp"), "--bicycle: no bicycle 'warp'"),
        (("families", "--alpha", "0", "--bicycle", ""), "--bicycle: no bicycle ''"),
        (("critical", "--bicycle", "nowhere.yml"), "--bicycle: nowhere.yml: there is no such file"),
        (("atlas", "--bicycle", "nowhere.yml"), "--bicycle: nowhere.yml: there is no such file"),
        (("precision", "q2", "--bicycle", "nowhere.yml"), "--bicycle: nowhere.yml: there is no such file"),
    ],
)
def test_a_bicycle_that_cannot_be_read_is_one_line(velodrome, arguments: tuple[str, ...], said: str) -> None:
    result = velodrome(*arguments)
    assert (result.status, result.stdout, result.stderr.count("\n")) == (2, "", 1)
    assert said in result.stderr
