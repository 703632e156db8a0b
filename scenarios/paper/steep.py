"""Section 3.3, Figure 7, and section 5: the bowl of alpha = 1, and what is there always."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reference.circular import LEAN, REAR_SPEED, SIGMA, STEER, Steady, newton, unknown_condition
from reference.curve import sample
from reference.families import FAMILIES
from reference.surface import Paraboloid
from reports.paper.ledger import Check, Line, count, words

from .bowl import profiles
from .evidence import Evidence
from .limits import Limit, limit
from .search import Found, coordinates, distance

_STEEP, _DEEP, _BETWEEN = 1.0, 0.2, 0.44
_MUCH = 0.4  # rad in the figures' coordinates: twice what counts as alike
_SECANT = 30


def steep_lines(evidence: Evidence) -> Iterator[Line]:
    """Lines on alpha = 1 and on all alphas."""
    found = evidence.found(_STEEP)
    yield _changed(evidence)
    yield _still_there(found)
    yield _third_and_fourth(evidence, found)
    yield from _first_and_third(evidence, found)
    yield from _always(evidence)


def _solved(found: Found) -> Check:
    worst = 0.0
    for curve in found.curves:
        for u in curve[::5]:
            size = 1 + float(np.abs(u).max()) + abs(float(u[SIGMA]))
            worst = max(worst, float(np.abs(found.equations.residual(u)).max()) / size)
    return Check("largest residual of the 21 equations along the curves", worst, 1e-12)


def _changed(evidence: Evidence) -> Line:
    apart_by = profiles(evidence, _DEEP, _STEEP, FAMILIES)
    return words(
        *("3.3", "when alpha is large the profiles change a lot", max(apart_by) > _MUCH),
        f"from 1/5 to 1 the curves followed from the families' anchors move by "
        f"{', '.join(f'{value:.2f}' for value in apart_by)} rad in the figures' coordinates",
        [evidence.residual((_DEEP, _STEEP))],
    )


def _still_there(found: Found) -> Line:
    forces = sample(found.equations, np.array([*found.static, *found.pivoting])).normal_force
    return words(
        *("3.3", "at alpha = 1 a static equilibrium A and a pivoting motion G (H) still exist", _one_each(found)),
        f"one of each, but in both the ground would have to pull the front wheel: {forces[0, 1]:.1f} N at A (steer "
        f"{found.static[0][STEER]:.6f}), {forces[-1, 1]:.1f} N at G",
        [_solved(found)],
    )


def _one_each(found: Found) -> bool:
    return (len(found.static), len(found.pivoting)) == (1, 1)


def _third_and_fourth(evidence: Evidence, found: Found) -> Line:
    gaps = []
    for number in (3, 4):
        start = evidence.family(_STEEP, number).points[0].unknowns
        gaps.append(float(np.abs(np.abs(start) - np.abs(found.pivoting[0])).max()))
    return words(
        *("3.3", "at alpha = 1 family 3 merges with family 4 at G", max(gaps) < 1e-12),
        f"both start in the one pivoting motion: constants differ by {max(gaps):.0e}",
        [_solved(found)],
    )


def _holding(found: Found, unknowns: np.ndarray) -> np.ndarray:
    """The curve that passes a solution."""
    return min(found.curves, key=lambda curve: distance(curve, unknowns))


def _towards(found: Found, curve: np.ndarray) -> Limit:
    """Limit of a curve's end at a lean of -pi/2."""
    return limit(found.equations, [curve[0], curve[-1]], -1)


def _first_and_third(evidence: Evidence, found: Found) -> Iterator[Line]:
    at_rest, pivoting = _holding(found, found.static[0]), _holding(found, found.pivoting[0])
    one, other = _towards(found, at_rest), _towards(found, pivoting)
    same_limit = max(abs(one.steer), abs(other.steer)) < 1e-3 and min(one.front_rate, other.front_rate) > 300
    touch = evidence.touching((1, 3))
    exchanged = [_solved(found)]
    if touch is not None:
        exchanged.append(Check("residual of the touching point's 44 equations", touch.residual, 1e-12))
    where = "nowhere" if touch is None else f"at alpha = {touch.alpha:.11f}"
    yield words(
        *("3.3", "at alpha = 1 family 3 merges with family 1 too", same_limit and touch is not None),
        f"they have exchanged ends {where}: the curve that starts in A, as family 1 did, runs to F (-pi/2, 0, "
        f"infinity), as family 3 did; the curve of G tends to the same corner of the figure (steers {one.steer:.5f}, "
        f"{other.steer:.5f})",
        exchanged,
    )
    near = min(distance(pivoting, u) for u in at_rest)
    joined = near < 1e-3 or abs(one.radius - other.radius) < 1e-3
    yield words(
        *("3.3", "so at alpha = 1 families 1, 3 and 4 are one combined family", joined),
        f"the curve of A and the curve of G (through H into family 4) share no motion: nowhere nearer than {near:.3f} "
        f"(lean, steer, pitch, bounded radius and speed); at the corner they share in the figure D rides circles of "
        f"{one.radius:.4f} and {other.radius:.4f} m",
        [_solved(found), Check("residual on the way to the corner", max(one.residual, other.residual), 1e-12)],
    )
    yield _combined_somewhere(evidence)
    printed = evidence.figures["counts"]["families"]
    ends = "; ".join(_ends(curve) for curve in found.curves)
    yield count(
        *("5", "at alpha = 1 there still are four families", printed, found.families),
        f"{len(found.curves)} curves, one through the pivoting motion: {found.families} families ({ends})",
        [_solved(found), Check("nearest two curves, over how near is the same", 0.1 / _nearest(found), 1.0)],
    )


