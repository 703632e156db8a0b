"""Figure of an atlas: within which amplitude of the lean stable circular motions are stable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .atlas import draw_sides, list_kind_handles
from .labels import name_other_bicycle
from .style import FAMILY_COLOURS, INK, WIDTHS, new_figure


def within_figure(document: Mapping[str, Any], columns: int = 2) -> Figure:
    """Draw `stable_within` over alpha and rear rate, one panel per stable region; call within `use_style`.

    Parameters
    ----------
    document : mapping
        Of an atlas with the bounds of stable circles, as `velodrome atlas --within` writes it.
    columns : int
        Number of a journal's columns that the figure fills.

    Returns
    -------
    Figure
    """
    regions = list_bounded_regions(document)
    beside = columns == 2 and len(regions) > 1
    rows = 1 if beside else len(regions)
    figure = new_figure(1.2 + 2.7 * rows, WIDTHS[columns])
    panels = figure.subplots(rows, len(regions) if beside else 1, squeeze=False).ravel()
    if other := name_other_bicycle(document):
        figure.suptitle(other, x=0.01, ha="left", fontsize=9, parse_math=False)
    for axes, region in zip(panels, regions, strict=True):
        alpha, rate, bound = arrange_bounds(region["within"])
        # Colours lie between neighbouring circles and bowls; where a bound is not known there is none.
        drawn = axes.pcolormesh(alpha, rate, np.ma.masked_invalid(bound), cmap="viridis", vmin=0, shading="gouraud")
        bar = figure.colorbar(drawn, ax=axes, pad=0.02)
        bar.set_label("stable within, lean amplitude $A$ [rad]")
        draw_sides(axes, region, "rear_rate", INK, 1.2)
        axes.set_title(f"family {region['family']}", loc="left", color=FAMILY_COLOURS[region["family"]])
        axes.set(xlabel="shape of the bowl $α$ [1/m]", ylabel="rear-wheel rate $ω_r$ [rad/s]")
        axes.set_xlim(left=0)
        axes.xaxis.set_major_locator(MaxNLocator(4))
    handles = list(list_kind_handles(regions))
    figure.legend(handles=handles, loc="outside lower center", ncols=2 if columns == 2 else 1)
    return figure


def list_bounded_regions(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the stable regions of an atlas' document of which bounds can be drawn: of two bowls at least."""
    return [
        region
        for region in document["stable"]
        if sum(any(value is not None for value in row["stable_within"]) for row in region["within"] or []) > 1
    ]


def arrange_bounds(rows: Sequence[Mapping[str, Any]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return alpha, rear rate and bound (k, n), nan where it is not known, of the n circles of each of k bowls."""
    known = [row for row in rows if row["stable_within"]]
    rate = np.array([row["rear_rate"] for row in known])
    bound = np.array([row["stable_within"] for row in known], float)
    return np.repeat([[row["alpha"]] for row in known], rate.shape[1], axis=1), rate, bound
