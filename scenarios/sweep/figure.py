"""Figures of a sweep's data set: any quantity of its runs over any field, with all runs in one figure."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ...engines.format_version import read_version
from ...engines.names import suggest_name
from ...reports.measure import QUANTITIES
from ..error import ScenarioError
from ..files import FigureOutput, make_folder
from ..run import read_json
from ..scenario import find_unit, show_value
from .map_figure import MapPlot, select_map_runs
from .plan import SweepPlan
from .rows import DONE, METRICS, ROW_FACTS, TIMING, has_status
from .store import MANIFEST, SWEEP_VERSION, TIMINGS, part_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...reports.figures import SweepAxis, SweepMap, SweepRuns

FIGURES = "figures"
_ANY_ENGINE = "engines.*."  # begins a key that names a setting of each engine's own
_UNITS = {"growth_rate": "1/s", "size": "m", "engine_time": "s", "task_time": "s"}  # of columns that are no metrics
_TIMES = ("cpu_time", "real_time_factor", "engine_time", "task_time")
_DIGITS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


@dataclass(frozen=True)
class SweepPlot:
    """A figure that ``--plot Y:X`` asks for.

    Attributes
    ----------
    y, x : str
        Columns of the data set; ``engines.*.KEY`` is a setting of each engine's own.
    """

    y: str
    x: str

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the data set that the figure shows."""
        return self.y, self.x

    @property
    def name(self) -> str:
        """Name of its files, without ending."""
        return f"{self.y}-over-{self.x}".replace("*", "any").replace("/", "-")


def parse_plots(texts: Iterable[str]) -> list[SweepPlot | MapPlot]:
    """Parse values of ``--plot``.

    Raises
    ------
    ScenarioError
        If one of them is neither ``Y:X`` nor ``Z:X,Y``.
    """
    plots: list[SweepPlot | MapPlot] = []
    for text in texts:
        y, colon, x = text.partition(":")
        fields = x.split(",")
        if not (y and colon and all(fields)) or ":" in x or len(fields) > 2:
            raise ScenarioError(
                f"--plot {show_value(text)}: must be Y:X, e.g. position_error_max:motion.rear_rate or "
                "position_error_max:engines.*.step, or Z:X,Y, e.g. fell:surface.alpha,motion.rear_rate"
            )
        plots.append(SweepPlot(y, x) if len(fields) == 1 else MapPlot(y, *fields))
    return plots


def check_plots(plots: Iterable[SweepPlot | MapPlot], plan: SweepPlan) -> None:
    """Refuse plots of columns that the data set of a sweep will not have, before anything runs.

    Raises
    ------
    ScenarioError
        With one line.
    """
    facts = {**ROW_FACTS, **METRICS}
    known = {*facts, *_TIMES, *plan.parameters}
    for plot in plots:
        for column in plot.columns:
            _check_column(column, known)
        for column in plot.columns if isinstance(plot, MapPlot) else (plot.y,):
            if facts.get(column) == pa.string():
                raise _refuse_texts(column)


def _check_column(column: str, known: Collection[str]) -> None:
    patterns = {f"{_ANY_ENGINE}{key.split('.', 2)[2]}" for key in known if key.startswith("engines.")}
    if column not in known and column not in patterns:
        hint = suggest_name(column, sorted({*known, *patterns}))
        raise ScenarioError(f"--plot: the sweep's rows have no {show_value(column)} ({hint})")


def read_sweep_folder(folder: Path) -> dict[str, Any]:
    """Return the manifest of a finished sweep.

    Raises
    ------
    ScenarioError
        If the folder is not of a sweep, or the sweep is not finished.
    """
    path = folder / MANIFEST
    try:
        manifest = read_json(path)
        read_version(manifest, SWEEP_VERSION)
    except FileNotFoundError as error:
        raise ScenarioError(f"{folder}: is not the folder of a sweep: it has no {MANIFEST}") from error
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise ScenarioError(f"{path}: is not of a sweep: {show_value(str(error))}") from error
    if not isinstance(manifest.get("engines"), dict) or "tasks" not in manifest:
        raise ScenarioError(f"{path}: is not of a sweep: it has no engines or no tasks")
    if not manifest.get("complete"):
        raise ScenarioError(
            f"{folder}: the sweep is not finished: run its file with --out {quote(str(folder))} --resume first"
        )
    return manifest


