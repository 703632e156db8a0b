"""What `velodrome bicycle` shows."""

from __future__ import annotations

from dataclasses import fields
from math import inf

from rich.console import Console
from rich.table import Table

from ..studies import BicycleStudy
from .tables import Column, print_table

_SHOWN_SPEEDS = 11


def show_bicycle(console: Console, study: BicycleStudy) -> None:
    """Print a bicycle's parameters, canonical matrices, eigenvalues over speed and characteristic speeds."""
    source = study.source
    console.print(f"{source.name} ({source.convention})", style="bold", markup=False, highlight=False)
    table = Table(box=None, show_header=False, pad_edge=False)
    for one in fields(source.bicycle):
        deviation = source.uncertainties.get(one.name)
        value = f"{getattr(source.bicycle, one.name):.9g}"
        # A file that states no deviation of a number has 0.
        table.add_row(one.name, value, f"± {deviation:.2g}" if deviation else "")
    console.print(table)
    for line in source.bicycle.warnings():
        console.print(line, style="yellow", markup=False, soft_wrap=True)
    if source.ignored:
        console.print(f"not used: {', '.join(source.ignored)}", style="dim", markup=False, soft_wrap=True)
    console.print()
    matrices = Table("", "", "", box=None, pad_edge=False, show_header=False)
    for name in ("M", "C1", "K0", "K2"):
        for k, row in enumerate(getattr(study.matrices, name)):
            matrices.add_row(name if k == 0 else "", *(f"{value:.12g}" for value in row))
    console.print(matrices)
    console.print()
    print_table(console, _eigenvalue_columns(study))
    console.print()
    for mode, speed in (("weave", study.weave_speed), ("capsize", study.capsize_speed)):
        deviation = study.deviations.get(mode)
        spread = f" ± {deviation:.2g}" if deviation else ""
        console.print(f"{mode} speed: {'none' if speed is None else f'{speed:.12g}{spread} m/s'}", highlight=False)
    ranges = [
        f"{start:.9g} to {end:.9g}" if end < inf else f"{start:.9g} and above" for start, end in study.stable_speeds
    ]
    console.print(f"stable speeds: {'; '.join(ranges) + ' m/s' if ranges else 'none'}", highlight=False)


def _eigenvalue_columns(study: BicycleStudy) -> list[Column]:
    """Return the speeds shown and a column for each mode with its eigenvalues there [1/s]."""
    last = len(study.speeds) - 1
    places = sorted({round(k * last / (_SHOWN_SPEEDS - 1)) for k in range(_SHOWN_SPEEDS)})
    columns = [Column("speed", [f"{study.speeds[k]:g}" for k in places])]
    for mode in dict.fromkeys(study.modes):
        cells = []
        for k in places:
            values = [study.followed[k, c] for c, name in enumerate(study.modes) if name == mode]
            oscillates = len(values) == 2 and abs(values[0].imag) > 1e-9 * abs(values[0])
            shown = values[:1] if oscillates else values
            sign = " ± " if oscillates else ""
            cells.append(", ".join(f"{v.real:.4f}{f'{sign}{abs(v.imag):.4f} i' if oscillates else ''}" for v in shown))
        columns.append(Column(mode, cells))
    return columns
