"""Advice on an engine's settings, derived from the measurements of each choice, and a table of both.

A choice is one row of a study (a mapping): ``engine``, ``changed`` (settings that differ from the engine's own),
``slip`` [m/s], ``energy_rate`` and ``radius_rate`` (mappings of ``value`` and ``half_width``, or None), ``step``
and ``step_cost`` [s], ``ridden`` and ``asked`` [s], ``needs`` (a larger number needs more than the engine alone).

Choices are ranked by three numbers, the smaller the better: slip, energy lost or gained, and CPU time per simulated
second. A choice is not recommended if another one is better in one of them and worse in none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Row = Mapping[str, Any]
# Smaller ratios are ignored: CPU times repeat to about a quarter, and such a difference does not matter to users.
NOTICEABLE = 1.25


def label(row: Row) -> str:
    """Describe a choice by the settings that were changed."""
    return ", ".join(_format_setting(name, value) for name, value in row["changed"].items()) or "its own settings"


def _format_setting(name: str, value: Any) -> str:
    if name in ("step", "time_constant"):
        return f"{name.replace('_', ' ')} {1e3 * value:g} ms"
    values = value if isinstance(value, (list, tuple)) else (value,)
    return " ".join((name, *(f"{part:g}" if isinstance(part, float) else str(part) for part in values)))


def cost(row: Row) -> float:
    """Return the CPU time per simulated second [1]."""
    return row["step_cost"] / row["step"]


def rode(row: Row) -> bool:
    """Return whether the ride stayed on its circle for as long as asked."""
    return row["ridden"] >= row["asked"] * (1 - 1e-9)


def _ranking_numbers(row: Row) -> tuple[float, float, float]:
    energy = row["energy_rate"]
    return row["slip"], abs(energy["value"]) if energy else float("inf"), cost(row)


def gains(row: Row, other: Row) -> tuple[float, float, float]:
    """Return the factors by which another choice has less slip, less energy drift and less cost."""
    return tuple(a / b for a, b in zip(_ranking_numbers(row), _ranking_numbers(other), strict=True))  # pyright: ignore


def beats(other: Row, row: Row) -> bool:
    """Return whether another choice is noticeably better in something, worse in nothing and needs no more."""
    factors = gains(row, other)
    return (
        rode(other) and other["needs"] <= row["needs"] and max(factors) >= NOTICEABLE and min(factors) >= 1 / NOTICEABLE
    )


def advice(rows: Sequence[Row]) -> list[str]:
    """Give advice on each choice.

    Parameters
    ----------
    rows : sequence of mapping
        All choices on one motion.

    Returns
    -------
    list of str
    """
    return [_advise(row, rows) for row in rows]


def _advise(row: Row, rows: Sequence[Row]) -> str:
    if not rode(row):
        return f"do not: off its circle after {row['ridden']:.2g} s"
    rivals = [other for other in rows if beats(other, row)]
    if rivals:
        best = max(rivals, key=lambda other: gains(row, other)[0] * gains(row, other)[1])
        return f"rather {_describe_choice(best, row)}: {_describe_gains(gains(row, best))}"
    equals = [other for other in rows if rode(other) and other["needs"] <= row["needs"]]
    if row["slip"] <= NOTICEABLE * min(other["slip"] for other in equals):
        return f"take it for the least slip{'' if row['needs'] else ' of the engine alone'}"
    if cost(row) <= NOTICEABLE * min(cost(other) for other in equals):
        return "take it if CPU time is all that counts"
    return "fair: what slips less costs more"


def _describe_choice(other: Row, row: Row) -> str:
    return label(other) if other["engine"] == row["engine"] else f"{other['engine']} ({label(other)})"


def _describe_gains(factors: tuple[float, float, float]) -> str:
    names = ("slip", "energy drift", "CPU time")
    parts = [f"{_format_factor(f)} less {n}" for f, n in zip(factors, names, strict=True) if f >= NOTICEABLE]
    return ", ".join(parts)


def _format_factor(factor: float) -> str:
    return f"{factor:.1f} times" if factor < 9.95 else f"{float(f'{factor:.2g}'):,.0f} times"


def markdown_table(rows: Sequence[Row]) -> str:
    """Write the choices with their measurements and the advice as a Markdown table.

    Parameters
    ----------
    rows : sequence of mapping
        All choices on one motion.

    Returns
    -------
    str
    """
    lines = [
        "| model | changed | slip mm/s | dE/dt W | dR/dt mm/s | µs a step | CPU ms a second | advice |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | --- |",
    ]
    for row, recommendation in zip(rows, advice(rows), strict=True):
        cells = (
            row["engine"],
            label(row) if row["changed"] else "–",
            f"{1e3 * row['slip']:.3g}",
            _format_rate(row["energy_rate"], 1.0),
            _format_rate(row["radius_rate"], 1e3),
            f"{1e6 * row['step_cost']:.0f}",
            f"{1e3 * cost(row):.2g}",
            recommendation,
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _format_rate(rate: Mapping[str, float] | None, scale: float) -> str:
    return "–" if rate is None else f"{scale * rate['value']:.2g}"
