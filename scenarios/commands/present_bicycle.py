"""Terminal output of `velodrome bicycle`."""

from __future__ import annotations

from dataclasses import fields
from math import inf

from rich.console import Console
from rich.table import Table

from ..scenario import PARAMETERS
from ..studies import BicycleStudy
from .tables import Column, print_table
from .terminal import print_words

_SHOWN_SPEEDS = 11


def show_bicycle(console: Console, study: BicycleStudy) -> None:
    """Print a bicycle's parameters, canonical matrices, eigenvalues over speed and characteristic speeds."""
    source = study.source
    console.print(f"{source.name} ({source.convention})", style="bold", markup=False)
    table = Table(box=None, show_header=False, pad_edge=False)
    for parameter in fields(source.bicycle):
        deviation = source.uncertainties.get(parameter.name)
        value = f"{getattr(source.bicycle, parameter.name):.9g}"
        # A file that states no deviation of a number has 0.
        unit = PARAMETERS[parameter.name].unit
        table.add_row(parameter.name, value, f"± {deviation:.2g}" if deviation else "", unit)
    console.print(table)
    for line in source.bicycle.warnings():
        print_words(console, line, "yellow")
    if source.ignored:
        print_words(console, f"not used: {', '.join(source.ignored)}", "dim")
    console.print()
    matrices = Table("", "", "", box=None, pad_edge=False, show_header=False)
    for name in ("M", "C1", "K0", "K2"):
        for k, row in enumerate(getattr(study.matrices, name)):
            matrices.add_row(name if k == 0 else "", *(f"{value:.12g}" for value in row))
    console.print(matrices)
    console.print()
    print_table(console, _make_eigenvalue_columns(study))
    console.print()
    if study.matrices.steer_damping:
        console.print(f"steer damping: {study.matrices.steer_damping:g} N m s/rad")
    for mode, speed in (("weave", study.weave_speed), ("capsize", study.capsize_speed)):
        deviation = study.deviations.get(mode)
        spread = f" ± {deviation:.2g}" if deviation else ""
        console.print(f"{mode} speed: {'none' if speed is None else f'{speed:.12g}{spread} m/s'}")
    ranges = [
        f"{start:.9g} to {end:.9g}" if end < inf else f"{start:.9g} and above" for start, end in study.stable_speeds
    ]
    console.print(f"stable speeds: {'; '.join(ranges) + ' m/s' if ranges else 'none'}")


def _make_eigenvalue_columns(study: BicycleStudy) -> list[Column]:
    """Make a column of some of the speeds and one column per mode, with its eigenvalues there [1/s]."""
    last = len(study.speeds) - 1
    places = sorted({round(k * last / (_SHOWN_SPEEDS - 1)) for k in range(_SHOWN_SPEEDS)})
    columns = [Column("speed", [f"{study.speeds[k]:g}" for k in places], "m/s")]
    for mode in dict.fromkeys(study.modes):
        cells = []
        for k in places:
            values = [study.followed[k, c] for c, name in enumerate(study.modes) if name == mode]
            if len(values) == 2 and _is_complex(values[0]) and values[1] == values[0].conjugate():
                cells.append(_format_eigenvalue(values[0], sign="±"))
            else:
                # Capsize and castering may be a pair as well: each then shows its half.
                cells.append(", ".join(_format_eigenvalue(value) for value in values))
        columns.append(Column(mode, cells, "1/s"))
    return columns


def _is_complex(value: complex) -> bool:
    return abs(value.imag) > 1e-9 * abs(value)


def _format_eigenvalue(value: complex, sign: str | None = None) -> str:
    """Format an eigenvalue [1/s]; with a sign of its imaginary part if another than its own is to be shown."""
    if not _is_complex(value):
        return f"{value.real:.4f}"
    return f"{value.real:.4f} {sign or ('+' if value.imag > 0 else '-')} {abs(value.imag):.4f}i"
