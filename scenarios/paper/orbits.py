"""Section 3.1: constant and periodic quantities of a circular motion, mirrored motions, contact circles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...reference.circular import CONTACT, Steady
from ...reference.contact import observe
from ...reference.families import FAMILIES, trace
from ...reference.kinematics import FRONT_ANGLE, LEAN, PITCH, REAR_ANGLE, STEER, YAW
from ...reference.simulate import simulate
from ...reference.surface import Paraboloid
from .evidence import Evidence, families_command_line
from .ledger import LedgerLine, SelfCheck, above, below, claim_line, source
from .search import mirrored

_STEADY = (LEAN, PITCH, STEER)
_TURNS = 1.0
# The precise integrator's error is about 1e-12 a turn; the unstable Q1 multiplies it by exp(0.38 x 8) = 22.
_KEPT = 1e-9
_KEPT_FORCE = 1e-7  # [N] the same for forces of about 500 N


def orbit_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the lines on Eqs. 9-11 and on the symmetry of left and right."""
    constant, sinus, normal, turning = 0.0, 0.0, 0.0, np.inf
    for name in ("Q1", "Q2"):
        change = _measure_turn(evidence, name)
        constant, sinus = max(constant, change[0]), max(sinus, change[1])
        normal, turning = max(normal, change[2]), min(turning, change[3])
    integrated = SelfCheck("largest departure of what is constant", constant, _KEPT)
    turned = source(
        "one turn of Q1 and of Q2, integrated from the solved motion", simulate, command="velodrome run q1 q2"
    )
    yield claim_line(
        section="3.1",
        claim="z, lean, pitch, steer, wheel rates and rim angles are constant on a circular motion",
        thresholds=[below("largest change [m, rad, rad/s]", constant, _KEPT)],
        measured=f"over a turn of Q1 and of Q2, integrated, they change by at most {constant:.0e}",
        source=turned,
        checks=[integrated],
    )
    yield claim_line(
        section="3.1",
        claim="x and y vary sinusoidally, the heading grows linearly",
        thresholds=[below("largest departure [m, rad]", sinus, _KEPT)],
        measured=f"over a turn of Q1 and of Q2 the largest departure is {sinus:.0e}",
        source=turned,
        checks=[integrated],
    )
    yield claim_line(
        section="3.1",
        claim="normal multipliers are constant, the others periodic",
        thresholds=[
            below("change of the normal forces", normal, _KEPT_FORCE, "N"),
            above("change of the horizontal forces", turning, 1.0, "N"),
        ],
        measured=f"over a turn normal forces change by {normal:.0e} N, horizontal ones turn with the heading by "
        f"{turning:.0f} N",
        source=turned,
        checks=[integrated],
    )
    yield _circles_line(evidence)
    yield _mirror_line(evidence)


def _measure_turn(evidence: Evidence, name: str) -> tuple[float, float, float, float]:
    """Return change of constants, departure from the sinusoid [m, rad], change of normal and of other forces [N]."""
    point = evidence.figures[name]
    surface = Paraboloid(point["alpha"])
    motion = evidence.motions(point["alpha"], point["family"], float(point["v"][-1]))[0]
    times = np.linspace(0, _TURNS * 2 * np.pi / abs(motion.yaw_rate), 101)
    ride = simulate(evidence.bicycle, surface, *motion.state(), times)
    still = np.column_stack([ride.q[:, [2, *_STEADY]], ride.qd[:, [REAR_ANGLE, FRONT_ANGLE]], ride.contact[:, :, 2]])
    angle = motion.yaw_rate * ride.time
    x, y = motion.position[:2]
    circle = np.column_stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, angle])
    seen = observe(evidence.bicycle, surface, ride.q, ride.qd)
    normal = np.einsum("nwi,nwi->nw", ride.force, seen.normal)
    return (
        float(np.ptp(still, axis=0).max()),
        float(np.abs(ride.q[:, [0, 1, YAW]] - circle).max()),
        float(np.ptp(normal, axis=0).max()),
        float(np.ptp(ride.force[:, :, 0], axis=0).min()),
    )


def _circles_line(evidence: Evidence) -> LedgerLine:
    least = np.inf
    for alpha in evidence.cases:
        for number in FAMILIES:
            u = np.array([point.unknowns[CONTACT] for point in evidence.family(alpha, number).points])
            least = min(least, float((np.hypot(u[:, 3], u[:, 4]) - np.hypot(u[:, 0], u[:, 1])).min()))
    return claim_line(
        section="3.1",
        claim="the wheels' contact points run on two different circles",
        thresholds=[above("least difference of the circles' radii", least, 0.0, "m")],
        measured=f"along all families the front wheel's is the larger, by {least:.1e} m at least (on the largest "
        "circles)",
        source=source(
            "radii of the contact points' circles along all families",
            trace,
            command=families_command_line(*evidence.cases),
        ),
        checks=[evidence.residual()],
    )


def _mirror_line(evidence: Evidence) -> LedgerLine:
    worst = 0.0
    for alpha in evidence.cases:
        for number in FAMILIES:
            family = evidence.family(alpha, number)
            for point in family.points[::20]:
                here, there = point.unknowns, mirrored(point.unknowns)
                change = np.abs(family.equations.residual(there)).max() - np.abs(family.equations.residual(here)).max()
                worst = max(worst, float(change) / (1 + float(np.abs(here).max())))
    return claim_line(
        section="3.2",
        claim="left and right are alike: a steer in [0, pi] is enough",
        thresholds=[below("residual of mirrored motions beyond that of the motions", worst, 1e-12)],
        measured=f"mirrored motions solve the equations too: residual greater by {worst:.0e}",
        source=source("residuals of mirrored motions along all families", mirrored, Steady.residual),
        checks=[evidence.residual()],
    )
