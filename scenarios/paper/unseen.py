"""Claims that the available text of the paper does not contain, or that cannot be measured."""

from __future__ import annotations

from collections.abc import Iterator

from .evidence import Evidence
from .ledger import LedgerLine, untestable_line


def unseen_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield lines on claims that cannot be tested, with the reason."""
    yield untestable_line(
        section="1",
        claim="on a curved surface no closed set of ordinary differential equations can be obtained",
        why="a statement on what elimination by hand or computer algebra yields, not on the motion; section 4.1 itself "
        "has seven such equations about a state",
    )
    yield untestable_line(
        section="2.1",
        claim="Table 1: the values of the 25 parameters",
        why="the text lacks the table; every line is tested by the accelerations of Basu-Mandal et al., which show "
        "that the bicycle is the benchmark's",
        kind="number",
    )
    yield untestable_line(
        section="2.3",
        claim="Equations 1 to 17 as printed",
        why="the text lacks the formulas; their number, structure and solutions are tested",
    )
    yield untestable_line(
        section="3.2",
        claim="Figures 2 to 5 and 7: the curves as drawn",
        why="the text lacks the figures; they are drawn anew by `velodrome paper --out`",
    )
    yield untestable_line(
        section="4.2",
        claim="Figures 8 and 9: the rides as drawn",
        why="the text lacks the figures; they are drawn anew by `velodrome paper --out`",
        kind="simulation",
    )
