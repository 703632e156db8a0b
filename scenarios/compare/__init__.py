"""Comparison of two stored runs of one scenario."""

from .differences import DIFFERS, TO_THE_BIT, WITHIN_ROUND_OFF
from .folders import diff_runs, read_pair, record_pair, write_diff
from .markdown import diff_remarks

__all__ = [
    "DIFFERS",
    "TO_THE_BIT",
    "WITHIN_ROUND_OFF",
    "diff_remarks",
    "diff_runs",
    "read_pair",
    "record_pair",
    "write_diff",
]
