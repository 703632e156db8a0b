"""Columns of numbers in one notation, so that a reader compares powers of ten at a glance."""

from __future__ import annotations

import math
from collections.abc import Sequence

ABSENT = "–"
# A column whose numbers span less than this factor, and lie in this range, is shown without powers of ten.
_LARGEST_RATIO, _LEAST, _LARGEST = 1e3, 1e-3, 1e4


def format_numbers(values: Sequence[float | None], digits: int = 2) -> list[str]:
    """Format the numbers of a column in one notation: each has at least the given number of significant digits.

    Parameters
    ----------
    values : sequence of float or None
    digits : int

    Returns
    -------
    list of str
        A dash for None, ``0`` for zero. With powers of ten if the numbers differ much in size, else with equal numbers
        of decimals.
    """
    sizes = [abs(value) for value in values if value is not None and math.isfinite(value) and value != 0]
    least, largest = min(sizes, default=1.0), max(sizes, default=1.0)
    if least >= _LEAST and largest < _LARGEST and largest < _LARGEST_RATIO * least:
        # Of a rounded number, since 0.0999 has a decimal less than its logarithm says.
        exponent = int(f"{least:.{digits - 1}e}".partition("e")[2])
        form = f".{max(digits - 1 - exponent, 0)}f"
    else:
        form = f".{digits - 1}e"
    return [ABSENT if value is None else "0" if value == 0 else format(value, form) for value in values]