def write_sweep_figures(folder: Path, plots: Sequence[SweepPlot | MapPlot], output: FigureOutput) -> list[Path]:
    """Draw figures of a finished sweep from its Parquet files.

    Parameters
    ----------
    folder : Path
        The sweep's folder; the figures are written into its subfolder `FIGURES`.
    plots : sequence of SweepPlot or MapPlot
        Of a map each engine has a figure of its own.
    output : FigureOutput

    Returns
    -------
    list of Path
        Files written.

    Raises
    ------
    ScenarioError
        If the folder is not that of a finished sweep, has no such column, or a column has no numbers.
    """
    from ...reports.figures import write_formats

    manifest = read_sweep_folder(folder)
    title = str(manifest.get("title") or folder.resolve().name)
    known = {*_TIMES, *(column for engine in manifest["engines"] for column in _list_columns(folder, engine))}
    for column in (column for plot in plots for column in plot.columns):
        _check_column(column, known)
    written: list[Path] = []
    for plot in plots:
        tables = {engine: _read_table(folder, engine, plot) for engine in manifest["engines"]}
        drawings = _prepare_maps(tables, plot) if isinstance(plot, MapPlot) else {plot.name: _prepare(tables, plot)}
        make_folder(folder / FIGURES)
        for name, draw in drawings.items():
            written += write_formats(folder / FIGURES / name, partial(draw, title), output.formats, output.columns)
    return written


def _prepare(tables: Mapping[str, pa.Table], plot: SweepPlot) -> Callable[..., Figure]:
    """Return the function that draws a figure from its title and number of columns."""
    from ...reports.figures import sweep_figure

    x_axis, y_axis, runs, joined = _select_runs(tables, plot)
    return lambda title, columns: sweep_figure(title, x_axis, y_axis, runs, joined, columns)


def _prepare_maps(tables: Mapping[str, pa.Table], plot: MapPlot) -> dict[str, Callable[..., Figure]]:
    """Return the functions that draw the maps of all engines with values, by the name of their files."""
    from ...reports.figures import sweep_map_figure

    shown = _describe_map(plot, tables)
    found: dict[str, Callable[..., Figure]] = {}
    for engine, table in tables.items():
        runs = select_map_runs(table, plot)
        if runs is not None:
            name = plot.name if len(tables) == 1 else f"{plot.name}-{engine}"
            found[name] = lambda title, columns, engine=engine, runs=runs: sweep_map_figure(
                title, shown, engine, runs, columns
            )
    if not found:
        names = ", ".join(show_value(column) for column in plot.columns)
        what = "no ride was computed at points with" if plot.share else "no row of the sweep has"
        raise ScenarioError(f"--plot: {what} a value of all of {names}")
    return found


def _describe_map(plot: MapPlot, tables: Mapping[str, pa.Table]) -> SweepMap:
    from ...reports.figures import SweepMap

    value = {"fell": "share of rides that fell", "done": "share of rides that lasted"}.get(
        plot.value, f"share of rows of status {plot.value}"
    )
    if not plot.share:
        value = f"median {_make_axis(plot.value, tables, ()).title}"
    return SweepMap(_make_axis(plot.x, tables, ()), _make_axis(plot.y, tables, ()), value, plot.share)


def _list_columns(folder: Path, engine: str) -> list[str]:
    """Return the columns of an engine's rows.

    Raises
    ------
    ScenarioError
        If the file is missing or cannot be read.
    """
    with _reading(folder):
        return pq.read_schema(part_of(folder, engine)).names


def _read_table(folder: Path, engine: str, plot: SweepPlot | MapPlot) -> pa.Table:
    """Read what a figure shows of an engine's rows, in the order of the tasks.

    Of a data set of millions of rows these are a few columns; times are read only for a figure of them.

    Raises
    ------
    ScenarioError
        If a file is missing or cannot be read.
    """
    there = _list_columns(folder, engine)
    wanted = {"index", "status", "growth_rate", *(name.replace("*", engine) for name in plot.columns)}
    if isinstance(plot, SweepPlot):  # runs on a line have the fields in common that the figure does not show
        wanted |= {*there} - {*ROW_FACTS, *METRICS}
    with _reading(folder):
        table = pq.ParquetFile(part_of(folder, engine)).read(columns=[name for name in there if name in wanted])
        if wanted.isdisjoint(_TIMES):
            return table
        times = pq.read_table(folder / TIMINGS, columns=["index", *_TIMES], filters=[("engine", "=", engine)])
        return table.join(times, "index").sort_by("index")


@contextmanager
def _reading(folder: Path) -> Iterator[None]:
    """Turn errors of reading a data set into one line."""
    try:
        yield
    except (OSError, pa.ArrowException, KeyError) as error:
        raise ScenarioError(f"{folder}: its data set cannot be read: {show_value(str(error))}") from error


