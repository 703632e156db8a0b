"""Tables of numbers on pages: a row a thing, columns in one notation."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..drawing import format_numbers


@dataclass(frozen=True)
class TableColumn:
    """A column: its title, its unit (may be empty), and its cells; text is set to the left.

    Attributes
    ----------
    title, unit : str
    cells : sequence of str
    words : bool
        Whether the cells are words instead of numbers.
    """

    title: str
    unit: str
    cells: Sequence[str]
    words: bool = False


@dataclass(frozen=True)
class PageTable:
    """A table for the macro ``numbers_table`` of tables.html.

    Attributes
    ----------
    caption : str
        What it shows, and how to read it.
    head : str
        Title of the names of the rows.
    names : sequence of str
        Names of the rows; those of engines are shown with their swatches.
    columns : sequence of TableColumn
    down : frozenset of str
        Names of the rows that are set back, such as of rides that fell.
    """

    caption: str
    head: str
    names: Sequence[str]
    columns: Sequence[TableColumn]
    down: frozenset[str] = frozenset()


def format_after_upright(values: Sequence[float | None], upright: Sequence[bool], digits: int = 2) -> list[str]:
    """Format a column whose notation is that of the rides that stay up; the others have one of their own."""
    cells = [""] * len(values)
    for group in (True, False):
        chosen = [k for k, up in enumerate(upright) if up is group]
        for k, text in zip(chosen, format_numbers([values[k] for k in chosen], digits), strict=True):
            cells[k] = text
    return cells


def number_column(
    title: str,
    unit: str,
    rows: Mapping[Any, Mapping[str, Any]],
    key: str,
    digits: int = 3,
    down: Container[str] = (),
) -> TableColumn:
    """Return a column of one key of the rows' mappings in one notation; a dash stands for None.

    Parameters
    ----------
    title, unit : str
    rows : mapping
        By name or number of the row.
    key : str
    digits : int
    down : container of str
        Names of rows that do not choose the notation.
    """
    upright = [name not in down for name in rows]
    return TableColumn(title, unit, format_after_upright([row[key] for row in rows.values()], upright, digits))


def format_complex(real: float, imaginary: float, digits: int) -> str:
    """Format a complex number with a number of significant digits of each part; a real one has no second part."""
    if imaginary == 0:
        return f"{real:.{digits}g}"
    return f"{real:.{digits}g} {'+' if imaginary > 0 else '−'} {abs(imaginary):.{digits}g}i"
