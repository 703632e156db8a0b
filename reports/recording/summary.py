"""A run in words for its recording, as Markdown: the verdict, and the summary with its tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...engines.engine import REFERENCE
from ..drawing import (
    COLUMNS,
    describe_required_friction,
    describe_stability,
    escape_markdown,
    format_numbers,
    format_table,
    format_verdict,
    group_remarks,
    is_whole_ride,
    rank_engines,
)

# Heading of a table, and the titles of its columns by metric: a table of all of them would be wider than the view.
_TABLES = (
    (
        "Largest errors against the reference",
        {
            "position_error": "position",
            "orientation_error": "rotation",
            "rate_error": "rates",
            "contact_force_error": "forces",
        },
    ),
    (
        "Drifts (slopes of a line fit), slip and cost",
        {"radius_drift_rate": "radius", "energy_drift": "energy", "max_slip": "largest slip", "cpu_time": "CPU time"},
    ),
)


def make_verdict(
    measured: Mapping[str, Mapping[str, Any]],
    failures: Mapping[str, str],
    verdicts: Sequence[Mapping[str, Any]],
    duration: float,
) -> str:
    """Write what came of a run, in a few lines of Markdown.

    The lines say how many engines meet the scenario's criterion, how many ride to the end and when the others ended,
    and how near to the reference the nearest and the farthest of those come that ride to the end.

    Parameters
    ----------
    measured : mapping
        Metrics by engine name.
    failures : mapping
        Reason by the name of an engine that gave no trajectory.
    verdicts : sequence of mapping
        As returned by `velodrome.scenarios.run.runner.judge_run`.
    duration : float
        Duration of the run [s].
    """
    lines = [_judge(verdicts)] if verdicts else []
    staying = [name for name in rank_engines(measured) if is_whole_ride(measured[name])]
    total = len(measured) + len(failures)
    count = f"All {total}" if len(staying) == total else f"{len(staying)} of {total}"
    noun = "engine rides" if total == 1 else "engines ride"
    lines.append(f"**{count} {noun} to the end, {duration:g} s.**" + _list_ends(measured, failures))
    errors = {name: (measured[name].get("position_error") or {}).get("max") for name in staying if name != REFERENCE}
    errors = {name: error for name, error in errors.items() if error is not None}
    if errors:
        cells = [f"{escape_markdown(name)} {format_numbers([error])[0]} m" for name, error in errors.items()]
        far = f", farthest {cells[-1]}" if len(cells) > 1 else ""
        lines.append(f"Nearest to the reference: {cells[0]}{far} (largest distance).")
    return "\n\n".join(lines) + "\n"


def _judge(verdicts: Sequence[Mapping[str, Any]]) -> str:
    short = [verdict for verdict in verdicts if not verdict["holds"]]
    held = f"{len(verdicts) - len(short)} of {len(verdicts)}" if short else f"All {len(verdicts)}"
    quantity, limit = escape_markdown(verdicts[0]["quantity"].replace("_", " ")), verdicts[0]["limit"]
    names = f" Not: {escape_markdown(', '.join(verdict['engine'] for verdict in short))}." if short else ""
    return f"**{held} engines meet the criterion: {quantity} below {limit:.3g}.**{names}"


def _list_ends(measured: Mapping[str, Mapping[str, Any]], failures: Mapping[str, str]) -> str:
    ends = [
        f"{name} fell at {values['fell_at']:.2f} s" if values["fell_at"] is not None else f"{name} ended early"
        for name, values in measured.items()
        if not is_whole_ride(values)
    ]
    ends += [f"{name} did not run" for name in failures]
    return f" {escape_markdown('; '.join(ends))}." if ends else ""


def make_summary(
    title: str,
    measured: Mapping[str, Mapping[str, Any]],
    failures: Mapping[str, str],
    verdicts: Sequence[Mapping[str, Any]],
    growth_rate: float,
    duration: float,
    unsteady: str | None = None,
) -> str:
    """Write the Markdown summary of a run.

    Parameters
    ----------
    title : str
    measured : mapping
        Metrics by engine name.
    failures : mapping
        Reason by the name of an engine that gave no trajectory.
    verdicts : sequence of mapping
        As returned by `velodrome.scenarios.run.runner.judge_run`.
    growth_rate : float
        Growth rate of the motion's own disturbances [1/s].
    duration : float
        Duration of the run [s].
    unsteady : str, optional
        See `velodrome.reports.drawing.describe_stability`.

    Returns
    -------
    str
    """
    lines = [f"# {escape_markdown(title)}", ""]
    lines += [f"- {escape_markdown(format_verdict(verdict))}" for verdict in verdicts] + ([""] if verdicts else [])
    lines += [describe_stability(growth_rate, unsteady), ""]
    table = format_table(measured)
    columns = {metric: (unit, k) for k, (_, unit, metric, _) in enumerate(COLUMNS)}
    for heading, titles in _TABLES:
        heads = [f"{title} [{columns[metric][0]}]" for metric, title in titles.items()]
        lines += [f"## {heading}", "", f"| engine | {' | '.join(heads)} |", "|---|" + "---:|" * len(heads)]
        for name, cells in table.items():
            chosen = [cells[columns[metric][1]] for metric in titles]
            lines.append(f"| {escape_markdown(name)} | {' | '.join(chosen)} |")
        lines.append("")
    remarks = [f"- {escape_markdown(f'{engine} did not run: {reason}')}" for engine, reason in failures.items()]
    ranked = {engine: measured[engine] for engine in table}
    remarks += [f"- {escape_markdown(line)}" for line in group_remarks(ranked, duration)]
    friction = describe_required_friction(measured)
    remarks += [] if friction is None else [f"- {friction}"]
    lines += ["## Remarks", "", *remarks] if remarks else []
    return "\n".join(lines).rstrip() + "\n"
