"""Sections 4.2 and 5: where circular motions are Lyapunov stable."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from reference.circular import SIGMA, CircularMotion
from reference.critical import CriticalPoint, last_stable
from reference.curve import sample
from reference.families import FAMILIES
from reference.sections import SectionEnd
from reference.stability import Linearisation, growth_rate, linearise
from reference.surface import Paraboloid
from reports.paper.ledger import Check, Line, words

from .evidence import OTHER_STEP, Evidence
from .profile import abscissa
from .rides import disturbed_decay

_NEIGHBOUR = 0.05  # rad of lean and steer, of curves some 7 rad long
_SHRINKING = (0.0, 0.0025, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.025, 0.03, 0.033)
_SCAN = (0.075, 0.1, 0.15, 0.3, 0.4, 0.5, 0.6, 0.75, 0.9)
_SEARCHED = 0.05  # alpha up to which last sections are looked for closely; the scan goes on from there


def section_lines(evidence: Evidence) -> Iterator[Line]:
    """Lines on where circular motions are Lyapunov stable."""
    for alpha in evidence.cases:
        yield _stable_families(evidence, alpha)
    yield _next_to_cusps(evidence, 0.0, {2: "D", 4: "I"})
    yield _next_to_cusps(evidence, 0.005, {2: "D"})
    yield _small(evidence)
    yield _second_and_fourth(evidence)
    yield _shrinks(evidence)
    yield _none_from(evidence)
    yield _only_small(evidence)


def _width(evidence: Evidence, ends: tuple[SectionEnd, SectionEnd]) -> float:
    return float(abs(np.subtract(*(abscissa(evidence.bicycle, end.motion.front_rate) for end in ends))))


def _text(number: int, ends: tuple[SectionEnd, SectionEnd]) -> str:
    rates = " to ".join(f"{end.motion.rear_rate:.8f} ({end.cause})" for end in ends)
    return f"family {number}: rear rate {rates}"


def _stable_families(evidence: Evidence, alpha: float) -> Line:
    sections = {n: evidence.sections(alpha, n) for n in FAMILIES}
    stable = [n for n in FAMILIES if sections[n]]
    printed = [n for key, families in evidence.figures["stable_in"].items() if float(key) == alpha for n in families]
    named = ", ".join(map(str, printed)) or "none"
    least = _least_growth(evidence, alpha)
    text = "; ".join(_text(n, ends) for n in stable for ends in sections[n])
    if not stable:
        text = f"none, on the families or on any curve from a grid of starts; slowest growth {least:.4f} 1/s"
    checks = _section_checks(evidence, alpha, sections)
    # What is stable against the print must stay when it is disturbed, by the equations of motion themselves.
    for number in set(stable) - set(printed):
        for ends in sections[number]:
            checks.append(_stays(evidence, alpha, number, ends))
    holds = stable == printed and (bool(stable) or least > 0)
    return words(
        "4.2", f"at alpha = {alpha:g} stable motions are in families: {named}", holds, text, checks, "stability", named
    )


def _least_growth(evidence: Evidence, alpha: float) -> float:
    """Slowest growth on all curves at alpha, of families or from a grid of starts [1/s]."""
    found = evidence.found(alpha)
    rates = [sample(found.equations, curve[curve[:, SIGMA] >= 0]).growth_rate.min() for curve in found.curves]
    for number in FAMILIES:
        try:
            rates.append(evidence.samples(alpha, number).growth_rate.min())
        except ValueError:
            continue  # from 0.42 to 0.46 families 3 and 4 have lost the pivoting motion they begin at
    return float(min(rates))


def _stays(evidence: Evidence, alpha: float, number: int, ends: tuple[SectionEnd, SectionEnd]) -> Check:
    """A disturbed ride half-way in a section must decay as the eigenvalues say."""
    motion, reduced = _half_way(evidence, alpha, number, ends)
    decay = disturbed_decay(evidence.bicycle, Paraboloid(alpha), motion)
    slowest = growth_rate(Paraboloid(alpha), reduced.eigenvalues, motion.yaw_rate)
    what = f"family {number}: decay of a disturbed ride ({decay:.5f} 1/s) over the slowest eigenvalue's, less one"
    return Check(what, abs(decay / slowest - 1), 0.1)


def _section_checks(evidence: Evidence, alpha: float, sections: dict) -> list[Check]:
    """Ends are crossings, a second tracing has the same, and inside nothing grows."""
    checks = [evidence.residual((alpha,))]
    for number, pairs in sections.items():
        again = evidence.sections(alpha, number, OTHER_STEP)
        many = abs(len(again) - len(pairs))
        checks.append(Check(f"family {number}: sections missing from a second tracing", many, 0.0))
        for ends, same in zip(pairs, again, strict=False):
            off = max(abs(a.motion.rear_rate - b.motion.rear_rate) for a, b in zip(ends, same, strict=True))
            # Energy extrema are solved less sharply: the growth rate leaves zero there like a root.
            checks.append(Check(f"family {number}: ends against the second tracing", off, 1e-6))
            inside = _inside(evidence, alpha, number, ends)
            checks.append(Check(f"family {number}: growth rate half-way (must be negative)", inside, -1e-4))
    return checks


def _half_way(
    evidence: Evidence, alpha: float, number: int, ends: tuple[SectionEnd, SectionEnd]
) -> tuple[CircularMotion, Linearisation]:
    """The motion half-way between a section's ends."""
    rate = 0.5 * (ends[0].motion.rear_rate + ends[1].motion.rear_rate)
    lean = 0.5 * (ends[0].motion.lean + ends[1].motion.lean)
    motion = min(evidence.motions(alpha, number, rate), key=lambda m: abs(m.lean - lean))
    return motion, linearise(evidence.bicycle, Paraboloid(alpha), *motion.state())


