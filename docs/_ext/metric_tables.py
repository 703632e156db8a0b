"""The reference of the metrics, from their definitions."""

from __future__ import annotations

from velodrome.reports.drawing import COLUMNS
from velodrome.reports.measure import QUANTITIES


def describe_metrics() -> str:
    """Markdown of every key of ``metrics.json``, each with the anchor that report pages link to."""
    lines = []
    for name, quantity in QUANTITIES.items():
        unit = f" [{quantity.unit}]" if quantity.unit else ""
        parts = ", ".join(f"`{part}`" for part in quantity.parts)
        lines += [
            f'<span id="metric-{name}"></span>`{name}`{unit}',
            f": {quantity.meaning}" + (f" An object with {parts}." if parts else ""),
        ]
        if quantity.absent:
            lines.append(f": Null {quantity.absent}.")
        lines.append("")
    return "\n".join(lines)


def describe_columns() -> str:
    """Markdown of the columns of the table that `velodrome run` prints."""
    lines = []
    for title, unit, metric, part in COLUMNS:
        which = f"`{metric}.{part}`" if part else f"`{metric}`"
        shown = "" if unit == "1" else f" [{unit}]"
        lines += [f"{title}{shown}", f": {QUANTITIES[metric].meaning} ({which})", ""]
    return "\n".join(lines)