def _select_runs(
    tables: Mapping[str, pa.Table], plot: SweepPlot
) -> tuple[SweepAxis, SweepAxis, dict[str, SweepRuns], str]:
    """Return both axes, the runs by engine, and what the runs on a line have in common."""
    # Imported here, since a sweep without figures does not need matplotlib.
    from ...reports.figures import SweepRuns

    x, x_names = _read_values([_pick(table, plot.x, engine) for engine, table in tables.items()], plot.x, True)
    y, _ = _read_values([_pick(table, plot.y, engine) for engine, table in tables.items()], plot.y, False)
    varied = {engine: _list_varied(table, plot, engine) for engine, table in tables.items()}
    runs = {
        engine: SweepRuns(
            x=x[k],
            y=y[k],
            whole=has_status(table, DONE),
            lines=_name_lines(table, varied[engine]),
        )
        for k, (engine, table) in enumerate(tables.items())
    }
    shared = ", ".join(dict.fromkeys(key for keys in varied.values() for key in keys))
    joined = f"a line: equal {shared}" if shared else ""
    return _make_axis(plot.x, tables, x_names), _make_axis(plot.y, tables, ()), runs, joined


def _pick(table: pa.Table, column: str, engine: str) -> list[Any]:
    """Return a column's values in an engine's rows, None where it does not have it."""
    name = column.replace(_ANY_ENGINE, f"engines.{engine}.", 1) if column.startswith(_ANY_ENGINE) else column
    return table.column(name).to_pylist() if name in table.column_names else [None] * table.num_rows


def _read_values(
    columns: Sequence[Sequence[Any]], name: str, categories: bool
) -> tuple[list[np.ndarray], tuple[str, ...]]:
    """Return values as numbers, NaN for None; texts as positions in the list of those that there are.

    Raises
    ------
    ScenarioError
        If there are no values, or texts where categories are not allowed.
    """
    values = [value for column in columns for value in column if value is not None]
    if not values:
        raise ScenarioError(f"--plot: no row of the sweep has a value of {show_value(name)}")
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return [np.array([np.nan if v is None else v for v in column], float) for column in columns], ()
    if not categories:
        raise _refuse_texts(name)
    names = tuple(sorted({str(value) for value in values}))
    return [np.array([np.nan if v is None else names.index(str(v)) for v in c], float) for c in columns], names


def _refuse_texts(name: str) -> ScenarioError:
    return ScenarioError(f"--plot: {show_value(name)} has no numbers; only the X of Y:X may be text")


def _list_varied(table: pa.Table, plot: SweepPlot, engine: str) -> list[str]:
    """Return the fields beside those of the plot that differ between an engine's runs."""
    fixed = {*ROW_FACTS, *METRICS, *TIMING, *(name.replace("*", engine) for name in (plot.x, plot.y))}
    keys = [name for name in table.column_names if name not in fixed]
    return [key for key in keys if len(table.column(key).unique()) > 1]


def _name_lines(table: pa.Table, varied: Sequence[str]) -> np.ndarray:
    """Return a text for each row with the values of the varied fields."""
    columns = [table.column(key).to_pylist() for key in varied]
    units = [_write_unit(find_unit(key)) for key in varied]
    texts = [
        ", ".join(f"{key} = {_format_value(value)}{unit}" for key, value, unit in zip(varied, row, units, strict=True))
        for row in zip(*columns, strict=True)
    ]
    return np.array(texts if columns else [""] * table.num_rows)


def _format_value(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _write_unit(unit: str | None) -> str:
    """Return a unit behind a number, with exponents as such; nothing for a ratio."""
    if unit in (None, "", "1"):
        return ""
    base, *powers = str(unit).split("^")
    text = base
    for power in powers:
        digits = power[: len(power) - len(power.lstrip("-0123456789"))]
        text += digits.translate(_DIGITS) + power[len(digits) :]
    return f" {text}"


def _make_axis(column: str, tables: Mapping[str, pa.Table], names: tuple[str, ...]) -> SweepAxis:
    """Return an axis with a title of name and unit."""
    from ...reports.figures import SweepAxis

    quantity, part = (column, "") if column in QUANTITIES else column.rpartition("_")[::2]
    given = False
    if quantity in QUANTITIES and (not part or part in QUANTITIES[quantity].parts):
        words = {"max": "largest ", "end": "final "}.get(part, "") + quantity.replace("_", " ")
        unit: str | None = QUANTITIES[quantity].unit
    elif column in METRICS or column in TIMING:
        words, unit = column.replace("_", " "), _UNITS.get(column)
    else:
        keys = [column.replace("*", engine) for engine in tables] if column.startswith(_ANY_ENGINE) else [column]
        units = {find_unit(key) for key in keys} - {None}
        words, given = column.removeprefix(_ANY_ENGINE), True
        unit = units.pop() if len(units) == 1 else None
    shown = _write_unit(unit).strip()
    return SweepAxis(f"{words} [{shown}]" if shown else words, given, names)
