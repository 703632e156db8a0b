"""Sections 4.2 and 5: where circular motions are Lyapunov stable."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ...reference.circular import SIGMA, CircularMotion
from ...reference.critical import CriticalPoint, last_stable
from ...reference.curve import sample_curve
from ...reference.families import FAMILIES
from ...reference.sections import SectionEnd, stable_sections
from ...reference.special import special_points
from ...reference.stability import Linearisation, growth_rate, linearise
from ...reference.surface import Paraboloid
from .evidence import OTHER_STEP, Evidence, families_command_line
from .ledger import LedgerLine, SelfCheck, Source, Threshold, above, below, claim_line, equals, source
from .profile import abscissa
from .rides import disturbed_decay

_NEIGHBOUR = 0.05  # [rad] in lean and steer, of curves about 7 rad long
_SHRINKING = (0.0, 0.0025, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.025, 0.03, 0.033)
_SCAN = (0.075, 0.1, 0.15, 0.3, 0.4, 0.5, 0.6, 0.75, 0.9)
_VANISHING = source("where the last stable section of a family vanishes", last_stable, command="velodrome critical")
_SEARCHED = 0.05  # alpha up to which the last sections are searched for closely; the scan continues from there


def section_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the lines on where circular motions are Lyapunov stable."""
    for alpha in evidence.cases:
        yield _stable_families_line(evidence, alpha)
    yield _next_to_cusps_line(evidence, 0.0, {2: "D", 4: "I"})
    yield _next_to_cusps_line(evidence, 0.005, {2: "D"})
    yield _small_line(evidence)
    yield _second_and_fourth_line(evidence)
    yield _shrinks_line(evidence)
    yield _none_from_line(evidence)
    yield _only_small_line(evidence)


def _section_width(evidence: Evidence, ends: tuple[SectionEnd, SectionEnd]) -> float:
    return float(abs(np.subtract(*(abscissa(evidence.bicycle, end.motion.front_rate) for end in ends))))


def _describe_section(number: int, ends: tuple[SectionEnd, SectionEnd]) -> str:
    rates = " to ".join(f"{end.motion.rear_rate:.8f} ({end.cause})" for end in ends)
    return f"family {number}: rear rate {rates}"


def _stable_families_line(evidence: Evidence, alpha: float) -> LedgerLine:
    sections = {n: evidence.sections(alpha, n) for n in FAMILIES}
    stable = [n for n in FAMILIES if sections[n]]
    printed = [n for key, families in evidence.figures["stable_in"].items() if float(key) == alpha for n in families]
    named = ", ".join(map(str, printed)) or "none"
    least = _least_growth(evidence, alpha)
    text = "; ".join(_describe_section(n, ends) for n in stable for ends in sections[n])
    if not stable:
        text = f"none, on the families or on any curve from a grid of starts; slowest growth {least:.4f} 1/s"
    checks = [*_section_checks(evidence, alpha, sections), evidence.searched_again(alpha)]
    # Sections that are stable against the print must remain so under a disturbance, by the equations of motion.
    for number in set(stable) - set(printed):
        checks += [_check_disturbed_ride(evidence, alpha, number, ends) for ends in sections[number]]
    thresholds: list[Threshold] = [
        equals(
            f"family {number}: whether it has a stable section (0, 1)", int(number in stable), int(number in printed)
        )
        for number in FAMILIES
    ]
    if not stable:
        thresholds.append(above("slowest growth on all curves", least, 0.0, "1/s"))
    return claim_line(
        section="4.2",
        claim=f"at alpha = {alpha:g} stable motions are in families: {named}",
        thresholds=thresholds,
        measured=text,
        source=source(
            "stable sections of all families, their ends solved for, and the growth on all curves",
            stable_sections,
            sample_curve,
            command=families_command_line(alpha),
            search=evidence.found(alpha).described,
        ),
        checks=checks,
        kind="stability",
        printed=named,
    )


def _least_growth(evidence: Evidence, alpha: float) -> float:
    """Return the smallest growth rate on all curves at alpha, of families or from a grid of starts [1/s]."""
    found = evidence.found(alpha)
    rates = [sample_curve(found.equations, curve[curve[:, SIGMA] >= 0]).growth_rate.min() for curve in found.curves]
    for number in FAMILIES:
        try:
            rates.append(evidence.samples(alpha, number).growth_rate.min())
        except ValueError:
            continue  # from 0.42 to 0.46 families 3 and 4 have no pivoting motion to begin at
    return float(min(rates))


