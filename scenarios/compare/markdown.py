"""The comparison of two runs as a page of Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...reports.drawing import escape_markdown
from .differences import TO_THE_BIT
from .reasons import format_value

_WHEN = ("before", "after")


def diff_markdown(document: Mapping[str, Any]) -> str:
    """Write the document of `diff_document` with its ``notes`` as Markdown: the verdict, then a part per engine."""
    names = [run["name"] for run in document["runs"]]
    word = "the same within round-off" if document["same"] else "not the same"
    title = escape_markdown(f"{document['title']}: {names[0]} against {names[1]}")
    lines = [f"# {title}", "", f"The rides of the engines in both runs are {word}.", ""]
    lines += _list_surroundings(document)
    for name, engine in document["engines"].items():
        lines += ["", f"## {escape_markdown(name)}: {engine['verdict']}", "", *_engine_lines(engine)]
    return "\n".join(lines) + "\n"


def diff_verdict(document: Mapping[str, Any]) -> str:
    """Write the verdict on two runs, their names, and which rides are the same, in a few lines of Markdown."""
    word = "the same within round-off" if document["same"] else "not the same"
    names = (f"{when}: {escape_markdown(run['name'])}" for when, run in zip(_WHEN, document["runs"], strict=True))
    once = [name for name, engine in document["engines"].items() if engine["verdict"] == TO_THE_BIT]
    lines = [f"**The rides of the engines in both runs are {word}.**", "; ".join(names)]
    lines += [f"The same to the bit, drawn once: {escape_markdown(', '.join(once))}"] if once else []
    return "\n\n".join(lines) + "\n"


def diff_summary(document: Mapping[str, Any]) -> str:
    """Write the comparison of two runs as Markdown that a narrow view shows: one row an engine, then the reasons."""
    lines = [f"# {escape_markdown(document['title'])}", ""]
    lines += ["| engine | largest distance [m] | too far from [s] | rides |", "|---|---:|---:|---|"]
    for name, engine in document["engines"].items():
        position = engine["position_difference"] or {"max": None, "exceeds_at": None}
        cells = [_format_cell(position[key]) for key in ("max", "exceeds_at")]
        lines.append(f"| {escape_markdown(name)} | {' | '.join(cells)} | {engine['verdict']} |")
    lines += ["", *_list_surroundings(document)]
    for name, engine in document["engines"].items():
        remarks = [f"- {escape_markdown(line)}" for line in [*diff_remarks(engine), *engine["reasons"]]]
        lines += ["", f"## {escape_markdown(name)}", "", *remarks] if remarks else []
    return "\n".join(lines).rstrip() + "\n"


def _list_surroundings(document: Mapping[str, Any]) -> list[str]:
    """List what differs besides the engines of both runs, as items of Markdown."""
    lines = []
    for part, changes in document["differs"].items():
        lines += [f"- {part}: {escape_markdown(_format_change(name, *pair))}" for name, pair in changes.items()]
    lines += [f"- {escape_markdown(note)}" for note in document["notes"]]
    for when in _WHEN:
        only = document[f"only_{when}"]
        lines += [f"- only in the run {when}: {escape_markdown(', '.join(only))}"] if only else []
    return lines


def _engine_lines(engine: Mapping[str, Any]) -> list[str]:
    """Write the part of one engine: remarks and reasons, then the tables of fields and metrics."""
    lines = [*diff_remarks(engine), *_describe_cpu_times(engine["cpu_time"]), *engine["reasons"]]
    remarks = [f"- {escape_markdown(line)}" for line in lines]
    blocks = [block for block in (remarks, _field_table(engine["fields"]), _metric_table(engine["metrics"])) if block]
    return [line for k, block in enumerate(blocks) for line in ([""] if k else []) + block]


def _field_table(compared: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Write the fields of both runs as a table, each with the column nearest to its limit or furthest beyond."""
    if not compared:
        return []
    rows = ["| field | column | unit | largest difference | at s | allowed there | beyond from s |"]
    rows.append("|---|---|---|---:|---:|---:|---:|")
    for name, field in compared.items():
        if "only_in" not in field:
            cells = [_format_cell(field[key]) for key in ("column", "unit", "max", "max_at", "allowed", "exceeds_at")]
            rows.append(f"| {name} | " + " | ".join(cells) + " |")
    return rows


def _metric_table(metrics: Mapping[str, Mapping[str, Any]]) -> list[str]:
    if not metrics:
        return []
    rows = ["| metric | before | after | change | limit |", "|---|---:|---:|---:|---:|"]
    for name, metric in metrics.items():
        cells = (_format_cell(metric[key]) for key in ("before", "after", "change", "limit"))
        rows.append(f"| {name} | " + " | ".join(cells) + " |")
    return rows


def diff_remarks(engine: Mapping[str, Any]) -> list[str]:
    """List changed version and settings of an engine, and how far it was compared."""
    before, after = engine["version"]
    lines = [f"version {before} -> {after}"] if before != after else []
    lines += [_format_change(name, *pair) for name, pair in engine["settings"].items()]
    position = engine["position_difference"]
    if position is not None and position["horizon"] is not None:
        lines.append(
            f"compared up to {position['horizon']:.4g} s: beyond, the motion's own growth leaves nothing to compare"
        )
    return lines


def _describe_cpu_times(cpu_time: Mapping[str, Any] | None) -> list[str]:
    if cpu_time is None or cpu_time["ratio"] is None:
        return []
    return [f"CPU time {cpu_time['before']:.3g} s -> {cpu_time['after']:.3g} s, {cpu_time['ratio']:.3g} times"]


def _format_change(name: str, before: Any, after: Any) -> str:
    return f"{name} {format_value(before)} -> {format_value(after)}"


def _format_cell(value: Any) -> str:
    return "–" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
