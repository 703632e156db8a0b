"""The page of an atlas of circular motions, as one self-contained HTML document without a script."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..drawing import describe_end_kinds
from .curve_chart import draw_plane
from .document import list_engine_styles, render_page
from .tables import PageTable, TableColumn


def make_atlas_page(document: Mapping[str, Any], libraries: Mapping[str, str]) -> str:
    """Write the page of an atlas.

    Parameters
    ----------
    document : mapping
        As `velodrome atlas --json` prints it.
    libraries : mapping of str to str
        Versions by name.

    Returns
    -------
    str
        A self-contained HTML document. All text is escaped.
    """
    regions = _name_regions(document["stable"])
    return render_page(
        "atlas.html",
        document=document,
        made={"libraries": libraries, "platform": {}},
        facts=[
            ("Bicycle", document["bicycle"]["name"] or "not the benchmark"),
            ("Bowls", f"{len(document['alphas'])}, alpha up to {document['alphas'][-1]:g} 1/m"),
            ("Motions", str(document["motions"])),
        ],
        engines=list_engine_styles(list(regions)),
        headline=_write_headline(regions, document["alphas"][-1]),
        drawn=_draw(regions) if regions else None,
        table=_make_table(regions, document["alphas"][-1]),
        remarks=[
            *document["warnings"],
            *(
                f"{name}: the {point['side']} of its stable sections changes its criticality at alpha "
                f"{point['alpha']:.6g} 1/m, rear rate {point['rear_rate']:.6g} rad/s (Bautin point)"
                for name, region in regions.items()
                for point in region["bautin"]
            ),
            *(
                f"families {' and '.join(map(str, point['families']))} touch at alpha {point['alpha']:.6g} 1/m, "
                f"rear rate {point['rear_rate']:.6g} rad/s"
                for point in document["touching"]
            ),
            *_sum_up_absences(document),
        ],
    )


def _name_regions(regions: Sequence[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Return regions by the name of their family, with a number where a family has several."""
    named: dict[str, Mapping[str, Any]] = {}
    for k, region in enumerate(regions):
        own = [other for other in regions if other["family"] == region["family"]]
        earlier = sum(other["family"] == region["family"] for other in regions[:k])
        number = f", region {earlier + 1}" if len(own) > 1 else ""
        named[f"family {region['family']}{number}"] = region
    return named


def _write_headline(regions: Mapping[str, Mapping[str, Any]], largest: float) -> str:
    """Return up to which alpha each family has stable motions."""
    if not regions:
        return "No family has a Lyapunov stable motion."
    ends = [f"{name} {_describe_end(region, largest)}" for name, region in regions.items()]
    return f"Lyapunov stable motions: {'; '.join(ends)}."


def _describe_end(region: Mapping[str, Any], largest: float) -> str:
    """Return up to where a region goes; where it vanishes is not known if the last bowls have no motion of it."""
    if region["vanishing"] is not None:
        return f"up to alpha {region['vanishing']['alpha']:.6g} 1/m"
    last = region["alpha"][-1]
    return "up to the last bowl" if last == largest else f"up to alpha {last:g} 1/m at least"


def _draw(regions: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    curves, spots = {}, []
    for name, region in regions.items():
        end = region["vanishing"]
        tip = [] if end is None else [(end["alpha"], end["rear_rate"])]
        sides = [list(zip(region["alpha"], region[side]["rear_rate"], strict=True)) for side in ("start", "end")]
        outline = np.array([*sides[0], *tip, *reversed(sides[1])])
        curves[name] = (outline[:, 0], outline[:, 1])
        spots += [(name, alpha, rate, f"the last stable motion of {name}") for alpha, rate in tip]
        turns = [(point["alpha"], point["rear_rate"]) for point in region["bautin"]]
        spots += [(name, alpha, rate, f"Bautin point of {name}") for alpha, rate in turns]
    return draw_plane(curves, list(regions), spots=spots)


def _make_table(regions: Mapping[str, Mapping[str, Any]], largest: float) -> PageTable:
    rows = list(regions.values())
    ends = [row["vanishing"] for row in rows]
    return PageTable(
        caption="Stable regions; for both sides of a region stands what ends it, from the first bowl on: a Hopf point "
        "by its criticality, if that is defined.",
        head="family",
        names=list(regions),
        columns=[
            TableColumn("stable from alpha", "1/m", [f"{row['alpha'][0]:g}" for row in rows]),
            TableColumn("how far", "", [_describe_end(row, largest) for row in rows], words=True),
            TableColumn(
                "where, rear rate", "rad/s", ["–" if end is None else f"{end['rear_rate']:.6f}" for end in ends]
            ),
            *(
                TableColumn(f"{side} of sections", "", [describe_end_kinds(row[side]) for row in rows], words=True)
                for side in ("start", "end")
            ),
        ],
    )


def _sum_up_absences(document: Mapping[str, Any]) -> list[str]:
    """Return a line for every family that is absent from an atlas at some alpha, with the first reason."""
    found: dict[int, list[Mapping[str, Any]]] = {}
    for entry in document["absent"]:
        found.setdefault(entry["family"], []).append(entry)
    return [
        f"family {number} was not followed in {len(entries)} of {len(document['alphas'])} bowls, alpha "
        f"{entries[0]['alpha']:g} to {entries[-1]['alpha']:g} 1/m: {entries[0]['reason']}"
        for number, entries in found.items()
    ]