def _check_disturbed_ride(
    evidence: Evidence, alpha: float, number: int, ends: tuple[SectionEnd, SectionEnd]
) -> SelfCheck:
    """Check that a disturbed ride half-way in a section decays as the eigenvalues predict."""
    motion, reduced = _half_way(evidence, alpha, number, ends)
    decay = disturbed_decay(evidence.bicycle, Paraboloid(alpha), motion)
    slowest = growth_rate(Paraboloid(alpha), reduced.eigenvalues, motion.yaw_rate)
    what = f"family {number}: decay of a disturbed ride ({decay:.5f} 1/s) over the slowest eigenvalue's, less one"
    return SelfCheck(what, abs(decay / slowest - 1), 0.1)


def _section_checks(evidence: Evidence, alpha: float, sections: dict) -> list[SelfCheck]:
    """Check that ends are crossings, that a second tracing has the same ones, and that inside nothing grows."""
    checks = [evidence.residual((alpha,))]
    for number, pairs in sections.items():
        again = evidence.sections(alpha, number, OTHER_STEP)
        many = abs(len(again) - len(pairs))
        checks.append(SelfCheck(f"family {number}: sections missing from a second tracing", many, 0.0))
        for ends, same in zip(pairs, again, strict=False):
            off = max(abs(a.motion.rear_rate - b.motion.rear_rate) for a, b in zip(ends, same, strict=True))
            # Energy extrema are less accurate: there the growth rate leaves zero like a square root.
            checks.append(SelfCheck(f"family {number}: ends against the second tracing", off, 1e-6))
            inside = _growth_half_way(evidence, alpha, number, ends)
            checks.append(SelfCheck(f"family {number}: growth rate half-way (must be negative)", inside, -1e-4))
    return checks


def _half_way(
    evidence: Evidence, alpha: float, number: int, ends: tuple[SectionEnd, SectionEnd]
) -> tuple[CircularMotion, Linearisation]:
    """Return the motion half-way between a section's ends and its linearisation."""
    rate = 0.5 * (ends[0].motion.rear_rate + ends[1].motion.rear_rate)
    lean = 0.5 * (ends[0].motion.lean + ends[1].motion.lean)
    motion = min(evidence.motions(alpha, number, rate), key=lambda m: abs(m.lean - lean))
    return motion, linearise(evidence.bicycle, Paraboloid(alpha), *motion.state())


def _growth_half_way(evidence: Evidence, alpha: float, number: int, ends: tuple[SectionEnd, SectionEnd]) -> float:
    motion, reduced = _half_way(evidence, alpha, number, ends)
    return growth_rate(Paraboloid(alpha), reduced.eigenvalues, motion.yaw_rate)


def _next_to_cusps_line(evidence: Evidence, alpha: float, cusps: dict[int, str]) -> LedgerLine:
    gaps = {}
    for number, name in cusps.items():
        cusp, sections = evidence.special(alpha, number, name), evidence.sections(alpha, number)
        if cusp is not None:
            ends = [end.motion for section in sections for end in section]
            gaps[name] = min([np.inf, *(float(np.hypot(m.lean - cusp.lean, m.steer - cusp.steer)) for m in ends)])
    return claim_line(
        section="4.2",
        claim=f"at alpha = {alpha:g} stable motions neighbour the cusp {' and '.join(cusps.values())}",
        thresholds=[
            equals("cusps found", len(gaps), len(cusps)),
            below(
                "largest distance of a stable section from its cusp",
                max(gaps.values(), default=np.inf),
                _NEIGHBOUR,
                "rad",
            ),
        ],
        measured="they begin "
        + ", ".join(f"{gap:.5f} rad from {name}" for name, gap in gaps.items())
        + "; the cusps themselves are unstable",
        source=source(
            "stable sections and cusps", stable_sections, special_points, command=families_command_line(alpha)
        ),
        checks=[evidence.residual((alpha,))],
        kind="stability",
    )


def _small_line(evidence: Evidence) -> LedgerLine:
    widths = {}
    for alpha in evidence.cases:
        for number in FAMILIES:
            for ends in evidence.sections(alpha, number):
                widths[f"{alpha:g}, family {number}"] = _section_width(evidence, ends)
    largest = max(widths.values(), default=0.0)
    text = "; ".join(f"{where}: {width:.4f}" for where, width in widths.items())
    return claim_line(
        section="4.2",
        claim="stable sections are small",
        thresholds=[
            below("largest width on the figures' abscissa, a tenth of its length,", largest, 0.05 * np.pi, "rad")
        ],
        measured=f"widths on the figures' abscissa, which is pi/2 long: {text}",
        source=_sections_source(evidence.cases),
        checks=[evidence.residual()],
        kind="stability",
    )


def _sections_source(alphas: tuple[float, ...]) -> Source:
    return source("stable sections of all families", stable_sections, command=families_command_line(*alphas))


