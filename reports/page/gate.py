"""The page of the drift gate's verdicts, as one self-contained HTML document without a script."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from ..drawing import format_numbers
from .document import list_engine_styles, render_page
from .judged_quantities import find_quantity, format_title
from .tables import PageTable, TableColumn


@dataclass(frozen=True)
class GateSign:
    """How a status of a verdict is shown: its sign, its class of page.css and its word, the worst first in `SIGNS`."""

    sign: str
    kind: str
    word: str


SIGNS: dict[str, GateSign] = {
    "missing": GateSign("✗", "short", "missing"),
    "worse": GateSign("✗", "short", "worse"),
    "changed": GateSign("≠", "short", "changed"),
    "new": GateSign("•", "remark", "new"),
    "better": GateSign("+", "holds", "improved"),
    "holds": GateSign("✓", "holds", "holds"),
    "shown": GateSign("–", "remark", "not judged"),
}
_RANKS = list(SIGNS)
_CHANGES = "settings"  # quantity under which a change of settings or version is told


def make_gate_page(
    outcome: str,
    counts: str,
    verdicts: Sequence[Mapping[str, Any]],
    told: Sequence[Mapping[str, Any]],
    left_out: Mapping[str, str],
    libraries: Mapping[str, str],
) -> str:
    """Write the page of the gate.

    Parameters
    ----------
    outcome : str
        In words.
    counts : str
        How many quantities hold, and how many have which other status.
    verdicts : sequence of mapping
        As in the document of `velodrome check --json`, grouped by scenario and engine.
    told : sequence of mapping
        Those of them that need attention.
    left_out : mapping of str to str
        How to install engines that are not judged, by engine.
    libraries : mapping of str to str
        Versions by name.

    Returns
    -------
    str
        A self-contained HTML document. All text is escaped.
    """
    engines = list(dict.fromkeys(verdict["engine"] for verdict in verdicts))
    return render_page(
        "gate.html",
        outcome=outcome,
        counts=counts,
        failing=any(not verdict["passes"] for verdict in verdicts),
        made={"libraries": libraries, "platform": {}},
        facts=[],
        engines=list_engine_styles(engines),
        names=engines,
        scenarios=list(dict.fromkeys(verdict["scenario"] for verdict in verdicts)),
        cells=_make_cells(verdicts),
        told=[{**verdict, "sign": SIGNS[verdict["status"]]} for verdict in sorted(told, key=_rank)],
        changes=_CHANGES,
        left_out=left_out,
        parts=[
            {"scenario": scenario, "table": _make_table(list(rows))}
            for scenario, rows in groupby(verdicts, key=lambda verdict: verdict["scenario"])
        ],
        meanings=[
            (name, format_title(name), unit if (unit := find_quantity(name).unit) != "1" else "", meaning)
            for name in dict.fromkeys(verdict["quantity"] for verdict in verdicts)
            if (meaning := find_quantity(name).meaning)
        ],
    )


def _rank(verdict: Mapping[str, Any]) -> int:
    return _RANKS.index(verdict["status"])


def _find_share(verdict: Mapping[str, Any]) -> float | None:
    """Return how much a quantity moved, against its limit; None where there is nothing to compare."""
    if verdict["value"] is None or verdict["baseline"] is None or not verdict["limit"]:
        return None
    return abs(verdict["value"] - verdict["baseline"]) / verdict["limit"]


def _make_cells(verdicts: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str], dict[str, Any]]:
    """Return, by engine and scenario, the worst status and the quantity that moved most against its limit."""
    cells = {}
    for (scenario, engine), rows in groupby(verdicts, key=lambda verdict: (verdict["scenario"], verdict["engine"])):
        group = list(rows)
        # What is only shown says nothing where something is judged.
        worst = SIGNS[min(group, key=_rank)["status"]]
        shares = {row["quantity"]: share for row in group if (share := _find_share(row)) is not None}
        most = max(shares, key=lambda name: shares[name], default=None)
        moved = "nothing moved" if most is not None else ""
        if most is not None and shares[most] > 0:
            moved = f"{format_title(most)} {shares[most]:.2g}"
        cells[engine, scenario] = {"sign": worst, "moved": moved}
    return cells


def _make_table(rows: list[Mapping[str, Any]]) -> PageTable:
    """Return the verdicts of a scenario, the worst and those that moved most first."""
    # That the version or a setting is another is no verdict on a quantity.
    judged = [row for row in rows if row["quantity"] != _CHANGES]
    ordered = sorted(judged, key=lambda row: (_rank(row), -(_find_share(row) or 0.0)))
    numbers = {
        key: [_format_value(row["quantity"], row[key]) for row in ordered] for key in ("value", "baseline", "limit")
    }
    shares = ["–" if (share := _find_share(row)) is None else f"{share:.2g}" for row in ordered]
    return PageTable(
        caption="The worst first, then those that moved most against their limit; 1 is the limit.",
        head="engine",
        names=[row["engine"] for row in ordered],
        columns=[
            TableColumn("quantity", "", [format_title(row["quantity"]) for row in ordered], words=True),
            TableColumn("unit", "", [find_quantity(row["quantity"]).unit for row in ordered], words=True),
            TableColumn("value", "", numbers["value"]),
            TableColumn("baseline", "", numbers["baseline"]),
            TableColumn("limit", "", numbers["limit"]),
            TableColumn("moved, against its limit", "", shares),
            TableColumn("verdict", "", [_describe(SIGNS[row["status"]]) for row in ordered], words=True),
        ],
    )


def _format_value(quantity: str, value: float | None) -> str:
    """Return a value with six digits, and a number of steps whole."""
    if quantity.endswith("steps") and value is not None:
        return f"{value:.0f}"
    return format_numbers([value], 6)[0]


def _describe(sign: GateSign) -> str:
    return f"{sign.sign} {sign.word}"
