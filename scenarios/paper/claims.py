"""All lines of the ledger: every claim and printed figure of Xiong et al. (2020), compared with the print.

The ledger has lines on results, on counts and on simulations, not on what the paper says about the history of bicycle
dynamics. A line that does not hold is the paper's fault only if the measurement passes its own tests: residuals, a
second way to the same figure, a ride by the equations of motion.
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
    """Compute the ledger, in the order of the paper's sections. This takes about a minute.

    Parameters
    ----------
    progress : callable
        Called with the part being computed, the number of parts done and the number of parts.
    figures : mapping, optional
        Printed figures; the paper's by default (`velodrome.scenarios.paper.printed.read_printed`).
    bicycle : Bicycle, optional
        The benchmark's by default.

    Returns
    -------
    list of LedgerLine
    """
    evidence = Evidence(figures or read_printed(), bicycle or Bicycle())
    lines: list[LedgerLine] = []
    for done, (part, lines_of) in enumerate(PARTS.items()):
        progress(part, float(done), float(len(PARTS)))
        lines += lines_of(evidence)
    progress("done", float(len(PARTS)), float(len(PARTS)))
    # All measurements depend on the bicycle, so every line is tested by the check of the bicycle.
    model = model_check(evidence.bicycle, evidence.figures)
    return sorted((tested(line, model) for line in lines), key=lambda line: line.section)
