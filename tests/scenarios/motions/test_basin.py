"""The document of `velodrome basin`, and what it refuses."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from velodrome.reference.basins.outcome import KINDS
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.motions import BasinRequest, find_basin, write_basin
from velodrome.scenarios.motions.basin import LETTERS
from velodrome.scenarios.scenario import load_scenario


def find(source: str, changes: dict[str, Any] | None = None, **request: Any) -> dict[str, Any]:
    name, scenario = load_scenario(source, changes)
    return find_basin(name, scenario, BasinRequest(**request)).as_json()


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    reach = {"lean_rate": 0.4, "steer_rate": 0.9}
    wanted = {"along": ("lean_rate",), "map": ("lean_rate", "steer_rate"), "rides": 25, "sample": 40}
    return find("q2", reach=reach, follow=False, **wanted)


@pytest.mark.slow
def test_edges_have_rides_on_both_sides_whose_leans_begin_alike_and_end_apart(document: dict[str, Any]) -> None:
    plus, minus = document["edges"]
    assert [plus["along"], minus["along"]] == [{"lean_rate": 1.0}, {"lean_rate": -1.0}]
    assert plus["size"] == pytest.approx(0.187291, abs=1e-6)
    assert minus["size"] == pytest.approx(0.337294, abs=1e-6)
    for edge in (plus, minus):
        inside, outside = edge["inside"], edge["outside"]
        assert 0 < outside["size"] - inside["size"] <= 1e-6 * outside["size"] + 2e-16 + 1e-6 * max(edge["scan"]["size"])
        assert (inside["outcome"], outside["outcome"]) == ("returned", "lost-contact")
        early = int(10.0 / max(inside["lean_window"], outside["lean_window"]))
        # The edge repels with 0.38 1/s at most: 1e-6 rad is 5e-5 rad after ten seconds.
        ends = [
            np.interp(10.0, side["lean_window"] * (np.arange(len(side["least_lean"])) + 0.5), side["greatest_lean"])
            for side in (inside, outside)
        ]
        assert early > 10
        assert abs(ends[0] - ends[1]) < 0.02
        # The circles of both energies lean by 0.74 rad, the unstable ones that the rides pass first by 0.67 rad.
        assert 0.7 < min(inside["least_lean"][-20:]) < max(inside["greatest_lean"][-20:]) < 0.8
        assert min(outside["least_lean"]) < 0.5 < min(inside["least_lean"])
    assert len(plus["scan"]["size"]) == len(plus["scan"]["outcome"])
    assert plus["survivors_beyond"] == minus["survivors_beyond"] == []


@pytest.mark.slow
def test_the_circle_and_its_orbit_are_told(document: dict[str, Any]) -> None:
    circle = document["circle"]
    assert circle["family"] == 2
    assert circle["stable_within"] == pytest.approx(0.0354, abs=5e-5)
    assert circle["slowest_eigenvalue"] == pytest.approx([-0.01111, 2.35022], abs=2e-4)
    low, high = document["stable_energies"]
    assert low < circle["energy"] < high


@pytest.mark.slow
def test_a_map_is_rows_of_letters(document: dict[str, Any]) -> None:
    seen = document["map"]
    assert seen["letters"] == {letter: kind for kind, letter in LETTERS.items()}
    assert len(set(LETTERS.values())) == len(KINDS)
    assert [seen[axis]["key"] for axis in ("x", "y")] == ["lean_rate", "steer_rate"]
    assert [len(row) for row in seen["rows"]] == [5] * 5
    assert sum(seen["outcomes"].values()) == 25
    middle = seen["rows"][2][2]
    assert seen["x"]["values"][2] == seen["y"]["values"][2] == 0
    assert seen["letters"][middle] == "returned"
    assert sum(row.count("r") for row in seen["rows"]) == seen["outcomes"]["returned"]


@pytest.mark.slow
def test_a_sample_adds_up(document: dict[str, Any]) -> None:
    sample = document["sample"]
    assert sample["reach"] == {"lean_rate": 0.4, "steer_rate": 0.9}
    assert sample["share"] == sample["survived"] / sample["rides"] == sample["survived"] / 40
    assert sum(part["rides"] for part in sample["by_energy"]) == 40
    assert sum(part["survived"] for part in sample["by_energy"]) == sample["survived"]
    assert sum(sample["outcomes"].values()) == 40
    assert 0 < sample["error"] < 0.5 / 40**0.5 + 1e-12


@pytest.mark.slow
def test_the_document_and_its_figures_are_written(document: dict[str, Any], tmp_path: Path) -> None:
    written = write_basin(document, tmp_path / "new")
    assert [path.name for path in written] == ["basin.json", "edges.png", "map.png"]
    assert json.loads(written[0].read_text(encoding="utf-8"))["edges"] == document["edges"]
    assert all(path.stat().st_size > 1000 for path in written)


@pytest.mark.slow
def test_a_perturbation_is_the_direction_and_its_multiples_are_the_sizes() -> None:
    plus, minus = find("q2-minus", follow=False)["edges"]
    assert plus["along"] == {"lean_rate": -0.1}
    assert plus["size"] == pytest.approx(3.37294, abs=1e-4)
    assert minus["size"] == pytest.approx(1.87291, abs=1e-4)


@pytest.mark.slow
def test_edges_at_a_fixed_energy_differ_and_their_rides_return_to_the_circle_itself() -> None:
    found = find("q2", along=("lean",), fixed_energy=True)
    for edge in found["edges"]:
        assert edge["inside"]["energy"] == pytest.approx(found["circle"]["energy"], rel=1e-12)
        leads = edge["leads_to"]
        assert leads["settled"]
        assert leads["is_known"]
        assert leads["orbit"]["lean_amplitude"] == pytest.approx(found["circle"]["stable_within"], rel=1e-6)


@pytest.mark.parametrize(
    ("source", "changes", "complaint"),
    [
        ("q1", {}, "motion: the circle at lean .* is not stable .disturbances grow with 0.384"),
        ("iftomm-1", {}, "motion: it is straight"),
        ("q2", {"inputs.steer_damping": 0.1}, "inputs: with .* the energy is not kept"),
    ],
)
def test_what_has_no_basin_is_refused(source: str, changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ScenarioError, match=complaint) as caught:
        find(source, changes)
    assert "\n" not in str(caught.value)