def _inside(evidence: Evidence, alpha: float, number: int, ends: tuple[SectionEnd, SectionEnd]) -> float:
    motion, reduced = _half_way(evidence, alpha, number, ends)
    return growth_rate(Paraboloid(alpha), reduced.eigenvalues, motion.yaw_rate)


def _next_to_cusps(evidence: Evidence, alpha: float, cusps: dict[int, str]) -> Line:
    gaps = {}
    for number, name in cusps.items():
        cusp, sections = evidence.special(alpha, number, name), evidence.sections(alpha, number)
        if cusp is not None:
            ends = [end.motion for section in sections for end in section]
            gaps[name] = min([np.inf, *(float(np.hypot(m.lean - cusp.lean, m.steer - cusp.steer)) for m in ends)])
    return words(
        *("4.2", f"at alpha = {alpha:g} stable motions neighbour the cusp {' and '.join(cusps.values())}"),
        len(gaps) == len(cusps) and max(gaps.values()) < _NEIGHBOUR,
        "they begin "
        + ", ".join(f"{gap:.5f} rad from {name}" for name, gap in gaps.items())
        + "; the cusps themselves "
        "are unstable",
        [evidence.residual((alpha,))],
        "stability",
    )


def _small(evidence: Evidence) -> Line:
    widths = {}
    for alpha in evidence.cases:
        for number in FAMILIES:
            for ends in evidence.sections(alpha, number):
                widths[f"{alpha:g}, family {number}"] = _width(evidence, ends)
    largest = max(widths.values(), default=0.0)
    text = "; ".join(f"{where}: {width:.4f}" for where, width in widths.items())
    return words(
        *("4.2", "stable sections are small", largest < 0.1 * np.pi / 2),
        f"widths on the figures' abscissa, which is pi/2 long: {text}",
        [evidence.residual()],
        "stability",
    )


def _last(evidence: Evidence, number: int) -> CriticalPoint | None:
    return evidence.once(("last stable", number), lambda: last_stable(evidence.bicycle, number, _SEARCHED))


def _second_and_fourth(evidence: Evidence) -> Line:
    two, four = _last(evidence, 2), _last(evidence, 4)
    others = [n for n in (1, 3) if any(evidence.sections(alpha, n) for alpha in evidence.cases)]
    if two is None or four is None:
        return words("5", "stable sections are in families 2 and 4", False, "one of them has none", [])
    residual = Check("growth rate where the last sections vanish", max(two.residual, four.residual), 1e-9)
    return words(
        *("5", "when the curvature is very small there are stable sections in families 2 and 4", not others),
        f"in family 4 up to alpha = {four.alpha:.10f}, in family 2 up to {two.alpha:.10f}; so in both at 1/200 too",
        [residual],
        "stability",
    )


def _shrinks(evidence: Evidence) -> Line:
    holds, parts = True, []
    for number in (2, 4):
        widths = [sum(_width(evidence, e) for e in evidence.sections(a, number)) for a in _SHRINKING]
        holds = holds and widths[0] > 0 and all(b < a or a == b == 0 for a, b in pairwise(widths))
        parts.append(f"family {number}: " + ", ".join(f"{width:.4f}" for width in widths))
    return words(
        *("5", "the stable region shrinks as the curvature grows", holds),
        f"widths on the figures' abscissa at alpha = {', '.join(f'{a:g}' for a in _SHRINKING)}: {'; '.join(parts)}",
        [evidence.residual((0.0, 0.005))],
        "stability",
    )


def _none_from(evidence: Evidence) -> Line:
    start = evidence.figures["none_from"]
    alphas = sorted(alpha for alpha in {*evidence.cases, *_SCAN} if alpha >= start)
    slowest = {alpha: _least_growth(evidence, alpha) for alpha in alphas}
    last = max((point.alpha for point in (_last(evidence, n) for n in (2, 4)) if point is not None), default=np.nan)
    return words(
        *("5", f"from alpha = {start:g} on no stable section exists", min(slowest.values()) > 0 and last < start),
        f"none at {len(alphas)} alphas up to 1, slowest growth {min(slowest.values()):.4f} 1/s; the last one vanishes "
        f"at {last:.10f}",
        [Check("growth rate where it vanishes", max(p.residual for n in (2, 4) if (p := _last(evidence, n))), 1e-9)],
        "stability",
    )


def _only_small(evidence: Evidence) -> Line:
    point = _last(evidence, 2)
    if point is None:
        return words("1", "stable motions exist only on very small curvature", False, "no last one is found", [])
    curvature = 2 * point.alpha
    return words(
        *("1", "stable motions exist only on very small curvature", curvature * evidence.bicycle.wheelbase < 0.1),
        f"up to a curvature of {curvature:.6f} 1/m at the bottom: a radius of {1 / curvature:.1f} m, "
        f"{1 / curvature / evidence.bicycle.wheelbase:.0f} wheelbases",
        [Check("growth rate where the last section vanishes", point.residual, 1e-9)],
        "stability",
    )
