"""Every claim and every printed figure of Xiong et al. (2020), computed and held against the print.

Claims on results, on counts and on what was simulated are lines of the ledger; what the paper tells of the
history of bicycle dynamics is not. A line that does not hold is the paper's only if the measurement passes
its own tests: residuals, a second way to the same figure, a ride by the equations of motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ...reference.bicycle import Bicycle
from .bowl import bowl_lines
from .configurations import configuration_lines
from .evidence import Evidence
from .ledger import LedgerLine, tested
from .model import model_check
from .named import plane_lines
from .orbits import orbit_lines
from .points import point_lines
from .printed import read_printed
from .rates import rate_lines
from .reduction import reduction_lines
from .rides import ride_lines
from .stability import section_lines
from .steep import steep_lines
from .structure import structure_lines
from .unseen import unseen_lines

PARTS: dict[str, Callable[[Evidence], Iterator[LedgerLine]]] = {
    "equations": structure_lines,
    "orbits": orbit_lines,
    "plane": plane_lines,
    "rates": rate_lines,
    "bowl": bowl_lines,
    "configurations": configuration_lines,
    "steep bowl": steep_lines,
    "reduction": reduction_lines,
    "Q1, Q2": point_lines,
    "stability": section_lines,
    "rides": ride_lines,
    "not testable": unseen_lines,
}


def make_ledger(
    progress: Callable[[str, float, float], None] = lambda *_: None,
    figures: Mapping[str, Any] | None = None,
    bicycle: Bicycle | None = None,
) -> list[LedgerLine]:
    """Compute the ledger, in the order of the paper's sections (a minute).

    Parameters
    ----------
    progress : callable
        Called with the part under way, the parts done and their number.
    figures : mapping, optional
        Printed figures, by default the paper's (`velodrome.scenarios.paper.printed.read_printed`).
    bicycle : Bicycle, optional
        By default the benchmark's.

    Returns
    -------
    list of Line
    """
    evidence = Evidence(figures or read_printed(), bicycle or Bicycle())
    lines: list[LedgerLine] = []
    for done, (part, lines_of) in enumerate(PARTS.items()):
        progress(part, float(done), float(len(PARTS)))
        lines += lines_of(evidence)
    progress("done", float(len(PARTS)), float(len(PARTS)))
    # Whatever is measured, it is of the bicycle that the check finds to be the right one.
    model = model_check(evidence.bicycle, evidence.figures)
    return sorted((tested(line, model) for line in lines), key=lambda line: line.section)
