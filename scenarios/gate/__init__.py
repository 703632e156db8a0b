"""The drift gate: compare gated scenarios in every engine with committed baselines."""

from .checks import check_gate, list_bicycle_warnings, list_left_out, refused_verdicts, update_baselines
from .ci_files import UNFINISHED_JUNIT, UNFINISHED_MARKDOWN, junit_xml, markdown_page
from .verdict import SHOWN, Verdict

__all__ = [
    "SHOWN",
    "UNFINISHED_JUNIT",
    "UNFINISHED_MARKDOWN",
    "Verdict",
    "check_gate",
    "junit_xml",
    "list_bicycle_warnings",
    "list_left_out",
    "markdown_page",
    "refused_verdicts",
    "update_baselines",
]
