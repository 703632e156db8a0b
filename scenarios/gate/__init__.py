"""The drift gate: compare gated scenarios in every engine with committed baselines."""

from .checks import (
    check_gate,
    gate_settings,
    gated_content,
    list_bicycle_warnings,
    list_left_out,
    load_gated,
    refused_verdicts,
    update_baselines,
)
from .ci_files import UNFINISHED_JUNIT, UNFINISHED_MARKDOWN, junit_xml, markdown_page
from .exact import Exact, find_exact
from .sample import take_sample
from .verdict import ABSOLUTE, BELOW_NOISE, CHANGES, SHOWN, Verdict, judge_sample

__all__ = [
    "ABSOLUTE",
    "BELOW_NOISE",
    "CHANGES",
    "SHOWN",
    "UNFINISHED_JUNIT",
    "UNFINISHED_MARKDOWN",
    "Exact",
    "Verdict",
    "check_gate",
    "find_exact",
    "gate_settings",
    "gated_content",
    "judge_sample",
    "junit_xml",
    "list_bicycle_warnings",
    "list_left_out",
    "load_gated",
    "markdown_page",
    "refused_verdicts",
    "take_sample",
    "update_baselines",
]
