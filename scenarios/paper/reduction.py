"""Section 4.1: the reduced linear system."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...reference.curve import sample_curve
from ...reference.families import FAMILIES, trace
from ...reference.stability import linearise
from ...reference.surface import Paraboloid
from .configurations import circular_command_line, named_motion
from .evidence import Evidence, families_command_line
from .ledger import LedgerLine, SelfCheck, above, below, claim_line, count_line, equals, source
from .pencil import generalised_eigenvalues, linearised_dae, number_of_finite, spurious
from .structure import GAP_ROWS, derivatives, rank

_DOUBLE_ZERO = 1e-6  # relative: a double zero splits by the square root of round-off, times the condition


def reduction_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the lines on section 4.1."""
    printed = evidence.figures["counts"]
    motion = named_motion(evidence, "Q2")
    surface, (q, qd) = Paraboloid(evidence.figures["Q2"]["alpha"]), motion.state()
    slopes = derivatives(evidence.bicycle, surface, q, qd)
    contact = slopes["p"][9:15]
    gaps = slopes["q"][GAP_ROWS] - slopes["p"][GAP_ROWS] @ np.linalg.solve(contact, slopes["q"][9:15])
    dependent, smallest = rank(gaps[:, [2, 5]])
    independent = len(q) - dependent
    solvable = [SelfCheck("round-off over the smallest singular value", 1e-12 / smallest, 1e-6)]
    command = circular_command_line(evidence, "Q2")
    ranked = source("rank of the gaps' derivatives at Q2", derivatives, rank, command=command)
    yield count_line(
        section="4.1",
        claim="seven coordinates are independent",
        printed=printed["independent_coordinates"],
        value=independent,
        measured=f"nine less {dependent}: the gaps give z and pitch from the others",
        source=ranked,
        checks=solvable,
    )
    yield count_line(
        section="4.1",
        claim="of these four are not cyclic: x and y in the heading frame, lean and steer",
        printed=printed["independent_noncyclic"],
        value=independent - 3,
        measured="seven less yaw and two wheel angles",
        source=ranked,
        checks=solvable,
    )
    reduced = linearise(evidence.bicycle, surface, q, qd)
    field, states = float(np.abs(reduced.field).max()), len(reduced.field)
    linearised = source("the reduced system at Q2", linearise, command=command)
    yield count_line(
        section="4.1",
        claim="the reduced system has seven first-order equations",
        printed=printed["reduced_states"],
        value=states,
        measured=f"X(v*) = 0 to {field:.0e} at Q2",
        source=linearised,
        checks=[SelfCheck("largest of X at Q2", field, 1e-9)],
    )
    yield _same_equilibria_line(evidence)
    singular, smallest = rank(slopes["qdd"])
    yield claim_line(
        section="4.1",
        claim="the linearised DAE's matrix E is structurally singular",
        thresholds=[below("rank of E's rows of the equations", singular, len(slopes["qdd"]))],
        measured=f"of {len(slopes['qdd'])} equations {singular} have accelerations in them",
        source=source("rank of the equations' derivatives by the accelerations", derivatives, rank, command=command),
        checks=[SelfCheck("round-off over the smallest singular value", 1e-12 / smallest, 1e-6)],
    )
    yield _spurious_line(evidence)
    yield _zero_eigenvalue_line(evidence)


def _same_equilibria_line(evidence: Evidence) -> LedgerLine:
    """Make the line on equilibria: X at motions along all families that solve the steady equations."""
    worst, many = 0.0, 0
    for alpha in evidence.cases:
        for number in FAMILIES:
            family = evidence.family(alpha, number)
            for point in family.points[:: max(1, len(family.points) // 20)]:
                q, qd = family.equations.motion(point.unknowns).state()
                x = linearise(evidence.bicycle, family.equations.surface, q, qd).field
                # Accelerations are differences of terms of the magnitude of the squared rates.
                worst, many = max(worst, float(np.abs(x).max() / (1 + np.abs(qd).max() ** 2))), many + 1
    return claim_line(
        section="4.1",
        claim="the reduced system's equilibria are the circular motions of the DAE",
        thresholds=[below("largest of X, relative to the squared rates", worst, 1e-9)],
        measured=f"at {many} motions along all families, solved from the steady equations, X(v*) = 0 to {worst:.0e}",
        source=source("the reduced vector field X at motions of all families", linearise, trace),
        checks=[evidence.residual()],
    )


def _spurious_line(evidence: Evidence) -> LedgerLine:
    """Make the line on spurious eigenvalues: those of lambda E - H against the seven of the reduced system."""
    largest, texts, extra, orders, falsely = 0.0, [], [], [], 0
    for name in ("Q1", "Q2"):
        motion, surface = named_motion(evidence, name), Paraboloid(evidence.figures[name]["alpha"])
        e, h = linearised_dae(evidence.bicycle, surface, motion)
        reduced = linearise(evidence.bicycle, surface, *motion.state()).eigenvalues
        found = generalised_eigenvalues(e, h)
        off, rest = spurious(found, reduced)
        finite = rest[np.isfinite(rest)]
        falsely += int(np.sum(np.real(finite) > 0))
        largest = max(largest, off)
        extra.append(len(rest))
        orders.append(number_of_finite(e, h))
        sizes = f", of sizes from {np.abs(finite).min():.0e} on" if len(finite) else ""
        texts.append(
            f"{name}: {len(found)} eigenvalues, {len(found) - len(rest)} of them the reduced system's, {len(rest)} "
            f"spurious: {len(finite)} returned as finite numbers{sizes}, {int(np.sum(np.real(finite) > 0))} of them as "
            "if the motion were unstable"
        )
    return claim_line(
        section="4.1",
        claim="a generalised eigenanalysis of the linearised DAE brings spurious eigenvalues",
        thresholds=[
            below("largest distance of the reduced system's seven from the pencil's nearest", largest, 1e-6, "1/s"),
            above("least number of eigenvalues beyond the seven", min(extra), 0),
            equals("finite eigenvalues that the pencil has", max(orders), 7),
        ],
        measured="; ".join(texts) + ". The pencil is of index 3 and has seven finite eigenvalues: the others are "
        "infinite, and round-off determines how many of them come out finite, and where",
        source=source(
            "eigenvalues of lambda E - H in the heading frame, 27 x 27, by the QZ method, and the rank of "
            "((H - s E)^-1 E)^3, the number of the finite ones",
            linearised_dae,
            generalised_eigenvalues,
            number_of_finite,
        ),
        checks=[SelfCheck("finite eigenvalues, Q1 less Q2", abs(orders[0] - orders[1]), 0.0)],
        kind="stability",
    )


def _zero_eigenvalue_line(evidence: Evidence) -> LedgerLine:
    worst = 0.0
    for alpha in evidence.cases:
        for number in FAMILIES:
            samples = evidence.samples(alpha, number)
            # Where the bicycle is fast, eigenvalues are known only relative to the largest.
            size = 1 + np.abs(samples.eigenvalues).max(axis=1)
            worst = max(worst, float((np.abs(samples.eigenvalues).min(axis=1) / size).max()))
    return claim_line(
        section="4.1",
        claim="the Jacobian has a zero eigenvalue everywhere: no stable motion is asymptotically stable",
        thresholds=[below("largest of the smallest eigenvalues, relative to the largest,", worst, _DOUBLE_ZERO)],
        measured=f"the smallest eigenvalue is nowhere above {worst:.0e}, relative to the largest",
        source=source("eigenvalues along all families", sample_curve, command=families_command_line(*evidence.cases)),
        checks=[evidence.residual()],
        kind="stability",
    )
