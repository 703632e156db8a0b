"""The page of the families of circular motions, as one self-contained HTML document without a script."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from . import words
from .curve_chart import draw_plane
from .document import list_engine_styles, render_page
from .tables import PageTable, TableColumn

_POINT_COLUMNS = (
    ("rear rate", "rad/s", "rear_rate"),
    ("front rate", "rad/s", "front_rate"),
    ("lean", "rad", "lean"),
    ("steer", "rad", "steer"),
)


def make_families_page(document: Mapping[str, Any], libraries: Mapping[str, str]) -> str:
    """Write the page of the families of circular motions on one ground.

    Parameters
    ----------
    document : mapping
        As `velodrome families --json` prints it.
    libraries : mapping of str to str
        Versions by name.

    Returns
    -------
    str
        A self-contained HTML document. All text is escaped.
    """
    families = {_name_curve(family, k): family for k, family in enumerate(document["families"])}
    names = list(families)
    return render_page(
        "families.html",
        document=document,
        made={"libraries": libraries, "platform": {}},
        facts=_list_facts(document),
        engines=list_engine_styles(names),
        headline=_write_headline(families),
        figures=[
            (across, up, _draw(families, x, y))
            for across, up, x, y in (
                ("steer [rad]", "Lean", "steer", "lean"),
                ("rear rate [rad/s]", "Lean", "rear_rate", "lean"),
            )
        ]
        if names
        else [],
        table=_make_overview(families),
        parts=[
            {"name": name, "sections": _list_sections(family), "table": _make_points_table(name, family)}
            for name, family in families.items()
        ],
    )


def _name_curve(family: Mapping[str, Any], k: int) -> str:
    """Name a curve by the families on it, or by its number where it is none of the benchmark's."""
    if family["family"] is None:
        return f"curve {k + 1}"
    numbers = [family["family"], *family["joined_families"]]
    return f"famil{'ies' if len(numbers) > 1 else 'y'} {', '.join(map(str, numbers))}"


def _list_facts(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    alpha = document["alpha"]
    ground = document["surface"] if alpha is None else {"kind": "paraboloid", "alpha": alpha}
    inputs = {name: value for name, value in document["inputs"].items() if value != 0}
    return [
        ("Ground", words.describe_ground(ground)),
        ("Bicycle", document["bicycle"]["name"] or "not the benchmark"),
        ("Inputs", ", ".join(f"{name.replace('_', ' ')} {value:g}" for name, value in inputs.items()) or "none"),
    ]


def _write_headline(families: Mapping[str, Mapping[str, Any]]) -> str:
    """Return which families have stable sections, and whether these can be ridden."""
    told = []
    for name, family in families.items():
        for section in family["stable_sections"]:
            ends = " to ".join(f"{rate:.4g}" for rate in sorted(section["rear_rate"]))
            ridden = {"wholly": "", "partly": ", of which a part can be ridden", "not": ", which cannot be ridden"}
            told.append(f"{name} from a rear rate of {ends} rad/s{ridden[section['rideable']]}")
    if not told:
        return "No circular motion here is Lyapunov stable."
    return f"Lyapunov stable: {'; '.join(told)}."


def _draw(families: Mapping[str, Mapping[str, Any]], x: str, y: str) -> dict[str, Any]:
    curves, strong, spots = {}, {}, []
    for name, family in families.items():
        points = family["points"]
        across, up = np.array(points[x], float), np.array(points[y], float)
        curves[name] = (across, up)
        strong[name] = [
            (_follow_section(section, points, x), _follow_section(section, points, y))
            for section in family["stable_sections"]
        ]
        spots += [(name, point[x], point[y], f"{title} of {name}") for title, point in family["special_points"].items()]
    return draw_plane(curves, list(families), strong=strong, spots=spots)


def _follow_section(section: Mapping[str, Any], points: Mapping[str, Any], key: str) -> np.ndarray:
    """Return a coordinate along a stable section: its ends, which are no points of the curve, and those between."""
    lean = np.array(points["lean"], float)
    least, largest = sorted(section["lean"])
    between = np.array(points["lyapunov_stable"], bool) & (lean > least) & (lean < largest)
    return np.array([section[key][0], *np.array(points[key], float)[between], section[key][1]])


def _make_overview(families: Mapping[str, Mapping[str, Any]]) -> PageTable:
    rows = list(families.values())
    return PageTable(
        caption="The curves of circular motions, each from one end to the other.",
        head="curve",
        names=list(families),
        columns=[
            TableColumn("from", "", [row["ends"][0] for row in rows], words=True),
            TableColumn("to", "", [row["ends"][1] for row in rows], words=True),
            TableColumn("motions", "", [str(len(row["points"]["lean"])) for row in rows]),
            TableColumn("of them stable", "", [str(sum(row["points"]["lyapunov_stable"])) for row in rows]),
            TableColumn("can be ridden", "", [str(sum(row["points"]["physical"])) for row in rows]),
        ],
    )


def _list_sections(family: Mapping[str, Any]) -> list[str]:
    """Return the stable sections of a curve, and the parts of it that can be ridden, in words."""
    lines = [f"Lyapunov stable: rear rate {_describe_ends(section)}" for section in family["stable_sections"]]
    if not all(family["points"]["physical"]):
        parts = [_describe_ends(part) for part in family["rideable_parts"]]
        lines.append(f"can be ridden: rear rate {', '.join(parts)}" if parts else "cannot be ridden")
    return lines


def _describe_ends(section: Mapping[str, Any]) -> str:
    ends = zip(section["rear_rate"], section["cause"], strict=True)
    return " to ".join(f"{rate:.6g} rad/s ({cause})" for rate, cause in ends)


def _make_points_table(name: str, family: Mapping[str, Any]) -> PageTable | None:
    points = family["special_points"]
    if not points:
        return None
    return PageTable(
        caption=f"Special points of {name}: where its curve turns, ends or changes.",
        head="point",
        names=list(points),
        columns=[
            TableColumn("kind", "", [point["kind"] for point in points.values()], words=True),
            TableColumn("can be ridden", "", ["yes" if point["physical"] else "no" for point in points.values()]),
            *(
                TableColumn(title, unit, [f"{point[key]:z.9f}" for point in points.values()])
                for title, unit, key in _POINT_COLUMNS
            ),
        ],
    )
