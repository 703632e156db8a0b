"""The drift gate: compare gated scenarios in every engine with committed baselines."""

from .checks import (
    check_gate,
    gate_scenarios,
    gate_settings,
    gated_content,
    gated_names,
    list_bicycle_warnings,
    list_left_out,
    list_unjudged_engines,
    load_gated,
    read_baselines,
    refused_verdicts,
    update_baselines,
)
from .ci_files import UNFINISHED_JUNIT, UNFINISHED_MARKDOWN, html_page, junit_xml, markdown_page
from .exact import Exact, find_exact
from .given import GivenBaselines
from .sample import take_sample
from .verdict import (
    ABSOLUTE,
    BELOW_NOISE,
    CHANGES,
    NEW,
    SHOWN,
    Verdict,
    count_held,
    count_statuses,
    find_outcome,
    judge_sample,
    status_word,
)

__all__ = [
    "ABSOLUTE",
    "BELOW_NOISE",
    "CHANGES",
    "NEW",
    "SHOWN",
    "UNFINISHED_JUNIT",
    "UNFINISHED_MARKDOWN",
    "Exact",
    "GivenBaselines",
    "Verdict",
    "check_gate",
    "count_held",
    "count_statuses",
    "find_exact",
    "find_outcome",
    "gate_scenarios",
    "gate_settings",
    "gated_content",
    "gated_names",
    "html_page",
    "judge_sample",
    "junit_xml",
    "list_bicycle_warnings",
    "list_left_out",
    "list_unjudged_engines",
    "load_gated",
    "markdown_page",
    "read_baselines",
    "refused_verdicts",
    "status_word",
    "take_sample",
    "update_baselines",
]
