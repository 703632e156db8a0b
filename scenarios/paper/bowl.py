"""Section 3.3: how the families change with the bowl, up to alpha = 1/5."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...reference.circular import REAR_SPEED, STEER
from ...reference.critical import reconnections
from ...reference.families import FAMILIES, trace
from ...reference.special import SpecialPoint, special_points
from .evidence import Evidence, families_command_line
from .ledger import LedgerLine, SelfCheck, above, below, claim_line, equals, source
from .profile import abscissa, curve_distance, figure_coordinates, nearest_point
from .search import search_motions

_PLANE, _SMALL, _AFTER, _DEEP = 0.0, 0.005, 0.05, 0.2
_ALIKE = 0.2  # [rad] distance of curves that count as alike in the paper's figures, which are pi/2 wide and pi high
_LITTLE = 0.02  # [rad] a hundredth of the figures' size: a small change
_NEAR = (1e-2, 1e-3)  # distances before the touching point, relative to its alpha
_TOUCHING = source(
    "where two families exchange parts: a regular root of 18 equations", reconnections, command="velodrome critical"
)
_FINE = 0.02  # step of the arc where two curves are near


def bowl_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the lines on section 3.3."""
    yield from _small_curvature_lines(evidence)
    yield from _collision_lines(evidence)
    yield from _split_lines(evidence)
    yield _role_line(evidence)


def profiles(evidence: Evidence, first: float, second: float, numbers: tuple[int, ...]) -> list[float]:
    """Compute the largest distance of each family's curves at two alphas, in the figures' coordinates [rad]."""

    def compute(number: int) -> float:
        curves = (figure_coordinates(evidence.bicycle, evidence.samples(alpha, number)) for alpha in (first, second))
        return curve_distance(*curves)

    return [evidence.once(("profiles", number, first, second), lambda n=number: compute(n)) for number in numbers]


def _join(values: list[float]) -> str:
    return ", ".join(f"{value:.3f}" for value in values)


def _alike_line(evidence: Evidence, claim: str, first: float, second: float, numbers: tuple[int, ...]) -> LedgerLine:
    """Make a line on curves that are alike: they have the same ends and lie near each other in the figures."""
    apart_by = profiles(evidence, first, second, numbers)
    alike = sum(evidence.family(first, n).ends == evidence.family(second, n).ends for n in numbers)
    what = f"families {', '.join(map(str, numbers))}"
    return claim_line(
        section="3.3",
        claim=claim,
        thresholds=[
            equals("families that end alike", alike, len(numbers)),
            below("largest distance of two curves in the figures' coordinates", max(apart_by), _ALIKE, "rad"),
        ],
        measured=f"{what}: the curves are nowhere further apart than {_join(apart_by)} rad in the figures' "
        f"coordinates and end {'alike' if alike == len(numbers) else 'differently'}; a fifth of a radian counts as "
        "alike",
        source=source(
            "the families' curves and their largest distance", profiles, command=families_command_line(first, second)
        ),
        checks=[evidence.residual((first, second))],
    )


