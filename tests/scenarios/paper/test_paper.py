"""The ledger: its lines hold, and with a wrong print or a wrong bicycle they do not."""

import importlib
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import typer

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.circular import REAR_SPEED, SIGMA, Steady, newton, unknown_condition
from velodrome.reference.kernels.curve import CHOSEN
from velodrome.reference.stability import linearise
from velodrome.reference.surface import Paraboloid
from velodrome.scenarios.cli import app
from velodrome.scenarios.paper.claims import make_ledger
from velodrome.scenarios.paper.configurations import configuration_lines, named_motion
from velodrome.scenarios.paper.evidence import Evidence
from velodrome.scenarios.paper.fast import (
    expand_flat,
    follow_flat_end,
    pivot_at,
    pivoting,
    solve_flat,
    squared_rates,
    with_angle,
)
from velodrome.scenarios.paper.ledger import (
    DEPENDS,
    FAILS,
    KINDS,
    REPRODUCED,
    ROUNDS,
    TRUNCATED,
    UNTESTABLE,
    LedgerLine,
    ledger_document,
)
from velodrome.scenarios.paper.limits import find_limit
from velodrome.scenarios.paper.model import model_check
from velodrome.scenarios.paper.named import plane_lines
from velodrome.scenarios.paper.pencil import generalised_eigenvalues, linearised_dae, number_of_finite, spurious
from velodrome.scenarios.paper.points import point_lines
from velodrome.scenarios.paper.printed import known_discrepancies, read_printed
from velodrome.scenarios.paper.profile import curve_distance, nearest_point
from velodrome.scenarios.paper.rates import rate_lines
from velodrome.scenarios.paper.reduction import reduction_lines
from velodrome.scenarios.paper.rides import ride_lines
from velodrome.scenarios.paper.search import OTHER_GRID, find_missing, mirrored, search_motions
from velodrome.scenarios.paper.stability import section_lines
from velodrome.scenarios.paper.structure import structure_lines
from velodrome.scenarios.paper.unseen import unseen_lines


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    """The paper's figures; what is computed is kept for the module."""
    return Evidence()


def failing(lines: Iterator[LedgerLine]) -> dict[str, str | None]:
    return {line.claim: line.fault for line in lines if not line.holds}


def altered(evidence: Evidence, *path: Any, value: Any) -> Evidence:
    """Evidence that knows all that is computed, with one printed figure changed."""
    figures = deepcopy(dict(read_printed()))
    place: Any = figures
    for key in path[:-1]:
        place = place[key]
    assert place[path[-1]] != value
    place[path[-1]] = value
    return replace(evidence, figures=figures)


def all_say_how(lines: list[LedgerLine]) -> None:
    """Every line has thresholds that no round-off can move, and a source whose functions and commands exist."""
    commands: Any = typer.main.get_command(app)
    for line in lines:
        if line.verdict == UNTESTABLE:
            assert line.measured, line.claim
            continue
        assert line.thresholds, line.claim
        assert line.source.computed, line.claim
        for threshold in line.thresholds:
            size = max(abs(threshold.value), abs(threshold.limit))
            clear = abs(threshold.value - threshold.limit) > 1e-9 * size
            assert clear or threshold.relation == "=", (line.claim, threshold)
        for name in line.source.functions:
            assert callable(resolved(name)), name
        for command in (line.source.command or "").split(" && "):
            program, name, *arguments = command.split()
            assert program == "velodrome"
            commands.commands[name].make_context(name, arguments)


def resolved(name: str) -> Any:
    """What a full name stands for: a module's function, or a class's."""
    module, *rest = name.rsplit(".", 1)
    try:
        return getattr(importlib.import_module(module), *rest)
    except ModuleNotFoundError:
        return getattr(resolved(module), *rest)


def test_structure_and_simulations_hold(evidence: Evidence) -> None:
    lines = [*structure_lines(evidence), *ride_lines(evidence)]
    assert failing(iter(lines)) == {}
    assert len(lines) > 20
    all_say_how(lines)


def test_every_figure_of_the_plane_rounds_but_one_that_is_cut_off(evidence: Evidence) -> None:
    lines = list(plane_lines(evidence))
    assert failing(iter(lines)) == {}
    assert [line.claim for line in lines if line.verdict == TRUNCATED] == ["D: steer"]
    assert sum(line.verdict == ROUNDS for line in lines) == 8
    all_say_how(lines)


