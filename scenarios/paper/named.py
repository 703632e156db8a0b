"""Section 3.2: the plane, its named points and limits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...reference.circular import LEAN, REAR_SPEED, STEER
from ...reference.continuation import sign_changes
from ...reference.families import FAMILIES, Family, front_rate_slope, trace
from ...reference.special import SpecialPoint, find_straight_motion, special_points
from .evidence import LONGEST_PAPER_STEP, OTHER_STEP, Evidence, families_command_line
from .ledger import LedgerLine, SelfCheck, above, below, claim_line, count_line, figure_line, source, untestable_line
from .limits import find_limit
from .model import model_check
from .search import search_motions

_SLOPE = 0.002  # error of a power law's exponent at the last lean: the correction is of the size of that lean
_LEVEL = 0.0
_ROUND_OFF = 1e-14  # of numbers of order ten
_COMMAND = families_command_line(_LEVEL)
_FOLLOWED = source("the families on the plane, followed from end to end", trace, command=_COMMAND)
_SPECIAL = source(
    "a special point, solved on the followed family and in a second way", special_points, command=_COMMAND
)
_BEYOND_CUSP = 0.1  # [rad/s] beyond the cusp D, at a front rate with several motions


def plane_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the lines on section 3.2."""
    yield from _four_families_lines(evidence)
    yield _ranges_line(evidence)
    yield from _first_family_lines(evidence)
    yield from _second_family_lines(evidence)
    yield from _third_family_lines(evidence)


def named_point(evidence: Evidence, family: int, name: str) -> tuple[SpecialPoint, dict[str, float]]:
    """Return a special point on the plane and its errors: distances from the same point found in another way.

    The other way is a second tracing; A and G, which end a curve, are solved from a grid of starts as well.
    """
    point, again = (evidence.special(_LEVEL, family, name, step) for step in (LONGEST_PAPER_STEP, OTHER_STEP))
    if point is None or again is None:
        raise ValueError(f"point {name} is not found on family {family}")
    names = ("lean", "steer", "front_rate", "rear_rate")
    error = {field: abs(getattr(point, field) - getattr(again, field)) for field in names}
    found = evidence.found(_LEVEL)
    for unknowns in {"A": found.static, "G": found.pivoting}.get(name, []):
        rate = abs(found.equations.motion(unknowns).front_rate) - abs(point.front_rate)
        offsets = {"lean": unknowns[LEAN] - point.lean, "steer": unknowns[STEER] - point.steer, "front_rate": rate}
        for field, off in offsets.items():
            error[field] = max(error[field], abs(float(off)))
    return point, {field: off + _ROUND_OFF for field, off in error.items()}


def _four_families_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    found, printed = evidence.found(_LEVEL), evidence.figures["counts"]["families"]
    whole = [evidence.residual((_LEVEL,)), evidence.searched_again(_LEVEL)]
    curves = source("all curves of circular motions, from a grid of starts", search_motions, search=found.described)
    yield count_line(
        section="3.2",
        claim="on the plane there are four families",
        printed=printed,
        value=found.families,
        measured=f"{len(found.curves)} curves from a grid of starts, one through a pivoting motion: {found.families} "
        "families",
        source=curves,
        checks=whole,
    )
    yield count_line(
        section="1",
        claim="two of the four can be merged, leaving three (Basu-Mandal et al.)",
        printed=printed - 1,
        value=len(found.curves),
        measured=f"{len(found.curves)} whole curves: 3 and 4 are one, through the pivoting motion",
        source=curves,
        checks=whole,
    )
    yield untestable_line(
        "3.2", "their families, drawn as black dots, lie on ours", "the text lacks the dots", "number"
    )


def _ranges_line(evidence: Evidence) -> LedgerLine:
    steers = np.concatenate([evidence.samples(_LEVEL, number).steer for number in FAMILIES])
    rates = np.concatenate([evidence.samples(_LEVEL, number).rear_rate for number in FAMILIES])
    return claim_line(
        section="3.2",
        claim="all four lie within a rear rate >= 0 and a steer in [0, pi]",
        thresholds=[
            above("least steer", steers.min(), 0.0, "rad"),
            below("largest steer", steers.max(), np.pi, "rad"),
            above("least rear rate", rates.min(), -1e-9, "rad/s"),
        ],
        measured=f"steers from {steers.min():.4f} to {steers.max():.4f}, rear rates to {rates.max():.0f} where they "
        "are cut off",
        source=_FOLLOWED,
        checks=[evidence.residual()],
    )


