"""Section 4.1: the reduced linear system."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reference.families import FAMILIES
from reference.stability import linearise
from reference.surface import Paraboloid
from reports.paper.ledger import Check, Line, count, words

from .configurations import named_motion
from .evidence import Evidence
from .structure import GAP_ROWS, derivatives, rank

_DOUBLE_ZERO = 1e-6  # relative: two zeros that meet split by the root of round-off, times the condition


def reduction_lines(evidence: Evidence) -> Iterator[Line]:
    """Lines on section 4.1."""
    printed = evidence.figures["counts"]
    motion = named_motion(evidence, "Q2")
    surface, (q, qd) = Paraboloid(evidence.figures["Q2"]["alpha"]), motion.state()
    slopes = derivatives(evidence.bicycle, surface, q, qd)
    contact = slopes["p"][9:15]
    gaps = slopes["q"][GAP_ROWS] - slopes["p"][GAP_ROWS] @ np.linalg.solve(contact, slopes["q"][9:15])
    dependent, smallest = rank(gaps[:, [2, 5]])
    independent = len(q) - dependent
    solvable = [Check("round-off over the smallest singular value", 1e-12 / smallest, 1e-6)]
    yield count(
        *("4.1", "seven coordinates are independent", printed["independent_coordinates"], independent),
        *(f"nine less {dependent}: the gaps give z and pitch from the others", solvable),
    )
    four = independent - 3
    claim = "of these four are not cyclic: x and y in the heading frame, lean and steer"
    yield count("4.1", claim, printed["independent_noncyclic"], four, "seven less yaw and two wheel angles", solvable)
    reduced = linearise(evidence.bicycle, surface, q, qd)
    field, states = float(np.abs(reduced.field).max()), len(reduced.field)
    yield count(
        *("4.1", "the reduced system has seven first-order equations", printed["reduced_states"], states),
        *(f"X(v*) = 0 to {field:.0e} at Q2", [Check("largest of X at Q2", field, 1e-9)]),
    )
    singular, smallest = rank(slopes["qdd"])
    yield words(
        *("4.1", "the linearised DAE's matrix E is structurally singular", singular < len(slopes["qdd"])),
        f"of {len(slopes['qdd'])} equations {singular} have accelerations in them",
        [Check("round-off over the smallest singular value", 1e-12 / smallest, 1e-6)],
    )
    yield _zero_everywhere(evidence)


def _zero_everywhere(evidence: Evidence) -> Line:
    worst = 0.0
    for alpha in evidence.cases:
        for number in FAMILIES:
            samples = evidence.samples(alpha, number)
            # Where the bicycle is fast, eigenvalues are known relative to the largest only.
            size = 1 + np.abs(samples.eigenvalues).max(axis=1)
            worst = max(worst, float((np.abs(samples.eigenvalues).min(axis=1) / size).max()))
    return words(
        *(
            "4.1",
            "the Jacobian has a zero eigenvalue everywhere: no stable motion is asymptotically stable",
        ),
        *(worst < _DOUBLE_ZERO, f"the smallest eigenvalue is nowhere above {worst:.0e}, relative to the largest"),
        [evidence.residual()],
        "stability",
    )
