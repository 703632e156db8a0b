"""The page of a work-precision study, as one self-contained HTML document without a script."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...engines.engine import REFERENCE
from ..drawing import format_numbers
from ..measure import compared_time
from . import words
from .document import list_engine_styles, render_page
from .loglog import draw_loglog
from .tables import PageTable, TableColumn, format_complex, number_column

_POINT_COLUMNS = (
    ("position error", "m", "position_error"),
    ("energy drift", "1", "energy_drift"),
    ("largest slip", "m/s", "max_slip"),
    ("force error", "1", "contact_force_error"),
    ("CPU time", "s", "cpu_time"),
)


def make_precision_page(document: Mapping[str, Any]) -> str:
    """Write the page of a work-precision study.

    Parameters
    ----------
    document : mapping
        As `velodrome precision --json` prints it.

    Returns
    -------
    str
        A self-contained HTML document. All text is escaped.
    """
    names = list(document["engines"])
    return render_page(
        "precision.html",
        document=document,
        made={"libraries": document["libraries"], "platform": {}},
        facts=_list_facts(document),
        engines=list_engine_styles(names),
        headline=words.keep_whole(_write_headline(document), names),
        table=_make_overview(document),
        over_step=_draw(document, "step"),
        over_work=_draw(document, "cpu_time"),
        parts=[
            {
                "name": name,
                "table": _make_steps_table(name, entry) if entry["points"] else None,
                "failures": [_describe_failure(failure) for failure in entry["failures"]],
                "eigenvalues": _make_eigenvalue_table(name, entry["eigenvalues"]),
            }
            for name, entry in document["engines"].items()
        ],
    )


def _list_facts(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        ("Scenario", document["scenario"]),
        ("Compared over", f"{compared_time(document):.4g} s"),
        ("Growth rate", f"{document['growth_rate']:.4g} 1/s"),
        ("Bicycle", document["bicycle"]["name"]),
    ]


def _write_headline(document: Mapping[str, Any]) -> str:
    """Return which engine comes closest, at which step, and the orders that the engines show."""
    others = {name: entry for name, entry in document["engines"].items() if name != REFERENCE}
    reached = {
        name: min((point["position_error"], point["step"]) for point in entry["points"])
        for name, entry in others.items()
        if entry["points"]
    }
    sentences = []
    if reached:
        best = min(reached, key=lambda name: reached[name])
        error, step = reached[best]
        sentences.append(f"{best} comes closest: {error:.2g} m from the reference, with steps of {step:.2g} s.")
    orders = [
        f"{name} {entry['observed_order']:.2f}" for name, entry in others.items() if entry["observed_order"] is not None
    ]
    if orders:
        sentences.append(f"Observed order: {', '.join(orders)}.")
    unknown = [name for name, entry in others.items() if entry["observed_order"] is None]
    if unknown:
        sentences.append(f"No order is seen of {', '.join(unknown)}.")
    return " ".join(sentences)


def _draw(document: Mapping[str, Any], key: str) -> dict[str, Any] | None:
    names = list(document["engines"])
    return draw_loglog(
        {
            name: [(point[key], point["position_error"]) for point in entry["points"]]
            for name, entry in document["engines"].items()
        },
        names,
    )


def _make_overview(document: Mapping[str, Any]) -> PageTable:
    rows = {
        name: {
            "step": entry["points"][-1]["step"] if entry["points"] else None,
            "error": entry["points"][-1]["position_error"] if entry["points"] else None,
            "limit": entry["richardson_error"],
            "moved": entry["richardson_uncertainty"],
            "eigenvalues": (entry["eigenvalues"] or {}).get("error"),
        }
        for name, entry in document["engines"].items()
    }
    orders = [entry["observed_order"] for entry in document["engines"].values()]
    return PageTable(
        caption="The limit is where the steps converge to, by Richardson's extrapolation, from the reference: an error "
        "that no smaller step removes; its last change is that by the last extrapolation, without the error of the "
        "reference itself. The reference's own steps are held against its ride at full accuracy. A dash "
        "stands where the steps show nothing.",
        head="engine",
        names=list(rows),
        columns=[
            number_column("finest step", "s", rows, "step", 2),
            number_column("error there", "m", rows, "error", 2),
            TableColumn("observed order", "", ["–" if order is None else f"{order:.2f}" for order in orders]),
            number_column("limit of the steps", "m", rows, "limit", 2),
            number_column("its last change", "m", rows, "moved", 2),
            number_column("error of its eigenvalues", "1/s", rows, "eigenvalues", 2),
        ],
    )


def _make_steps_table(name: str, entry: Mapping[str, Any]) -> PageTable:
    """Return the steps of an engine; an order stands at the third step of the three that show it."""
    steps = format_numbers([point["step"] for point in entry["points"]], 3)
    rows = dict(enumerate(entry["points"]))  # two steps may look the same
    orders = ["–", "–", *("–" if order is None else f"{order:.3f}" for order in entry["orders"])]
    return PageTable(
        caption=f"Steps of {name} that rode to the end.",
        head="step [s]",
        names=steps,
        columns=[
            *(number_column(title, unit, rows, key) for title, unit, key in _POINT_COLUMNS),
            TableColumn("order", "", [*orders, *("–" for _ in steps)][: len(steps)]),
        ],
    )


def _make_eigenvalue_table(name: str, found: Mapping[str, Any] | None) -> PageTable | None:
    if found is None:
        return None
    own, exact = ([format_complex(*pair, digits=6) for pair in found[key]] for key in ("values", "reference"))
    return PageTable(
        caption=f"Eigenvalues of the circle as rides of {name} show them [1/s], beside the reference's.",
        head="number",
        names=[f"{k + 1}" for k in range(len(own))],
        columns=[
            TableColumn("own", "1/s", own),
            TableColumn("reference", "1/s", exact),
            TableColumn("error", "1/s", format_numbers(found["errors"], 2)),
        ],
    )


def _describe_failure(failure: Mapping[str, Any]) -> str:
    what = "" if failure["step"] is None else f"step {failure['step']:g} s: "
    return f"{what}{failure['reason']}"
