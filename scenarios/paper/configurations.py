"""Section 3.3, Figure 6: the four bicycles P1 to P4."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reference.circular import LEAN, STEER, CircularMotion, newton, rear_rate_condition
from reports.paper.ledger import Check, Line, figure, words

from .evidence import Evidence

NAMES = ("P1", "P2", "P3", "P4")
_ROUND_OFF = 1e-14  # of numbers of order ten


def configuration_lines(evidence: Evidence) -> Iterator[Line]:
    """Lines on Figure 6."""
    for name in NAMES:
        point, motion = evidence.figures[name], named_motion(evidence, name)
        errors = own_errors(evidence, name, motion)
        for field, what in (("lean", "lean"), ("steer", "steer"), ("front_rate", "front rate")):
            claim = f"{name} of family {point['family']}: {what}"
            yield figure("3.3", claim, point[field], getattr(motion, field), errors[field])
    yield from _descriptions(evidence)


def named_motion(evidence: Evidence, name: str) -> CircularMotion:
    """The motion of a printed point: of its family at its rear rate, the one nearest to the printed angles."""
    point = evidence.figures[name]
    rate = point["rear_rate"] if "rear_rate" in point else float(point["v"][-1])
    angles = (
        [float(point[key]) for key in ("lean", "steer")] if "lean" in point else [float(x) for x in point["v"][2:4]]
    )
    found = evidence.motions(point["alpha"], point["family"], rate)
    return min(found, key=lambda motion: np.hypot(motion.lean - angles[0], motion.steer - angles[1]))


def own_errors(evidence: Evidence, name: str, motion: CircularMotion) -> dict[str, float]:
    """How far the motion is from the same found without families: on the curves of a grid of starts."""
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


def _descriptions(evidence: Evidence) -> Iterator[Line]:
    one, two, three, four = (named_motion(evidence, name) for name in NAMES)
    solved = [Check("largest residual", max(m.residual for m in (one, two, three, four)), 1e-12)]
    half = np.pi / 2

    def line(claim: str, holds: bool, measured: str) -> Line:
        return words("3.3", claim, bool(holds), measured, solved)

    yield line(
        "P1 rides anticlockwise, handlebar forward, with a small lean",
        one.yaw_rate > 0 and one.steer < half and abs(one.lean) < abs(three.lean) / 2,
        f"yaw rate {one.yaw_rate:.4f}, steer {one.steer:.4f}, lean {one.lean:.4f}: less than half of P3's",
    )
    yield line(
        "P2 rides clockwise, handlebar reversed, with a large lean",
        two.yaw_rate < 0 and two.steer > half and abs(two.lean) > 1.5 * abs(one.lean),
        f"yaw rate {two.yaw_rate:.4f}, steer {two.steer:.4f}, lean {two.lean:.4f}",
    )
    yield line(
        "P2's wheels rotate in opposite directions",
        two.rear_rate * two.front_rate < 0,
        f"rear rate {two.rear_rate:.4f}, front rate {two.front_rate:.4f}",
    )
    yield line(
        "P3 is like P1 but for a large lean",
        three.yaw_rate > 0 and three.steer < half and abs(three.lean) > 1.5 * abs(one.lean),
        f"yaw rate {three.yaw_rate:.4f}, steer {three.steer:.4f}, lean {three.lean:.4f}",
    )
    radii = [float(np.hypot(*m.position[:2])) for m in (one, two, three, four)]
    yield line(
        "P4 rides clockwise, handlebar reversed, on a small circle",
        four.yaw_rate < 0 and four.steer > half and radii[3] == min(radii),
        f"yaw rate {four.yaw_rate:.4f}, steer {four.steer:.4f}; D's circle {radii[3]:.3f} m, the smallest of "
        + ", ".join(f"{radius:.3f}" for radius in radii),
    )
