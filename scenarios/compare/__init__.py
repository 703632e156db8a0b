"""Two stored runs of one scenario against each other."""

from .differences import DIFFERS, TO_THE_BIT, WITHIN_ROUND_OFF, diff_remarks
from .folders import diff_runs, read_pair, write_diff

__all__ = ["DIFFERS", "TO_THE_BIT", "WITHIN_ROUND_OFF", "diff_remarks", "diff_runs", "read_pair", "write_diff"]
