"""The gate's verdicts in the formats of CI services."""

from __future__ import annotations

import re
from xml.etree import ElementTree

from velodrome.scenarios.gate.ci_files import html_page, junit_xml, markdown_page
from velodrome.scenarios.gate.verdict import CHANGES, NEW, Verdict, missing_verdict

HOLDS = Verdict("exudyn", "short_error", 1e-5, 1e-5, 1e-7, "holds", "1e-05 -> 1e-05, limit 1e-07")
WORSE = Verdict("mujoco-native", "max_slip", 0.2, 0.1, 1e-3, "worse", "0.1 -> 0.2, limit 0.001; step 0.002 -> 0.004")
BETTER = Verdict("mujoco-native", "max_slip", 0.1, 0.2, 1e-3, "better", "0.2 -> 0.1, limit 0.001")
CHANGE = Verdict("mujoco-native", CHANGES, None, None, None, "holds", "since the baseline: version 1.0 -> 1.1")
FIRST = Verdict("exudyn", "run", None, None, None, NEW, "no baseline yet; velodrome check --update writes one")
GONE = missing_verdict("warp", "did not run: <no> \x07 *engine* | of that name")
VERDICTS = [("q2", HOLDS), ("q2", WORSE), ("plane-circle", GONE)]


def test_junit_counts_and_names_every_failure() -> None:
    root = ElementTree.fromstring(junit_xml(VERDICTS))
    assert (root.tag, root.attrib["tests"], root.attrib["failures"]) == ("testsuites", "3", "2")
    suites = {suite.attrib["name"]: suite for suite in root}
    assert [(suite.attrib["tests"], suite.attrib["failures"]) for suite in suites.values()] == [("2", "1"), ("1", "1")]
    first, second = suites["q2"]
    assert (first.attrib["classname"], first.attrib["name"], len(first)) == ("q2.exudyn", "short_error", 0)
    (failure,) = second
    assert failure.attrib == {"type": "worse", "message": WORSE.reason}
    ((failure,),) = suites["plane-circle"]
    # What XML cannot carry is a blank, the rest comes back as it was.
    assert failure.attrib["message"] == "did not run: <no>   *engine* | of that name"


def test_markdown_puts_the_worst_first_and_shows_foreign_text_as_it_is() -> None:
    page = markdown_page(VERDICTS)
    lines = page.splitlines()
    assert lines[0] == "# Drift gate: fails"
    assert lines[2] == "1 of 3 quantities hold; 1 missing, 1 worse."
    assert lines[4].startswith("- **missing** plane-circle, warp, run: did not run: \\<no>   \\*engine\\* \\|")
    assert lines[5].startswith("- **worse** q2, mujoco-native, max_slip: 0.1 -> 0.2")
    rows = [line for line in lines if line.startswith("| ")][1:]
    assert [row.split(" | ")[-1] for row in rows] == ["missing |", "worse |", "holds |"]


def test_a_gate_that_holds_says_so() -> None:
    page = markdown_page([("q2", HOLDS)])
    assert page.startswith("# Drift gate: holds\n\n1 of 1 quantities hold.\n\n| scenario")
    page = markdown_page([("q2", HOLDS), ("q2", BETTER), ("q2", CHANGE)])
    assert page.startswith("# Drift gate: holds\n\n1 of 2 quantities hold; 1 improved.\n\n")
    assert "- **improved** q2, mujoco-native, max_slip: 0.2 -> 0.1, limit 0.001\n" in page
    assert "- q2, mujoco-native: since the baseline: version 1.0 -> 1.1\n" in page
    root = ElementTree.fromstring(junit_xml([("q2", HOLDS)]))
    assert root.attrib["failures"] == "0"


def test_a_first_baseline_is_new_and_no_fault() -> None:
    page = markdown_page([("q2", FIRST)])
    assert page.startswith("# Drift gate: no baseline yet\n\n1 new.\n\n- **new** q2, exudyn, run: no baseline yet")
    # Where something fails as well, the gate fails.
    page = markdown_page([("q2", FIRST), ("q2", WORSE)])
    assert page.startswith("# Drift gate: fails\n\n0 of 1 quantities hold; 1 worse, 1 new.")


def test_the_page_has_every_verdict_and_the_worst_first() -> None:
    page = html_page([*VERDICTS, ("plane-circle", CHANGE)], {"drake": "pip install 'velodrome[drake]'"})
    text = " ".join(re.sub(r"<[^>]*>", " ", page[page.index("<body>") :]).split())
    assert "Drift gate: fails" in text
    assert "1 of 3 quantities hold; 1 missing, 1 worse." in text
    missing = text.index("plane-circle, warp, run: missing: did not run: &lt;no&gt;")
    worse = text.index("q2, mujoco-native, max slip: worse: 0.1 -&gt; 0.2")
    assert missing < worse < text.index("plane-circle, mujoco-native: since the baseline: version 1.0 -&gt; 1.1")
    assert "drake was not judged, its library is not installed: pip install &#39;velodrome[drake]&#39;" in text
    assert "mujoco-native ✗ worse max slip 1e+02" in text  # against its limit, in the table of engines
    assert "not ridden" in text
    assert "\x07" not in page
    held = " ".join(re.sub(r"<[^>]*>", " ", html_page([("q2", HOLDS)])).split())
    assert "Drift gate: holds" in held
    assert "Every quantity of every engine is as before." in held
    assert "not come to its verdicts" in html_page([])
