"""Section 3.3, Figure 7, and section 5: the bowl of alpha = 1, and motions that exist on every bowl."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...reference.circular import LEAN, REAR_SPEED, SIGMA, STEER
from ...reference.critical import reconnections
from ...reference.curve import sample_curve
from ...reference.families import FAMILIES, trace
from ...reference.kernels.steady import STANDING
from .bowl import profiles
from .evidence import Evidence, families_command_line
from .fast import carry_pivot, pivot_at, squared_rates, with_angle
from .ledger import LedgerLine, SelfCheck, Source, above, below, claim_line, count_by_cut, equals, source
from .limits import FlatLimit, find_limit
from .search import FoundMotion, distance, search_coordinates, search_motions

_STEEP, _DEEP = 1.0, 0.2
_BETWEEN = (0.425, 0.44, 0.46)  # alphas without a pivoting motion
_MUCH = 0.4  # [rad] in the figures' coordinates: twice the distance of curves that count as alike
_NEAR_REST, _NEAR_INFINITY = 0.41, 0.47  # alphas at which the pivoting motion is slow, and fast
_G_AND_A = ("pivot", "static")
_SAME = 0.1  # in `search_coordinates`: the step of following curves


def steep_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the lines on alpha = 1 and on all alphas."""
    found = evidence.found(_STEEP)
    yield _changed_line(evidence)
    yield _still_there_line(evidence, found)
    yield _third_and_fourth_line(evidence, found)
    yield from _first_and_third_lines(evidence, found)
    yield from _four_still_line(evidence, found)
    yield from _always_lines(evidence)
    yield _never_without_line(evidence)


def _check_residual(found: FoundMotion) -> SelfCheck:
    worst = 0.0
    for curve in found.curves:
        for u in curve[::5]:
            size = 1 + float(np.abs(u).max()) + abs(float(u[SIGMA]))
            worst = max(worst, float(np.abs(found.equations.residual(u)).max()) / size)
    return SelfCheck("largest residual of the 21 equations along the curves", worst, 1e-12)


def _changed_line(evidence: Evidence) -> LedgerLine:
    apart_by = profiles(evidence, _DEEP, _STEEP, FAMILIES)
    return claim_line(
        section="3.3",
        claim="when alpha is large the profiles change a lot",
        thresholds=[above("largest distance of two curves in the figures' coordinates", max(apart_by), _MUCH, "rad")],
        measured=f"from 1/5 to 1 the curves followed from the families' anchors move by "
        f"{', '.join(f'{value:.2f}' for value in apart_by)} rad in the figures' coordinates",
        source=source(
            "the families' curves and their distance", profiles, command=families_command_line(_DEEP, _STEEP)
        ),
        checks=[evidence.residual((_DEEP, _STEEP))],
    )


def _search_source(found: FoundMotion, what: str) -> Source:
    return source(what, search_motions, search=found.described)


def _still_there_line(evidence: Evidence, found: FoundMotion) -> LedgerLine:
    forces = sample_curve(found.equations, np.array([*found.static, *found.pivoting])).normal_force
    return claim_line(
        section="3.3",
        claim="at alpha = 1 a static equilibrium A and a pivoting motion G (H) still exist",
        thresholds=[
            equals("static equilibria", len(found.static), 1),
            equals("pivoting motions", len(found.pivoting), 1),
        ],
        measured=f"one of each, but in both the ground would have to pull the front wheel: {forces[0, 1]:.1f} N at A "
        f"(steer {found.static[0][STEER]:.6f}), {forces[-1, 1]:.1f} N at G",
        source=_search_source(found, "static equilibria and pivoting motions, and their contact forces"),
        checks=[_check_residual(found), evidence.searched_again(_STEEP)],
    )


def _has_one_each(found: FoundMotion) -> bool:
    return (len(found.static), len(found.pivoting)) == (1, 1)


def _third_and_fourth_line(evidence: Evidence, found: FoundMotion) -> LedgerLine:
    gaps = []
    for number in (3, 4):
        start = evidence.family(_STEEP, number).points[0].unknowns
        gaps.append(float(np.abs(np.abs(start) - np.abs(found.pivoting[0])).max()))
    return claim_line(
        section="3.3",
        claim="at alpha = 1 family 3 merges with family 4 at G",
        thresholds=[below("largest difference of the constants of their ends from G's", max(gaps), 1e-12)],
        measured=f"both start in the one pivoting motion: constants differ by {max(gaps):.0e}",
        source=source("the ends of families 3 and 4", trace, command=families_command_line(_STEEP)),
        checks=[_check_residual(found)],
    )


def _curve_through(found: FoundMotion, unknowns: np.ndarray) -> np.ndarray:
    """Return the curve that passes through a solution."""
    return min(found.curves, key=lambda curve: distance(curve, unknowns))


