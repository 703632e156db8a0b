"""Columns of numbers in one notation, so that a reader compares powers of ten at a glance."""

from __future__ import annotations

import math
from collections.abc import Sequence

ABSENT = "–"
# A column whose numbers span less than this factor, and lie in this range, is shown without powers of ten.
_LARGEST_RATIO, _LEAST, _LARGEST = 1e3, 1e-3, 1e4


def format_numbers(
    values: Sequence[float | None], digits: int = 2, deciding: Sequence[bool] | None = None
) -> list[str]:
    """Format the numbers of a column in one notation: each has at least the given number of significant digits.

    Parameters
    ----------
    values : sequence of float or None
    digits : int
    deciding : sequence of bool, optional
        Which of the numbers decide the notation, all by default or where none does. Another one that has too few
        digits in this notation, or more before its point than theirs may have, is shown with a power of ten.

    Returns
    -------
    list of str
        A dash for None, ``0`` for zero. With powers of ten if the numbers differ much in size, else with equal numbers
        of decimals.
    """
    ruling = [value for value, decides in zip(values, deciding or [True] * len(values), strict=True) if decides]
    sizes = _list_sizes(ruling) or _list_sizes(values)
    least, largest = min(sizes, default=1.0), max(sizes, default=1.0)
    scientific = f".{digits - 1}e"
    if not (least >= _LEAST and largest < _LARGEST and largest < _LARGEST_RATIO * least):
        return [_format_number(value, scientific) for value in values]
    # Of a rounded number, since 0.0999 has a decimal less than its logarithm says.
    exponent = int(f"{least:.{digits - 1}e}".partition("e")[2])
    form = f".{max(digits - 1 - exponent, 0)}f"
    fitting = [value is None or value == 0 or 10.0**exponent <= abs(value) < _LARGEST for value in values]
    return [
        _format_number(value, form if fits or value in ruling else scientific)
        for value, fits in zip(values, fitting, strict=True)
    ]


def _list_sizes(values: Sequence[float | None]) -> list[float]:
    """Return the sizes of numbers that can decide a notation."""
    return [abs(value) for value in values if value is not None and math.isfinite(value) and value != 0]


def _format_number(value: float | None, form: str) -> str:
    return ABSENT if value is None else "0" if value == 0 else format(value, form)
