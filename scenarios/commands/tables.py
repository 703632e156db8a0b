"""Tables for terminals of any width: columns that do not fit stand in a further table below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rich.cells import cell_len
from rich.console import Console
from rich.segment import Segments
from rich.table import Table
from rich.text import Text


@dataclass(frozen=True)
class Column:
    """Column of a table.

    Attributes
    ----------
    title : str
        Title, of one or several lines.
    cells : sequence of str or Text
        A cell for each row, of one line.
    unit : str
        Unit, shown below the title.
    right : bool
        Whether the cells are aligned to the right, as numbers are.
    """

    title: str
    cells: Sequence[str | Text]
    unit: str = ""
    right: bool = True

    @property
    def width(self) -> int:
        """Number of letters of the widest line."""
        lines = [*self.title.split("\n"), self.unit, *map(str, self.cells)]
        return max(map(cell_len, lines))


def print_table(console: Console, columns: Sequence[Column], keys: int = 1, gap: int = 2) -> None:
    """Print columns as one table, or as several tables one below the other where they are too wide.

    No name and no number is cut or broken over lines at any width; a line is longer than the terminal only where the
    keys and a single further column do not fit.

    Parameters
    ----------
    console : Console
    columns : sequence of Column
        Columns with equal numbers of cells.
    keys : int
        Number of leading columns that tell the rows apart; every table begins with them.
    gap : int
        Number of spaces between two columns.
    """
    leading, further = columns[:keys], columns[keys:]
    room = console.width - sum(column.width + gap for column in leading)
    for part in _split_columns(further, room, gap):
        table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0))
        for column in (*leading, *part):
            header = Text(column.title)
            if column.unit:
                header.append("\n").append(column.unit, "dim")
            table.add_column(header, justify="right" if column.right else "left", no_wrap=True)
        for row in zip(*(column.cells for column in (*leading, *part)), strict=True):
            # Brackets in a name are no markup.
            table.add_row(*(Text(cell) if isinstance(cell, str) else cell for cell in row))
        # Made at its own width, since rich cuts columns of a table that is wider than the terminal.
        whole = sum(column.width + gap for column in (*leading, *part))
        options = console.options.update_width(max(whole, console.width))
        console.print(Segments(console.render(table, options)), crop=False)


def _split_columns(columns: Sequence[Column], room: int, gap: int) -> Iterator[Sequence[Column]]:
    """Split columns into parts that fit the room, each with one column at least."""
    part: list[Column] = []
    used = 0
    for column in columns:
        if part and used + gap + column.width > room:
            yield part
            part, used = [], 0
        used += column.width + (gap if part else 0)
        part.append(column)
    yield part