def _flat_limit(found: FoundMotion, curve: np.ndarray) -> FlatLimit:
    """Return the limit of a curve's end at a lean of -pi/2."""
    return find_limit(found.equations, [curve[0], curve[-1]], -1)


def _first_and_third_lines(evidence: Evidence, found: FoundMotion) -> Iterator[LedgerLine]:
    at_rest, pivoting = _curve_through(found, found.static[0]), _curve_through(found, found.pivoting[0])
    rest_end, pivot_end = _flat_limit(found, at_rest), _flat_limit(found, pivoting)
    touch = evidence.touching((1, 3))
    solved, again = _check_residual(found), evidence.searched_again(_STEEP)
    exchanged = [solved]
    if touch is not None:
        exchanged.append(SelfCheck("residual of the touching point's equations", touch.residual, 1e-12))
    where = "nowhere" if touch is None else f"at alpha = {touch.alpha:.11f}"
    yield claim_line(
        section="3.3",
        claim="by alpha = 1 family 3 has met family 1",
        thresholds=[
            equals("alphas below 1 at which they touch", int(touch is not None), 1),
            below(
                "larger steer of the two curves' flat ends", max(abs(rest_end.steer), abs(pivot_end.steer)), 1e-3, "rad"
            ),
            above("lesser front rate there", min(rest_end.front_rate, pivot_end.front_rate), 300.0, "rad/s"),
        ],
        measured=f"they have exchanged ends {where}: the curve that starts in A, as family 1 did, runs to F (-pi/2, 0, "
        f"infinity), as family 3 did; the curve of G tends to the same corner of the figure (steers "
        f"{rest_end.steer:.5f}, {pivot_end.steer:.5f})",
        source=source(
            "the touching point, and the curves' limits", reconnections, find_limit, command="velodrome critical"
        ),
        checks=exchanged,
    )
    yield _at_b_line(evidence, found)
    near = min(distance(pivoting, u) for u in at_rest)
    apart = abs(rest_end.radius - pivot_end.radius)
    yield claim_line(
        section="3.3",
        claim="so at alpha = 1 families 1, 3 and 4 are one combined family",
        thresholds=[
            below(
                "least distance of the curve of A from that of G (its coordinates as in `search_motions`)", near, _SAME
            )
        ],
        measured=f"the curve of A and the curve of G (through H into family 4) share no motion: nowhere nearer than "
        f"{near:.3f} (lean, steer, pitch, bounded radius and speed); at the corner they share in the figure D rides "
        f"circles of {rest_end.radius:.4f} and {pivot_end.radius:.4f} m, {apart:.4f} m apart",
        source=_search_source(found, "the curves through A and through G"),
        checks=[
            solved,
            again,
            SelfCheck("residual on the way to the corner", max(rest_end.residual, pivot_end.residual), 1e-12),
        ],
    )
    yield _combined_somewhere_line(evidence)


def _at_b_line(evidence: Evidence, found: FoundMotion) -> LedgerLine:
    """Make the line on B as in the text: upright straight motion, the limit of large circles, handlebar forward."""
    ends = [(curve, u) for curve in found.curves for u in (curve[0], curve[-1]) if u[STEER] < 0.5 * np.pi]
    straight, end = max(ends, key=lambda pair: float(np.hypot(*pair[1][:2])))
    pivoting, at_rest = _curve_through(found, found.pivoting[0]), _curve_through(found, found.static[0])
    apart = min(distance(pivoting, u) for u in straight)
    from_a = min(distance(at_rest, u) for u in straight)
    return claim_line(
        section="3.3",
        claim="at alpha = 1 family 3 merges with family 1 at point B",
        thresholds=[
            below("least distance of B's curve from that of G (coordinates as in `search_motions`)", apart, _SAME)
        ],
        measured="B, upright straight motion by the text, is the limit of large circles with the handlebar forward "
        f"(here lean {end[LEAN]:.2f}, steer {end[STEER]:.2f}, D's circle {np.hypot(*end[:2]):.0f} m). It lies on a "
        f"curve of its own, nowhere nearer than {apart:.3f} to the curve of G and {from_a:.3f} to the curve of A. The "
        "text lacks the figure: that it letters another point B there cannot be excluded",
        source=_search_source(found, "the curves through large circles, through G and through A"),
        checks=[_check_residual(found), evidence.searched_again(_STEEP)],
    )