def _first_family_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    printed, samples = evidence.figures, evidence.samples(_LEVEL, 1)
    steer = float(samples.steer.max())
    yield claim_line(
        section="3.2",
        claim="family 1 keeps its steer below pi/2",
        thresholds=[below("largest steer", steer, np.pi / 2, "rad")],
        measured=f"largest steer {steer:.5f}, at A",
        source=_FOLLOWED,
        checks=[evidence.residual()],
    )
    static, error = named_point(evidence, 1, "A")
    yield figure_line("3.2", "A: steer", printed["A"]["steer"], static.steer, error["steer"], _SPECIAL)
    rest = max(abs(static.rear_rate), abs(static.front_rate))
    yield claim_line(
        section="3.2",
        claim="A is a static equilibrium",
        # The squared speed is zero to round-off, the speed to its square root.
        thresholds=[below("larger wheel rate", rest, 1e-6, "rad/s")],
        measured=f"wheel rates {rest:.0e}, lean {static.lean:.0e}",
        source=_SPECIAL,
        checks=[evidence.residual()],
    )
    yield from _straight_motion_lines(evidence, 1, "B")
    speed = named_point(evidence, 1, "B")[0].rear_rate * evidence.bicycle.rear_wheel_radius
    off = abs(speed - float(printed["meijaard"]["capsize_speed"]))
    yield claim_line(
        section="3.2",
        claim="B is the limit speed of upright straight motion",
        thresholds=[below("difference from the published capsize speed", off, 1e-12, "m/s")],
        measured=f"{speed:.14f} m/s, the published capsize speed to {off:.0e}",
        source=source(
            "speed at which straight motion's capsize eigenvalue is zero", find_straight_motion, command=_COMMAND
        ),
        checks=[evidence.residual()],
    )


def _straight_motion_lines(evidence: Evidence, number: int, name: str) -> Iterator[LedgerLine]:
    """Yield lines on the straight motion that large circles tend to; their front rate differs by a term in 1/R^2."""
    straight, error = named_point(evidence, number, name)
    samples = evidence.samples(_LEVEL, number)
    far = np.argsort(samples.radius)[[-1, -5]]
    weights = samples.radius[far] ** 2
    limit_rate = float((weights * samples.front_rate[far]) @ [1, -1] / (weights @ [1, -1]))
    independent = SelfCheck("against the limit of large circles", abs(limit_rate - straight.front_rate), 1e-6)
    printed = evidence.figures[name]["front_rate"]
    claim = f"{name}: front rate"
    solved = source(
        "straight motion whose capsize eigenvalue is zero, and the limit of the family's large circles",
        find_straight_motion,
        trace,
        command=_COMMAND,
    )
    yield figure_line("3.2", claim, printed, straight.front_rate, error["front_rate"] + 1e-12, solved, [independent])
    turned = "reversed, steer pi" if number == 2 else "straight ahead"
    angles = np.stack([samples.lean, samples.steer - straight.steer])[:, far] * samples.radius[far]
    # Lean and steer are odd in the curvature 1/R: the error of their first order decreases like 1/R^3.
    kept = float(np.abs(angles[:, 0] / angles[:, 1] - 1).max())
    yield claim_line(
        section="3.2",
        claim=f"{name} is upright straight motion, handlebar {turned}",
        thresholds=[below("departure of lean and steer from a law of 1/R, relative,", kept, 1e-4)],
        measured=f"the lean and the steer's distance from it fall like {abs(angles[0, 0]):.4f} m / R and "
        f"{abs(angles[1, 0]):.4f} m / R, to within {kept:.0e} on circles of {samples.radius[far[1]]:.0f} to "
        f"{samples.radius[far[0]]:.0f} m",
        source=solved,
        checks=[independent],
    )


def _second_family_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    printed, samples = evidence.figures["D"], evidence.samples(_LEVEL, 2)
    least, fastest = float(samples.steer.min()), float(samples.front_rate.max())
    whole = [evidence.residual()]
    yield claim_line(
        section="3.2",
        claim="family 2 keeps its steer above pi/2",
        thresholds=[above("least steer", least, np.pi / 2, "rad")],
        measured=f"least steer {least:.4f}",
        source=_FOLLOWED,
        checks=whole,
    )
    yield claim_line(
        section="3.2",
        claim="front rates of family 2 are always negative",
        thresholds=[below("largest front rate", fastest, 0.0, "rad/s")],
        measured=f"largest front rate {fastest:.4f}",
        source=_FOLLOWED,
        checks=whole,
    )
    yield from _straight_motion_lines(evidence, 2, "C")
    cusp, error = named_point(evidence, 2, "D")
    for name, what in (("lean", "lean"), ("steer", "steer"), ("front_rate", "front rate")):
        yield figure_line("3.2", f"D: {what}", printed[name], getattr(cusp, name), error[name], _SPECIAL)
    rate = cusp.front_rate - _BEYOND_CUSP
    crossings = len(sign_changes(samples.front_rate - rate))
    yield claim_line(
        section="3.2",
        claim="around the cusp D lean and steer take several values at a front rate",
        thresholds=[above(f"motions of family 2 at a front rate of {rate:.4f}", crossings, 1)],
        measured=f"{crossings} motions of family 2 at {rate:.4f}; none of that branch above {cusp.front_rate:.4f}",
        source=_FOLLOWED,
        checks=whole,
    )
    yield _limit_line(evidence.family(_LEVEL, 2), "E", 1, np.pi, -1)


