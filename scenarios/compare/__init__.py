"""Two stored runs of one scenario against each other."""

from .differences import DIFFERS, TO_THE_BIT, WITHIN_ROUND_OFF, remarks
from .folders import diff, read_pair, write_diff

__all__ = ["DIFFERS", "TO_THE_BIT", "WITHIN_ROUND_OFF", "diff", "read_pair", "remarks", "write_diff"]