def _four_still_line(evidence: Evidence, found: FoundMotion) -> Iterator[LedgerLine]:
    """Count the families at alpha = 1 by different ways to cut the curves, and those on the plane in the same ways."""
    level = evidence.found(evidence.cases[0])
    cuts = {
        "whole curves": (len(found.curves), len(level.curves)),
        "curves cut at the pivoting motion": (found.families, level.families),
        "those whose wheels are both pushed, cut there": (_count_pushed(found), _count_pushed(level)),
    }
    yield count_by_cut(
        section="5",
        claim="at alpha = 1 there still are four families",
        printed=evidence.figures["counts"]["families"],
        counts={cut: here for cut, (here, _) in cuts.items()},
        measured="; ".join(f"{cut}: {here}, and {there} on the plane" for cut, (here, there) in cuts.items())
        + f" ({'; '.join(_describe_ends(curve) for curve in found.curves)}). Curves whose parts pass to other curves "
        "between these alphas have no numbers of their own",
        source=_search_source(found, "all curves of circular motions, counted under each way to cut them"),
        checks=[
            _check_residual(found),
            evidence.searched_again(evidence.cases[0], _STEEP),
            SelfCheck(
                "distance of solutions that count as the same, over the smallest between two curves",
                _SAME / _smallest_distance(found),
                1.0,
            ),
        ],
    )


def _count_pushed(found: FoundMotion) -> int:
    """Count the pieces along which the ground pushes on both wheels, cut at pivoting motions in them."""
    pieces = 0
    for curve in found.curves:
        # At a pivoting motion the rear rate is round-off of either sign: the sign changes between its neighbours.
        moving = curve[(curve[:, SIGMA] >= 0) & (np.abs(curve[:, REAR_SPEED]) > STANDING)]
        pushed = sample_curve(found.equations, moving).pushed
        turns = (moving[:-1, REAR_SPEED] * moving[1:, REAR_SPEED] < 0) & pushed[:-1] & pushed[1:]
        pieces += int(pushed[0]) + int(np.sum(~pushed[:-1] & pushed[1:])) + int(np.sum(turns))
    return pieces


def _smallest_distance(found: FoundMotion) -> float:
    """Return the smallest distance between two curves."""
    pairs = [(a, b) for i, a in enumerate(found.curves) for b in found.curves[:i]]
    return min(
        float(np.linalg.norm(search_coordinates(a)[:, None] - search_coordinates(b), axis=2).min()) for a, b in pairs
    )


def _describe_ends(curve: np.ndarray) -> str:
    return " to ".join(
        f"lean {u[LEAN]:.2f} steer {u[STEER]:.2f} radius {np.hypot(*u[:2]):.1f} m" for u in curve[[0, -1]]
    )


def _combined_somewhere_line(evidence: Evidence) -> LedgerLine:
    """Make the line on one curve of families 1, 3, 4: from where 1 and 3 touch to where the pivot comes to rest."""
    touch, (rest, _) = evidence.touching((1, 3)), _pivot_at_rest(evidence)
    low = np.nan if touch is None else touch.alpha
    middle = evidence.family(0.5 * (low + rest), 3).ends if low < rest else ("", "")
    return claim_line(
        section="5",
        claim="when alpha is large enough families 1, 3 and 4 are one",
        thresholds=[
            above("alphas from the touching point to where G is at rest", rest - low, 0.0, "1/m"),
            equals("half-way, ends of G's curve that are G and A", sum(end in _G_AND_A for end in middle), 2),
        ],
        measured=f"literally so from alpha = {low:.11f} to {rest:.11f}, where G comes to rest: the curve of G and H "
        "runs to A; not at alpha = 1",
        source=source("the touching point, and the alpha at which G comes to rest", reconnections, pivot_at),
        checks=[
            SelfCheck("residual of the touching point's equations", np.inf if touch is None else touch.residual, 1e-12),
        ],
    )


def _pivot_at_rest(evidence: Evidence) -> tuple[float, np.ndarray]:
    """Return the alpha at which the pivoting motion known from the plane comes to rest, and the motion."""
    start = with_angle(evidence.found(_DEEP).pivoting[0])
    return evidence.once(
        ("pivot at rest",), lambda: pivot_at(evidence.bicycle, start, _DEEP, towards=_NEAR_REST, angle=0.0)
    )


def _infinitely_fast_pivot(evidence: Evidence) -> tuple[float, np.ndarray]:
    """Return the alpha at which the pivoting motion of steep bowls is infinitely fast, and the motion."""
    start = with_angle(evidence.found(_STEEP).pivoting[0])
    return evidence.once(
        ("infinitely fast pivot",),
        lambda: pivot_at(evidence.bicycle, start, _STEEP, towards=_NEAR_INFINITY, angle=np.pi / 2),
    )


