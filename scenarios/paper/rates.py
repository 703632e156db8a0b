"""Section 3.2: the range of the families' rear rates, and which of them are unbounded."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...reference.circular import Steady
from ...reference.families import FAMILIES, rear_rate_slope, trace
from .evidence import Evidence
from .fast import FlatEnd, at_angle, expand_flat, follow_flat_end, solve_flat, with_angle
from .ledger import LedgerLine, SelfCheck, above, below, claim_line, source

_NEAREST = 1e-7  # [rad] from a lean of pi/2: nearer, round-off over the distance is no longer small
_FAR = 1e4  # [rad/s] a hundred times the rates at which the families' curves are cut off
# Change of the squared rear rate times the lean's distance d from pi/2, over the last division of d by four: the error
# is of order d, times 1 over the angle's slope in d, about 10 to 100.
_LAW = 1e-4


def rate_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the line on the range of rear rates."""
    flat: list[FlatEnd] = []
    infinite: list[float] = []
    finite = []
    for alpha in evidence.cases:
        for number in FAMILIES:
            family = evidence.family(alpha, number)
            for point, end in zip((family.points[0], family.points[-1]), family.ends, strict=True):
                if end == "flat":
                    flat.append(follow_flat_end(family.equations, point.unknowns, _NEAREST))
                elif end == "fast front wheel":
                    infinite.append(_rear_share_at_infinity(family.equations, point.unknowns))
                elif end == "large circle":
                    rate = family.equations.motion(point.unknowns).rear_rate
                    finite.append(f"{rate:.2f} (alpha = {alpha:g}, family {number})")
    rising = min(_least_rate_slope(evidence, alpha) for alpha in evidence.cases)
    starts = max(float(evidence.samples(alpha, 3).rear_rate.min()) for alpha in evidence.cases)
    slowest = min((end.rear_rate for end in flat), default=np.nan)
    worst = max((end.change for end in flat), default=np.nan)
    nearest = max((end.distance for end in flat), default=np.nan)
    least = min(infinite, default=np.nan)
    yield claim_line(
        section="3.2",
        claim="rear rates of circular motions run over [0, infinity)",
        thresholds=[
            below("least rear rate of family 3, in G,", starts, 1e-6, "rad/s"),
            above("least slope of family 3's squared rear rate between its ends, on its way from G to F", rising, 0.0),
            above("least rear rate to which flat ends are followed", slowest, _FAR, "rad/s"),
            below("largest change of their squared rear rate times the lean's distance from pi/2", worst, _LAW),
        ],
        measured=f"{len(flat)} ends of families in the five cases tend to flat bicycles: followed to a distance of "
        f"{nearest:.0e} rad, rear rates of {slowest:.0f} rad/s and more, they grow like one "
        f"over its root, to {worst:.0e}: without bound, if the law that three decades show goes on; {len(infinite)} "
        "ends with a fast front wheel are solved at infinite speed itself, where weight no longer counts: there the "
        f"rear rate is {least:.4f} of the root of all squared rates, or more. Large circles end at finite "
        f"rates, here cut off: {', '.join(finite)} rad/s",
        source=source(
            "flat ends followed at fixed leans, fast ends solved at infinite speed, by equations in which rest and "
            "infinite speed are regular points",
            follow_flat_end,
            solve_flat,
            trace,
        ),
        checks=[
            evidence.residual(),
            SelfCheck("least share of the rear wheel's rate at infinite speed (must not be zero)", -least, -1e-3),
        ],
    )


def _rear_share_at_infinity(equations: Steady, unknowns: np.ndarray) -> float:
    """Return the magnitude of the rear wheel's share in the speeds at the infinitely fast motion that ends a curve."""
    chosen = with_angle(unknowns)
    chosen = solve_flat(equations, chosen, at_angle(np.pi / 2))
    return abs(expand_flat(equations, chosen).rear_speed)


def _least_rate_slope(evidence: Evidence, alpha: float) -> float:
    """Return the least slope of the squared rear rate along family 3 between its ends, in the direction of growth."""
    slopes = np.array([rear_rate_slope(point) for point in evidence.family(alpha, 3).points[1:-1]])
    return float((slopes * np.sign(slopes[-1])).min())