def test_figures_of_points_hold_and_say_how(evidence: Evidence) -> None:
    lines = [*configuration_lines(evidence), *point_lines(evidence), *unseen_lines(evidence)]
    assert failing(iter(lines)) == {}
    all_say_how(lines)


def test_rear_rates_run_to_infinity(evidence: Evidence) -> None:
    lines = list(rate_lines(evidence))
    assert failing(iter(lines)) == {}
    all_say_how(lines)


def test_fast_equations_are_the_steady_ones(evidence: Evidence) -> None:
    """Rows at any sigma are the affine ones; a family's point solves them, and again from a moved guess."""
    family = evidence.family(0.2, 2)
    unknowns = family.points[len(family.points) // 2].unknowns
    chosen = with_angle(unknowns)
    here = expand_flat(family.equations, chosen)
    # The point's own residual is some 1e-14, of accelerations of order 10.
    assert np.abs(here.rows).max() < 1e-11
    at = unknowns[CHOSEN].copy()
    at[6] = 3.7
    rows, angle = family.equations.expand(at).rows, at.copy()
    angle[6] = np.arctan(3.7)
    scale = np.where(np.arange(8) < 6, 1.0, np.cos(angle[6]))
    # Sums of terms of up to a hundred.
    assert expand_flat(family.equations, angle).rows == pytest.approx(scale * rows, abs=1e-12)
    changes = np.array(
        [
            (
                expand_flat(family.equations, chosen + 1e-6 * e).rows
                - expand_flat(family.equations, chosen - 1e-6 * e).rows
            )
            / 2e-6
            for e in np.eye(9)
        ]
    ).T
    assert here.jacobian == pytest.approx(changes, rel=1e-6, abs=1e-6 * np.abs(here.jacobian).max())
    lean = float(chosen[3])
    again = solve_flat(family.equations, chosen + 1e-3, lambda x, _: (float(x[3]) - lean, np.eye(9)[3]))
    assert again == pytest.approx(chosen, abs=1e-10)


def test_a_flat_end_is_followed_by_its_law(evidence: Evidence) -> None:
    family = evidence.family(0.0, 3)
    near, far = (follow_flat_end(family.equations, family.points[-1].unknowns, d) for d in (1e-3, 1e-6))
    # Squared rate times distance is constant but for a relative correction of the distance's order.
    assert near.constant == pytest.approx(far.constant, rel=10 * near.distance)
    assert far.rear_rate > 2e4
    # The motions of moderate speed are the family's.
    assert family.points[-1].unknowns[SIGMA] > 0


def test_no_pivoting_motion_between_two_alphas(evidence: Evidence) -> None:
    """Both ends are solved for; on either side of each the squared speed has the signs that make it an end."""
    bicycle = evidence.bicycle
    start = with_angle(evidence.found(0.2).pivoting[0])
    rest, still = pivot_at(bicycle, start, 0.2, towards=0.41, angle=0.0)
    assert rest == pytest.approx(0.41962074367657, abs=1e-12)
    for shape, sign in ((rest - 1e-3, 1), (rest + 1e-3, -1)):
        moved = solve_flat(Steady(bicycle, Paraboloid(shape)), still, pivoting)
        assert np.sign(squared_rates(moved)) == sign
    # The same by the equations in sigma.
    full, _ = newton(
        Steady(bicycle, Paraboloid(rest)),
        Steady(bicycle, Paraboloid(rest)).expand(np.where(np.arange(9) == 6, 0.0, still)).full,
        unknown_condition(REAR_SPEED, 0.0),
        most=30,
    )
    assert abs(full[SIGMA]) < 1e-12
    fast, quick = pivot_at(bicycle, with_angle(evidence.found(1.0).pivoting[0]), 1.0, towards=0.47, angle=np.pi / 2)
    assert fast == pytest.approx(0.46360209675220, abs=1e-12)
    for shape, sign in ((fast + 1e-3, 1), (fast - 1e-3, -1)):
        moved = solve_flat(Steady(bicycle, Paraboloid(shape)), quick, pivoting)
        assert np.sign(squared_rates(moved)) == sign
        assert abs(squared_rates(moved)) > 5000
    assert evidence.found(0.44).pivoting == []


def test_the_pencil_has_the_reduced_systems_seven_and_twenty_spurious(evidence: Evidence) -> None:
    motion, surface = named_motion(evidence, "Q2"), Paraboloid(0.005)
    e, h = linearised_dae(evidence.bicycle, surface, motion)
    reduced = linearise(evidence.bicycle, surface, *motion.state()).eigenvalues
    assert np.linalg.matrix_rank(e) == 15
    assert number_of_finite(e, h) == 7
    found = generalised_eigenvalues(e, h)
    off, rest = spurious(found, reduced)
    # Round-off of order 1e-15 times the norm, 1e3, times the condition.
    assert off < 1e-9
    assert len(rest) == 20
    # What is spurious is far from all that the motion has.
    assert np.abs(rest).min() > 1e3 * np.abs(reduced).max()
    # Were one of the seven not the pencil's, it would show.
    assert spurious(found, reduced + 0.01)[0] > 1e-3


def test_the_reduced_system_is_the_linearised_dae(evidence: Evidence) -> None:
    lines = list(reduction_lines(evidence))
    assert failing(iter(lines)) == {}
    assert [line.verdict for line in lines if "spurious" in line.claim] == [REPRODUCED]
    all_say_how(lines)


def test_a_second_grid_of_starts_finds_the_same(evidence: Evidence) -> None:
    found = evidence.found(0.2)
    again = search_motions(found.equations, OTHER_GRID)
    assert find_missing(found, again) == 0
    assert again.described != found.described
    # A search that has lost a curve or found another motion shows.
    assert find_missing(replace(found, curves=found.curves[1:]), again) > 0
    assert find_missing(replace(found, pivoting=[]), again) > 0
    assert find_missing(replace(found, static=[*found.static, found.static[0] + 0.01]), again) > 0


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
    evidence: Evidence, lines_of: Callable[[Evidence], Iterator[LedgerLine]], path: tuple, value: Any, claim: str
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
    far = find_limit(family.equations, ends, 1)
    # At a distance d the laws' relative corrections are of order d = 1e-3.
    assert far.rate_exponent == pytest.approx(-0.5, abs=1e-3)
    assert far.steer_exponent == pytest.approx(1, abs=1e-3)
    with pytest.raises(ValueError, match="no flat end"):
        find_limit(family.equations, ends, -1)


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
    gaps, feet = nearest_point(np.array([[0.5, 3, 4], [2.5, 0, 0]]), line)
    assert gaps == pytest.approx([5, 0.5])
    assert feet == pytest.approx(np.array([[0.5, 0, 0], [2, 0, 0]]))
    assert curve_distance(line, line[:2]) == 1


@pytest.mark.slow
def test_the_whole_ledger() -> None:
    parts: list[tuple[str, float, float]] = []
    lines = make_ledger(lambda *seen: parts.append(seen))
    assert parts[-1][1] == parts[-1][2]
    assert len(lines) > 145
    all_say_how(lines)
    assert {line.kind for line in lines} == set(KINDS)
    assert [line.section for line in lines] == sorted(line.section for line in lines)
    # What the paper has wrong, each shown to be its own.
    found = {line.claim: line.fault for line in lines if not line.holds}
    assert set(found.values()) == {"paper"}
    assert sorted(found) == [
        "at alpha = 0.005 stable motions are in families: 2",
        "at alpha = 1 family 3 merges with family 1 at point B",
        "families 3 and 4 can always be merged through the pivoting motion",
        "so at alpha = 1 families 1, 3 and 4 are one combined family",
        "there always are one static equilibrium and one pivoting motion",
    ]
    document = ledger_document(lines, known_discrepancies())
    assert document["faults"] == {"paper": 5, "ours": 0}
    assert document["surprises"] == []
    # The count under each cut: on the plane 3, 4 and 4.
    (cut,) = [line for line in lines if line.verdict == DEPENDS]
    assert cut.claim == "at alpha = 1 there still are four families"
    assert [threshold.value for threshold in cut.thresholds] == [4, 5, 4]


@pytest.mark.slow
def test_another_bicycle_fails_the_ledger() -> None:
    lines = make_ledger(bicycle=replace(Bicycle(), rear_wheel_radius=0.301))
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