def _last_section(evidence: Evidence, number: int) -> CriticalPoint | None:
    return evidence.once(("last stable", number), lambda: last_stable(evidence.bicycle, number, _SEARCHED))


def _second_and_fourth_line(evidence: Evidence) -> LedgerLine:
    two, four = _last_section(evidence, 2), _last_section(evidence, 4)
    others = [n for n in (1, 3) if any(evidence.sections(alpha, n) for alpha in evidence.cases)]
    claim = "when the curvature is very small there are stable sections in families 2 and 4"
    if two is None or four is None:
        missing = equals("families 2 and 4 with stable sections", sum(each is not None for each in (two, four)), 2)
        return claim_line("5", claim, [missing], "one of them has none", _VANISHING, [])
    residual = SelfCheck("growth rate where the last sections vanish", max(two.residual, four.residual), 1e-9)
    return claim_line(
        section="5",
        claim=claim,
        thresholds=[
            equals("other families with stable sections, in the five cases", len(others), 0),
            above("lesser alpha up to which both have one", min(two.alpha, four.alpha), 0.0, "1/m"),
        ],
        measured=f"in family 4 up to alpha = {four.alpha:.10f}, in family 2 up to {two.alpha:.10f}; so in both at "
        "1/200 too",
        source=_VANISHING,
        checks=[residual],
        kind="stability",
    )


def _shrinks_line(evidence: Evidence) -> LedgerLine:
    slowest, first, parts = np.inf, np.inf, []
    for number in (2, 4):
        widths = [sum(_section_width(evidence, e) for e in evidence.sections(a, number)) for a in _SHRINKING]
        # Where no section is left, the width cannot shrink.
        slowest = min([slowest, *(a - b for a, b in pairwise(widths) if a > 0 or b > 0)])
        first = min(first, widths[0])
        parts.append(f"family {number}: " + ", ".join(f"{width:.4f}" for width in widths))
    return claim_line(
        section="5",
        claim="the stable region shrinks as the curvature grows",
        thresholds=[
            above("lesser width on the plane", first, 0.0, "rad"),
            above("least shrinking from one alpha to the next", slowest, 0.0, "rad"),
        ],
        measured=f"widths on the figures' abscissa at alpha = {', '.join(f'{a:g}' for a in _SHRINKING)}: "
        f"{'; '.join(parts)}",
        source=_sections_source(_SHRINKING),
        checks=[evidence.residual((0.0, 0.005))],
        kind="stability",
    )


def _none_from_line(evidence: Evidence) -> LedgerLine:
    start = evidence.figures["none_from"]
    alphas = sorted(alpha for alpha in {*evidence.cases, *_SCAN} if alpha >= start)
    slowest = {alpha: _least_growth(evidence, alpha) for alpha in alphas}
    last = max(
        (point.alpha for point in (_last_section(evidence, n) for n in (2, 4)) if point is not None), default=np.nan
    )
    residual = max((p.residual for n in (2, 4) if (p := _last_section(evidence, n))), default=np.inf)
    return claim_line(
        section="5",
        claim=f"from alpha = {start:g} on no stable section exists",
        thresholds=[
            above(f"slowest growth at {len(alphas)} alphas from there on", min(slowest.values()), 0.0, "1/s"),
            below("alpha at which the last section vanishes", last, start, "1/m"),
        ],
        measured=f"none at {len(alphas)} alphas up to 1, slowest growth {min(slowest.values()):.4f} 1/s; the last one "
        f"vanishes at {last:.10f}. Between these alphas and beyond 1 nothing is proved",
        source=source(
            "growth on all curves at some alphas, and where the last section vanishes",
            sample_curve,
            last_stable,
            command="velodrome critical",
            search=evidence.found(alphas[-1]).described,
        ),
        checks=[SelfCheck("growth rate where it vanishes", residual, 1e-9)],
        kind="stability",
    )


def _only_small_line(evidence: Evidence) -> LedgerLine:
    point, claim = _last_section(evidence, 2), "stable motions exist only on very small curvature"
    if point is None:
        return claim_line("1", claim, [equals("last sections", 0, 1)], "no last one is found", _VANISHING, [])
    curvature = 2 * point.alpha
    return claim_line(
        section="1",
        claim=claim,
        thresholds=[below("largest curvature times the wheelbase", curvature * evidence.bicycle.wheelbase, 0.1)],
        measured=f"up to a curvature of {curvature:.6f} 1/m at the bottom: a radius of {1 / curvature:.1f} m, "
        f"{1 / curvature / evidence.bicycle.wheelbase:.0f} wheelbases",
        source=_VANISHING,
        checks=[SelfCheck("growth rate where the last section vanishes", point.residual, 1e-9)],
        kind="stability",
    )
