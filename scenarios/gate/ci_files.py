"""Write the gate's verdicts as files for a CI service and for readers: JUnit XML, Markdown and a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from xml.etree import ElementTree

from ...reports.drawing import escape_markdown, make_printable
from ..run import library_versions
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
    title = _TITLES[find_outcome([verdict for _, verdict in verdicts])]
    lines = [f"# Drift gate: {title}", "", _describe_counts(verdicts), ""]
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


def html_page(verdicts: Verdicts, left_out: Mapping[str, str] | None = None) -> str:
    """Return the page of the verdicts; without verdicts it states that the check is not finished.

    Parameters
    ----------
    verdicts : sequence of (scenario, Verdict)
        Grouped by scenario.
    left_out : mapping of str to str, optional
        How to install engines that are not judged, by engine.

    Returns
    -------
    str
    """
    # Imported here: it loads jinja, which only this file needs.
    from ...reports.page import make_gate_page

    rows = [
        {"scenario": name} | verdict.as_json() | {"reason": make_printable(verdict.reason)}
        for name, verdict in verdicts
    ]
    told = [row for row, (_, verdict) in zip(rows, verdicts, strict=True) if verdict.told]
    title = _TITLES[find_outcome([verdict for _, verdict in verdicts])] if verdicts else "not finished"
    counts = _describe_counts(verdicts) if verdicts else ""
    return make_gate_page(title, counts, rows, told, left_out or {}, library_versions())


def _describe_counts(verdicts: Verdicts) -> str:
    """Return how many quantities hold, and how many have which other status, in a sentence."""
    found = [verdict for _, verdict in verdicts]
    held = count_held(found)
    counts = [f"{held} quantities hold" if held else "", count_statuses(found)]
    return f"{'; '.join(filter(None, counts))}."


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.6g}"
