"""The metrics of a run as a table: engines by quantities."""

# pandas has no type annotations.
# pyright: reportMissingTypeStubs=false

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ...engines.frames import import_pandas
from ...reports.drawing import COLUMNS, format_table, group_remarks, rank_engines
from ...reports.measure import flatten_metrics

if TYPE_CHECKING:
    import pandas as pd

# Columns of text; all others are numbers.
_TEXTS = ("ended", "adaptations", "not_finite", "inconsistent_reports")


class MetricsTable(Mapping[str, Mapping[str, Any]]):
    """Metrics of a run: a mapping from engine names to the quantities of ``metrics.json``.

    The printed table is that of `velodrome run`, with the same remarks below it. `columns` and `to_pandas` contain all
    quantities.

    Parameters
    ----------
    rows : mapping
        JSON values of the metrics by engine.
    duration : float
        Requested simulated time of the run [s].

    Examples
    --------
    >>> import velodrome
    >>> run = velodrome.run("plane-circle", engines=["mujoco-native"], duration=0.1)
    >>> list(run.metrics)
    ['reference', 'mujoco-native']
    >>> run.metrics["mujoco-native"]["position_error"]["max"] < 1e-3
    True
    """

    def __init__(self, rows: Mapping[str, Mapping[str, Any]], duration: float) -> None:
        self._rows = {name: MappingProxyType(dict(row)) for name, row in rows.items()}
        self._duration = duration

    def __getitem__(self, engine: str) -> Mapping[str, Any]:
        return self._rows[engine]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns; a quantity with parts has one column per part, such as ``position_error_max``."""
        flat = (flatten_metrics(row) for row in self._rows.values())
        return tuple(dict.fromkeys(name for row in flat for name in row))

    def column(self, name: str) -> dict[str, Any]:
        """Return one column as a mapping from engines to values; None for engines without a value.

        Parameters
        ----------
        name : str
            One of `columns`.

        Raises
        ------
        KeyError
            If no engine has such a column.
        """
        if name not in self.columns:
            raise KeyError(f"{name!r} is no column; there are {', '.join(self.columns)}")
        return {engine: flatten_metrics(row).get(name) for engine, row in self._rows.items()}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Warnings about rows: falls, early ends, and reports that contradict the coordinates."""
        ranked = {name: self._rows[name] for name in rank_engines(self._rows)}
        return tuple(group_remarks(ranked, self._duration))

    def to_pandas(self) -> pd.DataFrame:
        """Return all columns as a data frame with the engines as index.

        Missing numbers are NaN. Lists of names are joined to one text with commas.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        pandas = import_pandas()
        table = pandas.DataFrame(index=pandas.Index(list(self._rows), name="engine"))
        for name in self.columns:
            values = list(self.column(name).values())
            whole = all(isinstance(value, int) for value in values)
            kind = "object" if name in _TEXTS else "int64" if whole else "float64"
            table[name] = pandas.Series(values, index=table.index, dtype=kind)
        return table

    def __repr__(self) -> str:
        heads = [["engine", "", ""], *([*title.split(), f"[{unit}]"] for title, unit, _, _ in COLUMNS)]
        body = [[name, *cells] for name, cells in format_table(self._rows).items()]
        lines = [[head[k] for head in heads] for k in range(3)] + body
        widths = [max(len(line[k]) for line in lines) for k in range(len(heads))]
        texts = [
            "  ".join(
                [line[0].ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(line[1:], widths[1:], strict=True))]
            )
            for line in lines
        ]
        return "\n".join([text.rstrip() for text in texts] + list(self.remarks))

    def to_html(self) -> str:
        """Return the table with its remarks as HTML for notebooks."""
        heads = "".join(f"<th>{escape(title)}<br>[{escape(unit)}]</th>" for title, unit, _, _ in COLUMNS)
        rows = "".join(
            f"<tr><th>{escape(name)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
            for name, cells in format_table(self._rows).items()
        )
        remarks = "".join(f"<li>{escape(line)}</li>" for line in self.remarks)
        table = f"<table><thead><tr><th>engine</th>{heads}</tr></thead><tbody>{rows}</tbody></table>"
        return table + (f"<ul>{remarks}</ul>" if remarks else "")

    def _repr_html_(self) -> str:
        return self.to_html()