def _never_without_line(evidence: Evidence) -> LedgerLine:
    """Make the line on families 3 and 4 meeting in a pivoting motion, of which there is none in a range of alphas."""
    (rest, slow), (fast, quick) = _pivot_at_rest(evidence), _infinitely_fast_pivot(evidence)
    inside = [alpha for alpha in _BETWEEN if rest < alpha < fast]
    found = [evidence.found(alpha) for alpha in inside]
    squares = []
    for at, motion in ((rest, slow), (fast, quick)):
        squares += [squared_rates(carry_pivot(evidence.bicycle, motion, at, alpha)[-1][1]) for alpha in inside]
    lowest, highest = min(squares, default=np.nan), max(squares, default=np.nan)
    none = sum(len(each.pivoting) for each in found)
    least = min((len(each.pivoting) for each in found), default=0)
    return claim_line(
        section="5",
        claim="families 3 and 4 can always be merged through the pivoting motion",
        thresholds=[equals("least number of pivoting motions at alphas between the five cases", least, 1)],
        measured=f"from alpha = {rest:.11f}, where G comes to rest, to {fast:.11f}, from where on there is another "
        f"that begins infinitely fast, there is no pivoting motion: at alpha = {', '.join(f'{a:g}' for a in inside)} a "
        f"search finds {none}, and both, carried on there, would have negative squared rates, {lowest:.1f} to "
        f"{highest:.1f} rad^2/s^2. Both ends are solved for, what lies between is sampled",
        source=source(
            "alphas at which the pivoting motion's squared rates are zero, and infinite; searches between",
            pivot_at,
            carry_pivot,
            search_motions,
            search=found[0].described if found else None,
        ),
        checks=[
            SelfCheck("squared rates of the two between, over 1 rad^2/s^2 (must be negative)", highest, -1.0),
            evidence.searched_again(*inside),
            *(_check_residual(each) for each in found),
        ],
    )


def _always_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    cases = {alpha: evidence.found(alpha) for alpha in evidence.cases}
    solved = [*(_check_residual(found) for found in cases.values()), evidence.searched_again(*cases)]
    many = "; ".join(f"{a:g}: {len(f.static)} and {len(f.pivoting)}" for a, f in cases.items())
    searched = _search_source(next(iter(cases.values())), "static equilibria and pivoting motions of the five cases")
    yield claim_line(
        section="5",
        claim="in the five cases there are one static equilibrium and one pivoting motion",
        thresholds=[equals("cases with one of each", sum(map(_has_one_each, cases.values())), len(cases))],
        measured=f"found at alpha = {many}",
        source=searched,
        checks=solved,
    )
    rates = [
        abs(sample_curve(f.equations, np.array(f.pivoting)).front_rate).min() for f in cases.values() if f.pivoting
    ]
    rests = [abs(u[SIGMA]) for f in cases.values() for u in f.static]
    yield claim_line(
        section="5",
        claim="in the static equilibrium both wheels stand, in the pivoting motion the rear wheel alone",
        thresholds=[
            below(
                "largest squared rates of a static equilibrium, over 400 rad^2/s^2,", max(rests, default=np.nan), 1e-12
            ),
            above("least front rate of a pivoting motion", min(rates, default=np.nan), 0.0, "rad/s"),
        ],
        measured=f"in the five cases; front rates {', '.join(f'{rate:.4f}' for rate in rates)} rad/s",
        source=searched,
        checks=solved,
    )
    apart = [
        abs(abs(evidence.family(a, 3).points[0].unknowns) - abs(evidence.family(a, 4).points[0].unknowns)).max()
        for a in cases
    ]
    yield claim_line(
        section="5",
        claim="in the five cases families 3 and 4 merge in the pivoting motion",
        thresholds=[below("largest difference of the constants of their ends", max(apart), 1e-12)],
        measured=f"both start in it: constants differ by at most {max(apart):.0e}",
        source=source("the ends of families 3 and 4", trace, command=families_command_line(*cases)),
        checks=solved,
    )
    alpha = _BETWEEN[1]
    between = evidence.found(alpha)
    yield claim_line(
        section="5",
        claim="there always are one static equilibrium and one pivoting motion",
        thresholds=[
            equals(f"static equilibria at alpha = {alpha:g}", len(between.static), 1),
            equals(f"pivoting motions at alpha = {alpha:g}", len(between.pivoting), 1),
        ],
        measured=f"not between the five cases: at alpha = {alpha:g} {len(between.static)} static equilibria (steers "
        + ", ".join(f"{u[STEER]:.4f}" for u in between.static)
        + f") and {len(between.pivoting)} pivoting motions",
        source=_search_source(between, "static equilibria and pivoting motions between the five cases"),
        checks=[_check_residual(between), _check_steers_apart(between), evidence.searched_again(alpha)],
    )


def _check_steers_apart(found: FoundMotion) -> SelfCheck:
    steers = np.sort([u[STEER] for u in found.static])
    gap = float(np.diff(steers).min()) if len(steers) > 1 else np.inf
    return SelfCheck("round-off over the distance of two static equilibria", 1e-12 / gap, 1e-6)
