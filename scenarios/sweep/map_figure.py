"""Maps of a sweep's data set: a quantity of its runs, or the share of a status, in the cells of two fields."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from ..error import ScenarioError
from ..scenario import show_value
from .rows import COMPUTED, STATUSES, has_status

if TYPE_CHECKING:
    from ...reports.figures import MapRuns


@dataclass(frozen=True)
class MapPlot:
    """A map that ``--plot Z:X,Y`` asks for.

    Attributes
    ----------
    value : str
        A column of numbers, of which each cell shows the median, or a status such as ``fell``, of which it shows the
        share among the rides that were computed.
    x, y : str
        Fields or quantities with numbers.
    """

    value: str
    x: str
    y: str

    @property
    def share(self) -> bool:
        """Whether the cells show the share of a status."""
        return self.value in STATUSES

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the data set that the map shows."""
        return (self.x, self.y) if self.share else (self.value, self.x, self.y)

    @property
    def name(self) -> str:
        """Name of its files, without the engine and the ending."""
        return f"{self.value}-over-{self.x}-and-{self.y}".replace("/", "-")


def select_map_runs(table: pa.Table, plot: MapPlot) -> MapRuns | None:
    """Return the runs of one engine that a map is made of.

    Returns None where no run has values of both fields, or none has one of the quantity.

    Parameters
    ----------
    table : pyarrow.Table
        Rows of the engine with the columns of the plot, ``status`` and ``growth_rate``.
    plot : MapPlot

    Raises
    ------
    ScenarioError
        If a column has texts.
    """
    # Imported here, since a sweep without figures does not need matplotlib.
    from ...reports.figures import MapRuns

    x, y = _read_numbers(table, plot.x), _read_numbers(table, plot.y)
    computed = has_status(table, *COMPUTED)
    if plot.share:
        value = np.where(computed, has_status(table, plot.value), np.nan)
        if plot.value not in COMPUTED:  # of runs that broke or were refused, the share among all
            value = has_status(table, plot.value).astype(float)
    else:
        value = _read_numbers(table, plot.value)
    growth = _read_numbers(table, "growth_rate")
    stable = np.where(np.isfinite(growth), growth < 0, np.nan)
    chosen = np.isfinite(x) & np.isfinite(y)
    if not np.isfinite(value[chosen]).any():
        return None
    return MapRuns(x[chosen], y[chosen], value[chosen], stable[chosen])


def _read_numbers(table: pa.Table, name: str) -> np.ndarray:
    """Return a column as numbers, NaN where there is none; NaN everywhere if the table lacks it."""
    if name not in table.column_names:
        return np.full(table.num_rows, np.nan)
    column = table.column(name)
    if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
        raise ScenarioError(f"--plot: {show_value(name)} has no numbers; Z:X,Y needs them in all three")
    return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), float)
