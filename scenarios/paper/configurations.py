"""Section 3.3, Figure 6: the four bicycles P1 to P4."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...reference.circular import LEAN, STEER, CircularMotion, newton, rear_rate_condition
from ...reference.families import find_motions
from .evidence import Evidence
from .ledger import LedgerLine, SelfCheck, Source, Threshold, above, below, claim_line, figure_line, source

NAMES = ("P1", "P2", "P3", "P4")
_ROUND_OFF = 1e-14  # of numbers of order ten
_LARGE = 1.5  # ratio of two leans from which the larger counts as large and the smaller as small


def configuration_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the lines on Figure 6."""
    for name in NAMES:
        point, motion = evidence.figures[name], named_motion(evidence, name)
        errors = own_errors(evidence, name, motion)
        for field, what in (("lean", "lean"), ("steer", "steer"), ("front_rate", "front rate")):
            claim = f"{name} of family {point['family']}: {what}"
            solved = solved_point(evidence, name)
            yield figure_line("3.3", claim, point[field], getattr(motion, field), errors[field], solved)
    yield from _description_lines(evidence)


def solved_point(evidence: Evidence, name: str) -> Source:
    """Return the source of a printed point's motion."""
    return source(
        "the motion of the family at the rear rate, and again on the curves of a grid of starts",
        find_motions,
        own_errors,
        command=circular_command_line(evidence, name),
    )


def circular_command_line(evidence: Evidence, name: str) -> str:
    """Return the command that shows a printed point's motion."""
    point, motion = evidence.figures[name], named_motion(evidence, name)
    where = f"--alpha {point['alpha']:g} --rear-rate {motion.rear_rate:g} --family {point['family']}"
    return f"velodrome circular {where} --near={motion.lean:.2f},{motion.steer:.2f}"


def named_motion(evidence: Evidence, name: str) -> CircularMotion:
    """Return the motion of a printed point: of its family at its rear rate, the one nearest to the printed angles."""
    point = evidence.figures[name]
    rate = point["rear_rate"] if "rear_rate" in point else float(point["v"][-1])
    angles = (
        [float(point[key]) for key in ("lean", "steer")] if "lean" in point else [float(x) for x in point["v"][2:4]]
    )
    found = evidence.motions(point["alpha"], point["family"], rate)
    return min(found, key=lambda motion: np.hypot(motion.lean - angles[0], motion.steer - angles[1]))


def own_errors(evidence: Evidence, name: str, motion: CircularMotion) -> dict[str, float]:
    """Return the distances of a motion from the same motion found without families, on curves of a grid of starts."""
    point = evidence.figures[name]
    found = evidence.found(point["alpha"])
    points = np.concatenate(found.curves)
    start = points[np.hypot(points[:, LEAN] - motion.lean, points[:, STEER] - motion.steer).argmin()]
    u, _ = newton(found.equations, start, rear_rate_condition(motion.rear_rate), most=40)
    off = {
        "lean": u[LEAN] - motion.lean,
        "steer": u[STEER] - motion.steer,
        "front_rate": found.equations.motion(u).front_rate - motion.front_rate,
        "x": u[0] - motion.position[0],
        "y": u[1] - motion.position[1],
    }
    return {field: abs(float(value)) + _ROUND_OFF for field, value in off.items()}


def _description_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    one, two, three, four = (named_motion(evidence, name) for name in NAMES)
    solved = [SelfCheck("largest residual", max(m.residual for m in (one, two, three, four)), 1e-12)]
    command = " && ".join(circular_command_line(evidence, name) for name in NAMES)
    solved_motions = source("the motions P1 to P4", find_motions, command=command)

    def turns(motion: CircularMotion, left: bool) -> list[Threshold]:
        half = np.pi / 2
        if left:
            return [above("yaw rate", motion.yaw_rate, 0.0, "rad/s"), below("steer", motion.steer, half, "rad")]
        return [below("yaw rate", motion.yaw_rate, 0.0, "rad/s"), above("steer", motion.steer, half, "rad")]

    def line(claim: str, thresholds: list[Threshold], measured: str) -> LedgerLine:
        return claim_line("3.3", claim, thresholds, measured, solved_motions, solved)

    leans = [abs(m.lean) for m in (one, two, three, four)]
    yield line(
        "P1 rides anticlockwise, handlebar forward, with a small lean",
        [*turns(one, left=True), below("lean over P3's, which is called large,", leans[0] / leans[2], 1 / _LARGE)],
        f"yaw rate {one.yaw_rate:.4f}, steer {one.steer:.4f}, lean {one.lean:.4f}: {leans[0] / leans[2]:.3f} of P3's",
    )
    yield line(
        "P2 rides clockwise, handlebar reversed, with a large lean",
        [*turns(two, left=False), above("lean over P1's, which is called small,", leans[1] / leans[0], _LARGE)],
        f"yaw rate {two.yaw_rate:.4f}, steer {two.steer:.4f}, lean {two.lean:.4f}",
    )
    yield line(
        "P2's wheels rotate in opposite directions",
        [below("product of the wheels' rates", two.rear_rate * two.front_rate, 0.0, "rad^2/s^2")],
        f"rear rate {two.rear_rate:.4f}, front rate {two.front_rate:.4f}",
    )
    yield line(
        "P3 is like P1 but for a large lean",
        [*turns(three, left=True), above("lean over P1's", leans[2] / leans[0], _LARGE)],
        f"yaw rate {three.yaw_rate:.4f}, steer {three.steer:.4f}, lean {three.lean:.4f}",
    )
    radii = [float(np.hypot(*m.position[:2])) for m in (one, two, three, four)]
    yield line(
        "P4 rides clockwise, handlebar reversed, on a small circle",
        [*turns(four, left=False), below("radius over the least of the others", radii[3] / min(radii[:3]), 1.0)],
        f"yaw rate {four.yaw_rate:.4f}, steer {four.steer:.4f}; D's circle {radii[3]:.3f} m, the smallest of "
        + ", ".join(f"{radius:.3f}" for radius in radii),
    )
