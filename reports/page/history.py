"""The page of a history of releases: its document as one self-contained HTML document without a script."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from .anchors import AnchorNames
from .document import list_engine_styles, render_page
from .judged_quantities import find_quantity, format_title
from .releases_figure import draw_releases, format_distinct

Row = Mapping[str, Any]
_ABSOLUTE = "report_mismatch"  # its limit is one of the value itself
_RUN = "run"  # the quantity that moved where a release rides and the one before it did not, or the opposite
_UNMOVED = {"same-bits": "same to the bit", "round-off": "same within round-off"}
_DIGITS = 4  # of figures in tables
_CODE = re.compile(r"`([^`]*)`")


@dataclass(frozen=True)
class CellKind:
    """A kind of cell in a strip of releases: its sign, which no other kind has, and what it means."""

    key: str
    sign: str
    meaning: str


CELL_KINDS = (
    CellKind("first", "•", "rode, with nothing before to compare with"),
    CellKind("same-bits", "=", "same to the bit as the last one before that rode"),
    CellKind("round-off", "≈", "the same within round-off"),
    CellKind("better", "+", "better beyond a limit"),
    CellKind("worse", "−", "worse beyond a limit"),
    CellKind("changed", "≠", "changed beyond a limit, both ways or in no direction; or the first that rides"),
    CellKind("refused", "R", "refused the ride"),
    CellKind("failed", "F", "failed: an error, a crash, or no end"),
    CellKind("not-installable", "N", "could not be installed"),
)
_KINDS = {kind.key: kind for kind in CELL_KINDS}


def find_cell_kind(row: Row) -> CellKind:
    """Return the kind of a row's cell: its status where it did not ride, else what moved since the release before."""
    if row["status"] != "rode":
        return _KINDS[row["status"]]
    return _KINDS[row["since_previous"] or "first"]


def is_turning_point(row: Row) -> bool:
    """Return whether something moved beyond its limit with this release."""
    return bool(row["changed"])


def group_releases(rows: Sequence[Row]) -> list[list[Row]]:
    """Group neighbouring releases of one engine and scenario that ride alike, or do not ride for the same reason."""
    numbered: list[tuple[int, Row]] = []
    number, before = 0, None
    for row in rows:
        # A reason that names the release is the same for the next one.
        state = (row["status"], (row["reason"] or "").replace(row["version"], ""))
        if before is not None and (is_turning_point(row) or state != before):
            number += 1
        before = state
        numbered.append((number, row))
    return [[row for _, row in group] for _, group in groupby(numbered, key=lambda item: item[0])]


def make_history_page(document: Mapping[str, Any]) -> str:
    """Write the page of a history.

    Parameters
    ----------
    document : mapping
        As `velodrome history --json` prints it.

    Returns
    -------
    str
        A self-contained HTML document. All text from the history is escaped, and all its numbers are those of the
        document, rounded.
    """
    names = list(document["engines"])
    anchors = AnchorNames()
    sections = [_make_section(document, scenario, anchors) for scenario in document["scenarios"]]
    return render_page(
        "history.html",
        "history.css",
        document=document,
        facts=_list_facts(document),
        engines=list_engine_styles(names),
        kinds=CELL_KINDS,
        sections=[section for section in sections if section["pairs"]],
        turns=_list_turns(document["turning_points"], document, sections),
        gradual=_list_turns(document["gradual_moves"], document, sections),
        compared=any(row["since_previous"] is not None for row in document["releases"]),
        meanings=_list_meanings(document),
    )


def format_figures(*values: float | None) -> list[str]:
    """Return numbers as text, different where the numbers are; a dash for None."""
    there = [value for value in values if value is not None]
    texts = iter(format_distinct(there, _DIGITS))
    return ["–" if value is None else next(texts) for value in values]


def format_limit(limit: float | None) -> str:
    """Return a limit as text; a dash for None."""
    return "–" if limit is None else f"{limit:.2g}"


def describe_unit(name: str) -> str:
    """Return the unit of a quantity; empty for a ratio."""
    unit = find_quantity(name).unit
    return "" if unit == "1" else unit


def find_moved_kind(verdict: str) -> CellKind:
    """Return the kind of a verdict on a quantity or a release that moved."""
    return _KINDS[verdict]


def describe_run(status: str) -> str:
    """Return the words for a release that rides where the one before did not, or the opposite, by the move's status."""
    return {
        "changed": "it rides, and none before it did",
        "better": "it rides again, and the one before it did not",
        "worse": "it does not ride any more",
    }[status]


def _describe_move(move: Mapping[str, Any]) -> tuple[str, str]:
    """Return a quantity and how it moved; the latter is empty where there are no numbers."""
    if move["quantity"] == _RUN:
        return describe_run(move["status"]), ""
    before, after = format_figures(move["before"], move["after"])
    return format_title(move["quantity"]), f"{before} → {after}"


