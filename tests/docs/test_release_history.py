"""The page of the histories of releases says what is stored of them, and what is stored is what a ride gives."""

from __future__ import annotations

import json
import re
from importlib.metadata import distribution, version
from pathlib import Path
from typing import Any

import pytest
from generated import fill_page
from histories import HISTORIES, list_turning_points, read_history
from pages import DOCS

from benchmarks.release_history import condense_history
from velodrome.reports.page import describe_run
from velodrome.reports.page.history import rank_moves
from velodrome.reports.page.judged_quantities import format_title
from velodrome.scenarios.gate import take_sample
from velodrome.scenarios.history.problems import prepare_ride
from velodrome.scenarios.run import configure_engine

pytestmark = pytest.mark.once  # text and stored numbers alone

PAGE = DOCS / "guides" / "release-history.md"
PACKAGES = sorted(path.stem for path in HISTORIES.glob("*.json"))
NAMES = {"mujoco": "MuJoCo", "exudyn": "Exudyn"}


def sections() -> dict[str, str]:
    """Text of the page by heading, as it is built."""
    parts = re.split(r"^#{2,3} (.+)$", fill_page(PAGE.read_text(encoding="utf-8")), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_every_turning_point_has_a_section_and_no_other_release_has_one() -> None:
    assert sorted(NAMES) == PACKAGES
    turned = [f"{NAMES[package]} {release}" for package in PACKAGES for release in list_turning_points(package)]
    assert turned
    assert sorted(turned) == sorted(name for name in sections() if re.fullmatch(r"\w+ [\d.]+", name))


@pytest.mark.parametrize("package", PACKAGES)
def test_a_turning_point_names_its_engines_scenarios_and_largest_moves(package: str) -> None:
    for release, points in list_turning_points(package).items():
        text = sections()[f"{NAMES[package]} {release}"]
        for point in points:
            assert f"`{point['engine']}`" in text
            assert point["scenario"] in text
            first = rank_moves(point["quantities"])[0]
            assert (describe_run("changed") if first["quantity"] == "run" else format_title(first["quantity"])) in text


@pytest.mark.parametrize("package", PACKAGES)
def test_the_page_shows_the_command_and_all_releases(package: str) -> None:
    stored, text = read_history(package), sections()[NAMES[package]]
    assert stored["command"] in text
    assert f"'{package}>=" in stored["command"]
    for scenario in stored["scenarios"]:
        assert scenario in stored["command"]
    ends = [row["release"] for row in stored["releases"]]
    for shown in (ends[0], ends[-1], stored["ridden_on"]):
        assert shown in text


def plain(text: str) -> str:
    """Words of reStructuredText or Markdown without their marks, in one line."""
    text = re.sub(r":[\w-]+:`([^`<]*?)\s*(?:<[^`>]*>)?`", r"\1", text)
    return " ".join(re.sub(r"[`*]|^> ?", "", text, flags=re.MULTILINE).split())


def test_mujocos_words_are_those_of_its_changelog() -> None:
    path = Path(str(distribution("mujoco").locate_file("mujoco/doc/changelog.rst")))
    if not path.exists() or version("mujoco") != "4.0.0":
        pytest.skip("not the release whose changelog is quoted")
    parts = re.split(r"^Version ([\d.]+) \(.*\)\n", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    notes = {release: plain(text) for release, text in zip(parts[1::2], parts[2::2], strict=True)}
    found = 0
    for name, text in sections().items():
        if name.startswith("MuJoCo "):
            for quote in re.findall(r"(?:^> .*\n)+", text, re.MULTILINE):
                assert plain(quote) in notes[name.removeprefix("MuJoCo ")]
                found += 1
    for release, quote in re.findall(r'MuJoCo ([\d.]+)\b[^"]*"([^"]+)"', sections()["Announced, and not seen here"]):
        assert plain(quote) in notes[release]
        found += 1
    assert found == 5


def moved(release: str, scenario: str, quantity: str) -> list[tuple[float, float]]:
    """Sizes of a quantity before and after a release of MuJoCo, of every engine that moved."""
    points = [point for point in list_turning_points("mujoco")[release] if point["scenario"] == scenario]
    moves = [move for point in points for move in point["quantities"] if move["quantity"] == quantity]
    return [(abs(move["before"]), abs(move["after"])) for move in moves]


def test_what_the_page_says_of_fourth_order_is_in_its_figures() -> None:
    orders = moved("4.0.0", "q2-plus", "observed_order")
    assert [(round(before), round(after)) for before, after in orders] == [(2, 4)] * 2
    errors = moved("4.0.0", "plane-circle", "position_error")
    assert len(errors) == 2
    assert all(1 < before / after < 4 for before, after in errors)
    assert all(before / after > 1000 for before, after in moved("4.0.0", "plane-circle", "eigenvalue_error"))


def test_mujocos_own_contacts_ride_alike_in_all_releases() -> None:
    rows = [row for row in read_history("mujoco")["releases"] if row["engine"] in ("mujoco-default", "mujoco-native")]
    assert {row["status"] for row in rows} == {"rode"}
    assert not any(row["changed"] for row in rows)


def test_the_warm_start_of_the_solver_moved_no_bit_of_rides_with_rk4() -> None:
    rows = [row for row in read_history("mujoco")["releases"] if row["release"] == "3.3.6"]
    found = [row["since_previous"] for row in rows if row["engine"] in ("mujoco-exact-contact", "mujoco-multipliers")]
    assert found == ["same-bits"] * 4


def test_a_history_that_is_not_complete_is_not_condensed() -> None:
    with pytest.raises(ValueError, match="does not have all rides"):
        condense_history({"package": "mujoco", "complete": False, "bisected": False}, "", "")


def last_moves(package: str) -> list[Any]:
    """The turning points of the newest stored release, if that is installed."""
    newest = read_history(package)["releases"][-1]["release"]
    points = list_turning_points(package).get(newest, [])
    mark = pytest.mark.skipif(version(package) != newest, reason=f"not the release of {package} that was ridden last")
    return [pytest.param(point, marks=mark, id=f"{point['engine']}-{point['scenario']}") for point in points]


@pytest.mark.slow
@pytest.mark.parametrize("point", [*last_moves("mujoco"), *last_moves("exudyn")])
def test_the_figures_of_the_newest_release_are_those_of_a_ride(point: dict[str, Any]) -> None:
    ride = prepare_ride(point["scenario"])
    engine, settings = configure_engine(point["engine"], ride.settings_of(point["engine"]))
    values = take_sample(ride.start, ride.exact, ride.gate, engine, settings, lambda _: None).values
    compared = 0
    for move in point["quantities"]:
        # A limit is that of two releases on one machine, and is as good for one release on two.
        if move["limit"] is not None and move["after"] is not None:
            assert values[move["quantity"]] == pytest.approx(move["after"], rel=0, abs=move["limit"]), move["quantity"]
            compared += 1
    assert compared, json.dumps(point)