def _nearest(found: Found) -> float:
    """Least distance between two curves."""
    pairs = [(a, b) for i, a in enumerate(found.curves) for b in found.curves[:i]]
    return min(float(np.linalg.norm(coordinates(a)[:, None] - coordinates(b), axis=2).min()) for a, b in pairs)


def _ends(curve: np.ndarray) -> str:
    return " to ".join(
        f"lean {u[LEAN]:.2f} steer {u[STEER]:.2f} radius {np.hypot(*u[:2]):.1f} m" for u in curve[[0, -1]]
    )


def _combined_somewhere(evidence: Evidence) -> Line:
    """Where families 1, 3, 4 are one curve: from where 1 and 3 touch to where the pivoting motion comes to rest."""
    touch, (rest, speed) = (
        evidence.touching((1, 3)),
        evidence.once(("pivot at rest",), lambda: _pivot_at_rest(evidence)),
    )
    low = np.nan if touch is None else touch.alpha
    middle = evidence.family(0.5 * (low + rest), 3).ends if low < rest else ("", "")
    return words(
        *("5", "when alpha is large enough families 1, 3 and 4 are one", middle == ("pivot", "static")),
        f"literally so from alpha = {low:.11f} to {rest:.11f}, where G comes to rest: the curve of G and H runs to A",
        [
            Check("squared speed of G at rest, relative", speed, 1e-12),
            Check("residual of the touching point's 44 equations", np.inf if touch is None else touch.residual, 1e-12),
        ],
    )


def _pivot_at_rest(evidence: Evidence) -> tuple[float, float]:
    """Alpha at which the pivoting motion's speed vanishes, by the secant method, and what is left of sigma."""
    condition, u = unknown_condition(REAR_SPEED, 0.0), evidence.found(_DEEP).pivoting[0]

    def carried(alpha: float, start: np.ndarray) -> np.ndarray:
        equations = Steady(evidence.bicycle, Paraboloid(alpha))
        return newton(equations, start, condition, most=_SECANT)[0]

    for alpha in np.linspace(_DEEP, 0.4, 11)[1:]:
        u = carried(float(alpha), u)
    before, here = 0.4, 0.41
    last, u = u, carried(here, u)
    for _ in range(_SECANT):
        step = -u[SIGMA] * (here - before) / (u[SIGMA] - last[SIGMA])
        before, here, last = here, here + float(step), u
        u = carried(here, u)
        if abs(step) < 1e-14 or u[SIGMA] == last[SIGMA]:
            break
    return here, abs(float(u[SIGMA]))


def _always(evidence: Evidence) -> Iterator[Line]:
    cases = {alpha: evidence.found(alpha) for alpha in evidence.cases}
    solved = [_solved(found) for found in cases.values()]
    many = "; ".join(f"{a:g}: {len(f.static)} and {len(f.pivoting)}" for a, f in cases.items())
    yield words(
        *(
            "5",
            "in the five cases there are one static equilibrium and one pivoting motion",
            all(map(_one_each, cases.values())),
        ),
        *(f"found at alpha = {many}", solved),
    )
    between = evidence.found(_BETWEEN)
    apart = [
        abs(abs(evidence.family(a, 3).points[0].unknowns) - abs(evidence.family(a, 4).points[0].unknowns)).max()
        for a in cases
    ]
    yield words(
        *("5", "in the five cases families 3 and 4 merge in the pivoting motion", max(apart) < 1e-12),
        *(f"both start in it: constants differ by at most {max(apart):.0e}", solved),
    )
    yield words(
        *("5", "there always are one static equilibrium and one pivoting motion", _one_each(between)),
        f"not between the five cases: at alpha = {_BETWEEN} {len(between.static)} static equilibria (steers "
        + ", ".join(f"{u[STEER]:.4f}" for u in between.static)
        + f") and {len(between.pivoting)} pivoting motions: continued from below, G would have a squared speed of "
        f"{_pivot_continued(evidence):.1f} rad^2/s^2",
        [_solved(between), _steers_apart(between)],
    )


def _pivot_continued(evidence: Evidence) -> float:
    u, condition = evidence.found(_DEEP).pivoting[0], unknown_condition(REAR_SPEED, 0.0)
    for alpha in np.linspace(_DEEP, _BETWEEN, 25)[1:]:
        u, _ = newton(Steady(evidence.bicycle, Paraboloid(float(alpha))), u, condition, most=_SECANT)
    return 400.0 * float(u[SIGMA])


def _steers_apart(found: Found) -> Check:
    steers = np.sort([u[STEER] for u in found.static])
    gap = float(np.diff(steers).min()) if len(steers) > 1 else np.inf
    return Check("round-off over the distance of two static equilibria", 1e-12 / gap, 1e-6)