def rank_moves(moves: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return moves with the ride and the observed order first, then the largest first, against their limits."""

    def rank(move: Mapping[str, Any]) -> float:
        if move["quantity"] in ("observed_order", _RUN):
            return -float("inf")
        if move["before"] is None or move["after"] is None or not move["limit"]:
            return 0.0
        return -abs(move["after"] - move["before"]) / move["limit"]

    return sorted(moves, key=rank)


def _list_facts(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    labels = list(dict.fromkeys(row["release"] for row in document["releases"]))
    ends = labels[0] if len(labels) == 1 else f"{labels[0]} to {labels[-1]}" if labels else "none was reached"
    state = "complete" if document["complete"] else "interrupted: the finished rides are shown"
    if document["bisected"]:
        state += "; only the releases were ridden that were needed to find those that moved something"
    return [
        ("Package", document["package"]),
        ("Releases", ends),
        ("Engines", ", ".join(document["engines"])),
        ("Scenarios", ", ".join(document["scenarios"])),
        ("State", state),
    ]


def _make_section(document: Mapping[str, Any], scenario: str, anchors: AnchorNames) -> dict[str, Any]:
    """Return what the page shows of a scenario."""
    found = {engine: _select_rows(document, scenario, engine) for engine in document["engines"]}
    return {
        "name": scenario,
        "title": document["scenarios"][scenario],
        "anchor": anchors.choose(scenario),
        "pairs": [_make_pair(document, scenario, engine, rows, anchors) for engine, rows in found.items() if rows],
    }


def _select_rows(document: Mapping[str, Any], scenario: str, engine: str) -> list[Row]:
    return [row for row in document["releases"] if row["scenario"] == scenario and row["engine"] == engine]


def _make_pair(
    document: Mapping[str, Any], scenario: str, engine: str, rows: list[Row], anchors: AnchorNames
) -> dict[str, Any]:
    """Return what the page shows of an engine on a scenario."""
    points = {
        point["release"]: point
        for point in document["turning_points"]
        if point["scenario"] == scenario and point["engine"] == engine
    }
    gradual = [move for move in document["gradual_moves"] if move["scenario"] == scenario and move["engine"] == engine]
    groups: list[dict[str, Any]] = [
        {
            "anchor": anchors.choose(scenario, engine, group[0]["version"]),
            "rows": group,
            "text": _describe_group(group, points.get(group[0]["release"]), {move["release"] for move in gradual}),
            "point": _describe_point(points.get(group[0]["release"])),
            "gradual": [
                {"release": row["release"]} | (_describe_point(move) or {})
                for row in group
                for move in gradual
                if move["release"] == row["release"]
            ],
        }
        for group in group_releases(rows)
    ]
    quantities = list(dict.fromkeys(name for row in rows for name in row["quantities"]))
    slow = {move["quantity"]: each["release"] for each in gradual for move in each["quantities"]}
    figures = [_make_figure(rows, name, slow.get(name)) for name in quantities]
    drawn = [figure for figure in figures if figure is not None]
    return {
        "engine": engine,
        "number": list(document["engines"]).index(engine),
        "anchor": anchors.choose(scenario, engine),
        "rows": rows,
        "cells": [_make_cell(row, group["anchor"]) for group in groups for row in group["rows"]],
        "groups": groups,
        "moved": [figure for figure in drawn if figure["moved"]],
        "unmoved": [figure for figure in drawn if not figure["moved"]],
        "columns": [(name, describe_unit(name)) for name in quantities],
        "table": _make_table(rows, quantities),
    }


def _make_cell(row: Row, anchor: str) -> dict[str, Any]:
    kind, words = find_cell_kind(row), _describe_row(row)
    return {
        "kind": kind,
        "turn": is_turning_point(row),
        "version": row["version"],
        "build": row["release"].removeprefix(row["version"]).strip(),
        "words": words,
        "title": f"{_name_release(row)}: {words}",
        "anchor": anchor,
    }


def _name_release(row: Mapping[str, Any]) -> str:
    return row["release"] if row["date"] is None else f"{row['release']}, {row['date']}"


def _describe_row(row: Row) -> str:
    """Return what the cell of a row says, in words."""
    if row["status"] != "rode":
        since = f" (rode in {row['compared_with']})" if row["changed"] else ""
        return f"{row['status']}: {row['reason']}{since}"
    if row["since_previous"] is None:
        return "rode, with nothing before to compare with"
    moved = ", ".join(format_title(name) for name in row["changed"] if name != _RUN)
    if _RUN in row["changed"] and row["since_previous"] == "changed" and not moved:
        return "rides, and none before it did"
    again = "rides again; " if _RUN in row["changed"] else ""
    if not moved:
        return (
            again
            + {
                "same-bits": f"same to the bit as {row['compared_with']}",
                "round-off": f"the same as {row['compared_with']} within round-off",
            }[row["since_previous"]]
        )
    return f"{again}{row['since_previous']} since {row['compared_with']}: {moved}"


def _describe_group(group: Sequence[Row], point: Mapping[str, Any] | None, slow: set[str]) -> str | None:
    """Return what the releases of a group have in common; None where the turning point alone says all.

    Parameters
    ----------
    group : sequence of mapping
    point : mapping or None
        Turning point of its first release.
    slow : set of str
        Releases until which something moved gradually.
    """
    if len(group) == 1 and point is not None and group[0]["status"] == "rode":
        return None
    if group[0]["status"] != "rode":
        return f"{group[0]['status']}: {group[0]['reason']}"
    inside = {row["since_previous"] for row in group[1:]}
    if not inside:
        return "rode"
    if any(row["release"] in slow for row in group[1:]):
        return "rode, each the same as the one before within round-off"
    return "rode, the same to the bit" if inside == {"same-bits"} else "rode, the same within round-off"


def _describe_point(point: Mapping[str, Any] | None) -> dict[str, Any] | None:
    if point is None:
        return None
    return {
        "since": point["since"],
        "verdict": _UNMOVED.get(point["verdict"], point["verdict"]),
        "kind": find_moved_kind(point["verdict"]),
        "run": next((describe_run(move["status"]) for move in point["quantities"] if move["quantity"] == _RUN), None),
        "moves": [
            {
                "title": format_title(move["quantity"]),
                "unit": describe_unit(move["quantity"]),
                "cells": [*format_figures(move["before"], move["after"]), format_limit(move["limit"])],
                "kind": find_moved_kind(move["status"]),
            }
            for move in rank_moves(point["quantities"])
            if move["quantity"] != _RUN
        ],
        "page": point.get("page"),
    }


def _make_figure(rows: Sequence[Row], name: str, slow: str | None) -> dict[str, Any] | None:
    """Return the figure of a quantity with the texts about it; None where no release has a value.

    Parameters
    ----------
    rows : sequence of mapping
    name : str
        Quantity.
    slow : str or None
        Last release until which it moved gradually beyond its limit.
    """
    drawn = draw_releases(rows, name, name == _ABSOLUTE)
    if drawn is None:
        return None
    moved = [row["release"] for row in rows if name in row["changed"]]
    values = [(row["release"], row["quantities"].get(name)) for row in rows]
    there = [(release, value) for release, value in values if value is not None]
    texts = format_figures(*(value for _, value in there))
    spoken = f"{format_title(name)}: {texts[0]} in {there[0][0]}"
    if len(there) > 1:
        spoken += f", {texts[-1]} in {there[-1][0]}"
    spoken += f"; moved beyond its limit in {', '.join(moved)}" if moved else "; no release moved it beyond its limit"
    spoken += f"; moved gradually until {slow}" if slow is not None else ""
    titles = {release: f"{release}: {text}" for (release, _), text in zip(there, texts, strict=True)}
    return drawn | {
        "title": format_title(name),
        "unit": describe_unit(name),
        "moved": bool(moved) or slow is not None,
        "spoken": spoken,
        "judged": any(name in row["limits"] for row in rows),
        "titles": [titles.get(row["release"], "") for row in rows],
        "versions": [row["version"] for row in rows],
        "dates": [row["date"] for row in rows],
    }


def _make_table(rows: Sequence[Row], quantities: Sequence[str]) -> list[tuple[Row, CellKind, list[tuple[str, bool]]]]:
    """Return rows with their kind and, for every quantity, its figure and whether it moved."""
    columns = {name: format_figures(*(row["quantities"].get(name) for row in rows)) for name in quantities}
    return [
        (row, find_cell_kind(row), [(columns[name][number], name in row["changed"]) for name in quantities])
        for number, row in enumerate(rows)
    ]


def _list_turns(
    moves: Sequence[dict[str, Any]], document: Mapping[str, Any], sections: Sequence[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Return turning points, or gradual moves, by release, with the anchors of their places on the page."""
    anchors = {
        (section["name"], pair["engine"], row["release"]): group["anchor"]
        for section in sections
        for pair in section["pairs"]
        for group in pair["groups"]
        for row in group["rows"]
    }
    order = {row["release"]: number for number, row in enumerate(document["releases"])}
    points = sorted(moves, key=lambda point: order[point["release"]])
    return [
        {
            "name": release,
            "points": [
                point
                | {
                    "anchor": anchors[point["scenario"], point["engine"], point["release"]],
                    "kind": find_moved_kind(point["verdict"]),
                    "verdict": _UNMOVED.get(point["verdict"], point["verdict"]),
                    "first": _describe_move(rank_moves(point["quantities"])[0]),
                    "others": [format_title(move["quantity"]) for move in rank_moves(point["quantities"])[1:]],
                }
                for point in found
            ],
        }
        for release, found in ((name, list(group)) for name, group in groupby(points, key=_name_release))
    ]


def _list_meanings(document: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Return title, unit and meaning of the quantities; other quantities in a meaning have their titles."""
    names = dict.fromkeys(name for row in document["releases"] for name in (*row["quantities"], *row["changed"]))
    found = [(name, find_quantity(name).meaning) for name in names]
    return [
        (format_title(name), describe_unit(name), _CODE.sub(lambda code: format_title(code[1]), meaning))
        for name, meaning in found
        if meaning
    ]