def _small_curvature_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    found = evidence.found(_SMALL)
    static, pivoting = len(found.static), len(found.pivoting)
    whole = [evidence.residual((_PLANE, _SMALL)), evidence.searched_again(_SMALL)]
    yield claim_line(
        section="3.3",
        claim="at alpha = 1/200 there is one static equilibrium A and one pivoting motion",
        thresholds=[equals("static equilibria", static, 1), equals("pivoting motions", pivoting, 1)],
        measured=f"a grid of starts finds {static} static equilibrium and {pivoting} pivoting motion",
        source=source("static equilibria and pivoting motions", search_motions, search=found.described),
        checks=whole,
    )
    ends = [evidence.family(_SMALL, number).points[0].unknowns for number in (3, 4)]
    off = float(np.abs(np.abs(ends[0]) - np.abs(ends[1])).max())
    yield claim_line(
        section="3.3",
        claim="at alpha = 1/200 G of family 3 and H of family 4 are one motion",
        thresholds=[below("largest difference of their constants", off, 1e-12)],
        measured=f"their constants differ by {off:.0e}",
        source=source("the ends of families 3 and 4", trace, command=families_command_line(_SMALL)),
        checks=[_check_pivots(ends)],
    )
    before = evidence.found(_PLANE)
    changes = [abs(float(found.static[0][STEER] - before.static[0][STEER]))]
    changes += [abs(float(found.pivoting[0][k] - before.pivoting[0][k])) for k in (3, STEER)]
    rates = [abs(search.equations.motion(search.pivoting[0]).front_rate) for search in (before, found)]
    changes.append(float(np.ptp(abscissa(evidence.bicycle, np.array(rates)))))
    yield claim_line(
        section="3.3",
        claim="at alpha = 1/200 A and G have changed little from the plane",
        thresholds=[below("largest change in the figures' coordinates", max(changes), _LITTLE, "rad")],
        measured=f"A: steer by {changes[0]:.4f} rad; G: lean by {changes[1]:.5f}, steer by {changes[2]:.5f}, front "
        f"rate from {rates[0]:.4f} to {rates[1]:.4f}: all within {_LITTLE} rad in the figure",
        source=source("the static equilibria and pivoting motions of both", search_motions, search=found.described),
        checks=whole,
    )
    yield _alike_line(evidence, "at alpha = 1/200 the curves are very similar to the plane's", _PLANE, _SMALL, FAMILIES)


def _check_pivots(ends: list[np.ndarray]) -> SelfCheck:
    spin = max(abs(float(u[REAR_SPEED])) for u in ends)
    return SelfCheck("largest rear speed of G and H", spin, 1e-12)


def _find_cusps(evidence: Evidence, alpha: float) -> tuple[SpecialPoint, SpecialPoint] | None:
    both = evidence.special(alpha, 2, "D", _FINE), evidence.special(alpha, 4, "I", _FINE)
    return both if both[0] is not None and both[1] is not None else None  # type: ignore[return-value]


def _cusp_distance(evidence: Evidence, alpha: float) -> np.ndarray:
    """Return the vector from I to D in the figures' coordinates [rad]."""
    both = _find_cusps(evidence, alpha)
    if both is None:
        return np.full(3, np.nan)
    rows = [[abscissa(evidence.bicycle, point.front_rate), point.lean, point.steer] for point in both]
    return np.subtract(*np.array(rows, float))


def _collision_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    touch, claim = (
        evidence.touching((2, 4)),
        "at a right value of alpha cusp D of family 2 and cusp I of family 4 merge",
    )
    if touch is None:
        yield claim_line("3.3", claim, [equals("touching points", 0, 1)], "no touching point is found", _TOUCHING, [])
        return
    near = [float(np.linalg.norm(_cusp_distance(evidence, touch.alpha * (1 - share)))) for share in _NEAR]
    # The distance of two turning points that merge is proportional to the square root of alpha's distance from there.
    order = float(np.log(near[0] / near[1]) / np.log(_NEAR[0] / _NEAR[1]))
    after = _find_cusps(evidence, touch.alpha * (1 + _NEAR[0]))
    touching = [SelfCheck("residual of the touching point's equations", touch.residual, 1e-12)]
    yield claim_line(
        section="3.3",
        claim=claim,
        thresholds=[
            equals("pairs of cusps beyond the touching point", int(after is not None), 0),
            below("departure of the order of D's approach to I from 1/2", abs(order - 0.5), 0.01),
        ],
        measured=f"alpha = {touch.alpha:.11f}, lean {touch.motion.lean:.6f}, steer {touch.motion.steer:.6f}; below, D "
        f"and I are apart like its root (order {order:.4f}); above, there are none",
        source=_TOUCHING,
        checks=touching,
    )
    alphas = [_PLANE, _SMALL, 0.01, 0.015]
    distances = [float(np.linalg.norm(_cusp_distance(evidence, alpha))) for alpha in alphas]
    yield claim_line(
        section="3.3",
        claim="before that alpha families 2 and 4 approach each other as alpha grows",
        thresholds=[below("largest change of the distance from D to I", np.diff(distances).max(), 0.0, "rad")],
        measured=f"D and I are {_join(distances)} rad apart at alpha = 0, 0.005, 0.01, 0.015",
        source=source(
            "cusps D and I in the figures' coordinates", special_points, command=families_command_line(*alphas)
        ),
        checks=touching,
    )
    yield _separation_line(evidence, touching)


