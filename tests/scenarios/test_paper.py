"""The ledger: its lines hold, and with a wrong print or a wrong bicycle they do not."""

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from reference.bicycle import Bicycle
from reference.circular import Steady
from reference.surface import Paraboloid
from reports.paper import printed
from reports.paper.ledger import FAILS, KINDS, ROUNDS, TRUNCATED, Line, document
from scenarios.paper import ledger
from scenarios.paper.configurations import configuration_lines
from scenarios.paper.evidence import Evidence
from scenarios.paper.limits import limit
from scenarios.paper.model import model_check
from scenarios.paper.named import plane_lines
from scenarios.paper.points import point_lines
from scenarios.paper.profile import apart, nearest
from scenarios.paper.rides import ride_lines
from scenarios.paper.search import mirrored
from scenarios.paper.stability import section_lines
from scenarios.paper.structure import structure_lines


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    """The paper's figures; what is computed is kept for the module."""
    return Evidence()


def failing(lines: Iterator[Line]) -> dict[str, str | None]:
    return {line.claim: line.fault for line in lines if not line.holds}


def altered(evidence: Evidence, *path: Any, value: Any) -> Evidence:
    """Evidence that knows all that is computed, with one printed figure changed."""
    figures = deepcopy(dict(printed()))
    place: Any = figures
    for key in path[:-1]:
        place = place[key]
    assert place[path[-1]] != value
    place[path[-1]] = value
    return replace(evidence, figures=figures)


def test_structure_and_simulations_hold(evidence: Evidence) -> None:
    lines = [*structure_lines(evidence), *ride_lines(evidence)]
    assert failing(iter(lines)) == {}
    assert len(lines) > 20


def test_every_figure_of_the_plane_rounds_but_one_that_is_cut_off(evidence: Evidence) -> None:
    lines = list(plane_lines(evidence))
    assert failing(iter(lines)) == {}
    assert [line.claim for line in lines if line.verdict == TRUNCATED] == ["D: steer"]
    assert sum(line.verdict == ROUNDS for line in lines) == 8


@pytest.mark.parametrize(
    ("lines_of", "path", "value", "claim"),
    [
        (structure_lines, ("counts", "parameters"), 24, "25 geometric"),
        (structure_lines, ("counts", "independent_coordinates"), 6, "nonholonomic"),
        (plane_lines, ("A", "steer"), "1.33973991148", "A: steer"),
        (plane_lines, ("D", "lean"), "0.63", "D: lean"),
        (plane_lines, ("D", "steer"), "2.77", "D: steer"),
        (plane_lines, ("G", "front_rate"), "6.17", "G: front rate"),
        (plane_lines, ("counts", "families"), 5, "four families"),
        (plane_lines, ("basu_mandal", "qdd", "psif"), -4.6198904139403, "agrees with Basu-Mandal"),
        (configuration_lines, ("P3", "steer"), "0.41", "P3 of family 3: steer"),
        (configuration_lines, ("P4", "front_rate"), "9.70", "P4 of family 4: front rate"),
        (point_lines, ("Q1", "v", 1), "-6.78", "Q1: D's y"),
        (point_lines, ("Q2", "eigenvalues", 3, 1), "6.72", "imaginary part"),
    ],
)
def test_a_wrong_print_is_found(
    evidence: Evidence, lines_of: Callable[[Evidence], Iterator[Line]], path: tuple, value: Any, claim: str
) -> None:
    found = failing(lines_of(altered(evidence, *path, value=value)))
    assert any(claim in line for line in found), found


def test_another_bicycle_is_not_the_papers_fault(evidence: Evidence) -> None:
    """Its figures are as well solved as any; that it is not the published one must show."""
    assert model_check(evidence.bicycle, evidence.figures).passes
    assert not model_check(replace(Bicycle(), trail=0.0801), evidence.figures).passes


def test_limits_of_flat_bicycles_follow_their_power_laws(evidence: Evidence) -> None:
    family = evidence.family(0.0, 2)
    ends = [family.points[0].unknowns, family.points[-1].unknowns]
    far = limit(family.equations, ends, 1)
    # At a distance d the laws' relative corrections are of order d = 1e-3.
    assert far.rate_exponent == pytest.approx(-0.5, abs=1e-3)
    assert far.steer_exponent == pytest.approx(1, abs=1e-3)
    with pytest.raises(ValueError, match="no flat end"):
        limit(family.equations, ends, -1)


def test_a_search_finds_the_families_without_their_anchors(evidence: Evidence) -> None:
    found = evidence.found(0.2)
    assert (len(found.static), len(found.pivoting), found.families) == (1, 1, 4)
    other = mirrored(found.pivoting[0])
    # The mirrored rows are the same sums in another order.
    assert np.abs(found.equations.residual(other)).max() < 1e-13
    assert isinstance(found.equations, Steady)
    assert found.equations.surface == Paraboloid(0.2)


def test_distances_of_curves() -> None:
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    gaps, feet = nearest(np.array([[0.5, 3, 4], [2.5, 0, 0]]), line)
    assert gaps == pytest.approx([5, 0.5])
    assert feet == pytest.approx(np.array([[0.5, 0, 0], [2, 0, 0]]))
    assert apart(line, line[:2]) == 1


@pytest.mark.slow
def test_the_whole_ledger() -> None:
    parts: list[tuple[str, float, float]] = []
    lines = ledger(lambda *seen: parts.append(seen))
    assert parts[-1][1] == parts[-1][2]
    assert len(lines) > 100
    assert {line.kind for line in lines} == set(KINDS)
    assert [line.section for line in lines] == sorted(line.section for line in lines)
    # What the paper has wrong, each shown to be its own.
    found = {line.claim: line.fault for line in lines if not line.holds}
    assert set(found.values()) == {"paper"}
    assert sorted(found) == [
        "at alpha = 0.005 stable motions are in families: 2",
        "at alpha = 1 there still are four families",
        "so at alpha = 1 families 1, 3 and 4 are one combined family",
        "there always are one static equilibrium and one pivoting motion",
    ]
    assert document(lines)["faults"] == {"paper": 4, "ours": 0}


@pytest.mark.slow
def test_another_bicycle_fails_the_ledger() -> None:
    lines = ledger(bicycle=replace(Bicycle(), rear_wheel_radius=0.301))
    assert {line.fault for line in lines if line.verdict == FAILS} == {"ours"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "value", "claim"),
    [
        (("stable_in", "0.05"), [2], "at alpha = 0.05 stable motions"),
        (("stable_in", "0.0"), [2], "at alpha = 0 stable motions"),
        (("none_from",), 0.03, "from alpha = 0.03 on no stable section"),
    ],
)
def test_a_wrong_claim_on_stability_is_found(evidence: Evidence, path: tuple, value: Any, claim: str) -> None:
    assert any(claim in line for line in failing(section_lines(altered(evidence, *path, value=value))))


@pytest.mark.slow
def test_the_right_claim_on_stability_holds(evidence: Evidence) -> None:
    """With family 4 added at 1/200 that line is reproduced."""
    assert failing(section_lines(altered(evidence, "stable_in", "0.005", value=[2, 4]))) == {}