def _third_family_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    printed, family = evidence.figures["G"], evidence.family(_LEVEL, 3)
    pivot, error = named_point(evidence, 3, "G")
    for name, what in (("lean", "lean"), ("steer", "steer")):
        yield figure_line("3.2", f"G: {what}", printed[name], getattr(pivot, name), error[name], _SPECIAL)
    yield figure_line(
        "3.2", "G: front rate", printed["front_rate"], abs(pivot.front_rate), error["front_rate"], _SPECIAL
    )
    found = evidence.found(_LEVEL)
    pivoting = source("the pivoting motion, from a grid of starts", search_motions, search=found.described)
    start = found.pivoting[0]
    contact = float(np.hypot(*start[10:12]))
    yield claim_line(
        section="3.2",
        claim="G turns about a vertical axis through the rear wheel's contact point",
        thresholds=[below("distance of the contact point from the axis", contact, 1e-12, "m")],
        measured=f"the contact point is {contact:.0e} m from the axis",
        source=pivoting,
        checks=[evidence.residual()],
    )
    spin = abs(float(start[REAR_SPEED]))
    yield claim_line(
        section="3.2",
        claim="at G the rear rate is nearly zero",
        thresholds=[below("share of the rear rate in all rates", spin, 1e-12)],
        measured=f"it is exactly zero: {spin:.0e}",
        source=pivoting,
        checks=[evidence.residual()],
    )
    yield _limit_line(family, "F", -1, 0.0, 1)
    yield _monotone_line(evidence, family)
    yield _agreement_line(evidence)


def _monotone_line(evidence: Evidence, family: Family) -> LedgerLine:
    """Make the line on monotony from the tangents: the front rate, the lean and the steer nowhere turn back."""
    slopes = np.array([[front_rate_slope(p), p.tangent[LEAN], p.tangent[STEER]] for p in family.points])
    # At the pivot the sign depends on the direction that is followed; all three must keep their signs.
    by_lean, by_steer = (slopes[:, [k]] * slopes[:, [0]] for k in (1, 2))
    return claim_line(
        section="3.2",
        claim="on family 3 lean and steer fall monotonically with the front rate",
        thresholds=[
            below("largest product of the slopes of lean and front rate", by_lean.max(), 0.0),
            below("largest product of the slopes of steer and front rate", by_steer.max(), 0.0),
        ],
        measured=f"at all {len(slopes)} points their derivatives by the front rate are negative; the least size of the "
        f"front rate's slope is {np.abs(slopes[:, 0]).min():.1e}",
        source=source("tangents along family 3", trace, front_rate_slope, command=_COMMAND),
        checks=[evidence.residual()],
    )


def _limit_line(family: Family, name: str, side: int, steer: float, sign: int) -> LedgerLine:
    """Make the line on E or F: the curve followed at fixed leans, whose distance from +-pi/2 is halved in each step."""
    far = find_limit(family.equations, [family.points[k].unknowns for k in (0, -1)], side)
    infinity = "-infinity" if sign < 0 else "infinity"
    corner = f"({'pi/2' if side > 0 else '-pi/2'}, {'pi' if steer else '0'}, {infinity})"
    return claim_line(
        section="3.2",
        claim=f"{name} is a limit: lean, steer and front rate tend to {corner}",
        thresholds=[
            below("departure of the rate's exponent from -1/2", abs(far.rate_exponent + 0.5), _SLOPE),
            below("departure of the steer's exponent from 1", abs(far.steer_exponent - 1), _SLOPE),
            above(f"front rate, towards {infinity},", sign * far.front_rate, 0.0, "rad/s"),
            below("distance of the extrapolated steer from its limit", abs(far.steer - steer), 1e-5, "rad"),
        ],
        measured=f"with the lean's distance d from it down to {far.distance:.1e} the front rate grows like "
        f"d^{far.rate_exponent:.4f}, to {far.front_rate:.0f}, and the steer's distance falls like "
        f"d^{far.steer_exponent:.4f}; extrapolated steer {far.steer:.6f}, circle of D {far.radius:.4f} m",
        source=source("the family followed on at fixed leans whose distance from pi/2 halves", find_limit),
        checks=[SelfCheck("largest residual on the way, relative", far.residual, 1e-12)],
    )


def _agreement_line(evidence: Evidence) -> LedgerLine:
    model = model_check(evidence.bicycle, evidence.figures)
    return claim_line(
        section="3.2",
        claim="the model agrees with Basu-Mandal et al.",
        thresholds=[below("largest difference of accelerations", model.value, model.limit, "m/s^2 or rad/s^2")],
        measured=f"accelerations of their Table 1 differ by {model.value:.0e}",
        source=source("accelerations of the state of their Table 1", model_check),
        checks=[model],
        kind="number",
    )
