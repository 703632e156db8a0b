"""Write the gate's verdicts as files for a CI service: JUnit XML and Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from xml.etree import ElementTree

from ...reports.drawing import escape_markdown, make_printable
from .verdict import CHANGES, NEW, Verdict, count_held, count_statuses, find_outcome, status_word

Verdicts = Sequence[tuple[str, Verdict]]
# Order of the statuses in the Markdown page.
_WORST_FIRST = ("missing", "worse", "changed", NEW, "better", "holds", "shown")
_TITLES = {"holds": "holds", "fails": "fails", NEW: "no baseline yet"}


UNFINISHED_MARKDOWN = "# Drift gate: not finished\n\nThe check has not come to its verdicts.\n"
UNFINISHED_JUNIT = """\
<?xml version='1.0' encoding='utf-8'?>
<testsuites name="velodrome check" tests="1" failures="0" errors="1">
  <testsuite name="velodrome check" tests="1" failures="0" errors="1">
    <testcase classname="velodrome" name="check">
      <error type="unfinished" message="the check has not come to its verdicts" />
    </testcase>
  </testsuite>
</testsuites>
"""


def junit_xml(verdicts: Verdicts) -> str:
    """Return JUnit XML with a test suite per scenario and a test case per quantity of an engine.

    Parameters
    ----------
    verdicts : sequence of (scenario, Verdict)
        Grouped by scenario.

    Returns
    -------
    str
    """
    root = ElementTree.Element("testsuites", {"name": "velodrome check"} | _counts(verdicts))
    for name, group in groupby(verdicts, key=lambda item: item[0]):
        cases = list(group)
        suite = ElementTree.SubElement(root, "testsuite", {"name": name} | _counts(cases))
        for _, verdict in cases:
            case = ElementTree.SubElement(
                suite, "testcase", classname=f"{name}.{verdict.engine}", name=verdict.quantity
            )
            if not verdict.passes:
                ElementTree.SubElement(case, "failure", type=verdict.status, message=make_printable(verdict.reason))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _counts(verdicts: Verdicts) -> dict[str, str]:
    failures = sum(not verdict.passes for _, verdict in verdicts)
    return {"tests": str(len(verdicts)), "failures": str(failures), "errors": "0"}


def markdown_page(verdicts: Verdicts) -> str:
    """Return Markdown for a summary: the outcome, what moved, then all quantities, the worst first.

    Parameters
    ----------
    verdicts : sequence of (scenario, Verdict)

    Returns
    -------
    str
    """
    found = [verdict for _, verdict in verdicts]
    held = count_held(found)
    counts = [f"{held} quantities hold" if held else "", count_statuses(found)]
    title = _TITLES[find_outcome(found)]
    lines = [f"# Drift gate: {title}", "", f"{'; '.join(filter(None, counts))}.", ""]
    ordered = sorted(verdicts, key=lambda item: _WORST_FIRST.index(item[1].status))
    moved = [(name, verdict) for name, verdict in ordered if verdict.told]
    for name, verdict in moved:
        reason = escape_markdown(verdict.reason)
        who = escape_markdown(f"{name}, {verdict.engine}")
        # That the version or a setting is another is no verdict on a quantity.
        what = f"{who}" if verdict.quantity == CHANGES else f"**{status_word(verdict)}** {who}, {verdict.quantity}"
        lines.append(f"- {what}: {reason}")
    lines += [""] if moved else []
    lines += [
        "| scenario | engine | quantity | value | baseline | limit | verdict |",
        "|---|---|---|---:|---:|---:|---|",
    ]
    for name, verdict in ordered:
        numbers = (_number(value) for value in (verdict.value, verdict.baseline, verdict.limit))
        cells = (
            escape_markdown(name),
            escape_markdown(verdict.engine),
            verdict.quantity,
            *numbers,
            status_word(verdict),
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.6g}"