def _separation_line(evidence: Evidence, touching: list[SelfCheck]) -> LedgerLine:
    gaps, direction = [], np.zeros(3)
    for alpha in (_AFTER, 0.03, 0.02):
        second, fourth = (figure_coordinates(evidence.bicycle, evidence.samples(alpha, number)) for number in (2, 4))
        distances, feet = nearest_point(second, fourth)
        i = int(distances.argmin())
        gaps.append(float(distances[i]))
        direction = second[i] - feet[i]
    before = _cusp_distance(evidence, 0.015)
    angle = float(np.degrees(np.arccos(abs(direction @ before) / np.linalg.norm(direction) / np.linalg.norm(before))))
    return claim_line(
        section="3.3",
        claim="beyond that alpha they separate in another direction",
        thresholds=[
            above("least growth of the curves' least distance", -np.diff(gaps).max(), 0.0, "rad"),
            above("angle to the line from D to I before", angle, 45.0, "degrees"),
        ],
        measured=f"their least distance is {_join(gaps[::-1])} rad at alpha = 0.02, 0.03, 0.05; at 0.02 across the "
        f"line from D to I before, at {angle:.0f} degrees to it",
        source=source(
            "least distance of families 2 and 4",
            trace,
            nearest_point,
            command=families_command_line(0.02, 0.03, _AFTER),
        ),
        checks=touching,
    )


def _split_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    ends = {alpha: {n: evidence.family(alpha, n).ends for n in (2, 4)} for alpha in (_SMALL, _AFTER)}
    old, new = ends[_SMALL], ends[_AFTER]
    exchanged = [old[2][0] == new[4][1] != new[2][0], old[4][1] == new[2][0] != new[4][1]]
    whole = [evidence.residual((_SMALL, _AFTER))]
    yield claim_line(
        section="3.3",
        claim="collision and split: families 2 and 4 take new profiles by alpha = 1/20",
        thresholds=[equals("ends that have passed to the other family", sum(exchanged), 2)],
        measured=f"they have exchanged an end: 2 ran to a {old[2][0]}, runs to a {new[2][0]}; 4 ran to a {old[4][1]}, "
        f"runs to a {new[4][1]}",
        source=source("ends of families 2 and 4", trace, command=families_command_line(_SMALL, _AFTER)),
        checks=whole,
    )
    claim = "at alpha = 1/20 the profiles of families 1 and 3 have changed little from the plane"
    yield _alike_line(evidence, claim, _PLANE, _AFTER, (1, 3))
    there = {a: [evidence.special(a, 2, "D"), evidence.special(a, 4, "I")] for a in (_SMALL, _AFTER)}
    left = {alpha: sum(point is not None for point in points) for alpha, points in there.items()}
    yield claim_line(
        section="3.3",
        claim="at alpha = 1/20 the cusps D and I have disappeared",
        thresholds=[equals("cusps D and I at 1/200", left[_SMALL], 2), equals("at 1/20", left[_AFTER], 0)],
        measured="neither is found; both are at 1/200" if left[_AFTER] == 0 else "one is still there",
        source=source("extrema of the front rate", special_points, command=families_command_line(_SMALL, _AFTER)),
        checks=whole,
    )
    claim = "at alpha = 1/5 the curves are very similar to those at 1/20"
    yield _alike_line(evidence, claim, _AFTER, _DEEP, FAMILIES)


def _role_line(evidence: Evidence) -> LedgerLine:
    touches = [touch for pair in ((2, 4), (1, 3)) if (touch := evidence.touching(pair)) is not None]
    residual = max((t.residual for t in touches), default=np.inf)
    return claim_line(
        section="1",
        claim="the surface parameter merges and separates families",
        thresholds=[above("alphas at which families touch", len(touches), 0)],
        measured="; ".join(f"{' and '.join(map(str, t.families))} touch at alpha = {t.alpha:.11f}" for t in touches),
        source=_TOUCHING,
        checks=[SelfCheck("largest residual of the touching points' equations", residual, 1e-12)],
    )
