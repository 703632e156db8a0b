"""Figure of a study of soft contacts: how much wheels creep, why, and the cost of reducing it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from velodrome.reports.drawing.palette import assign_colours
from velodrome.reports.figures.labels import Label, place_labels
from velodrome.reports.figures.style import FAMILY_COLOURS, GREY, INK, new_figure, use_style, write_figure

from .advice import beats, cost, label, rode

Row = Mapping[str, Any]
_DARKER = 0.72  # the engines' colours are chosen for a dark background
_GROUNDS = "os^D"
_HUES = tuple(FAMILY_COLOURS.values())
_WITHIN = 5.0  # half width of the band in which the law counts as met [%]


def creep_figure(path: Path, document: Mapping[str, Any]) -> None:
    """Write the figure.

    Parameters
    ----------
    path : Path
        Path of the file; its ending gives the format.
    document : mapping
        ``creep``: rows of the creep law by ground; ``energy``: rows of integrator, step and gain;
        ``settings``: choices by ground, of which those of the first ground are drawn.
    """
    with use_style():
        figure = new_figure(6.2)
        (creep, price), (deviation, energy) = figure.subplots(2, 2, height_ratios=(1.25, 1))
        _draw_creep(creep, document["creep"])
        _draw_deviation(deviation, document["creep"])
        _draw_energy(energy, document["energy"])
        ground, rows = next(iter(document["settings"].items()))
        _draw_price(price, rows, ground)
        for ax in (creep, price, deviation, energy):
            ax.grid(True)
        write_figure(path, figure)


def _set_title(ax: Axes, text: str) -> None:
    ax.set_title(text, loc="left", fontweight="bold")


def _hardest_friction(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with the hardest friction, one for each rate."""
    hardest = max(row["impratio"] for row in rows)
    return list({row["damping"]: row for row in rows if row["impratio"] == hardest}.values())


def _draw_creep(ax: Axes, grounds: Mapping[str, Sequence[Row]]) -> None:
    """Draw the slip over the contacts' rate, the mean of both wheels, and the law."""
    for n, (name, rows) in enumerate(grounds.items()):
        chosen = sorted(_hardest_friction(rows), key=lambda row: row["damping"])
        rate = np.array([row["damping"] for row in chosen])
        slip, law = (1e3 * np.array([np.mean(row[key]) for row in chosen]) for key in ("slip", "law"))
        if n == 0:
            ax.plot(rate, law, color=INK, lw=1, label="law: missing acceleration / b")
            for row, x, y in zip(chosen, rate, law, strict=True):
                text = f"{1e3 * row['time_constant']:g} ms"
                ax.annotate(text, (x, y), xytext=(5, 3), textcoords="offset points", color=GREY, fontsize=6.5)
        size = 6 - 2.5 * n  # markers that agree are drawn one inside the other
        ax.plot(rate, slip, ls="none", marker=_GROUNDS[n], ms=size, mfc="none", mew=1.2, color=_HUES[n], label=name)
    ax.margins(x=0.2)
    ax.set(xscale="log", yscale="log", xlabel="rate b of the contacts [1/s]", ylabel="slip [mm/s]")
    ax.legend(loc="lower left", title="grey: time constant (solref)", alignment="left", title_fontsize=7)
    _set_title(ax, "Wheels creep, in proportion to 1 / b")


def _draw_deviation(ax: Axes, grounds: Mapping[str, Sequence[Row]]) -> None:
    """Draw the measured slip over the law, and over the law with softness and sinking."""
    for n, rows in enumerate(grounds.values()):
        rate = [row["damping"] for row in rows for _ in range(2)]
        plain, whole = (
            [100 * (a / b - 1) for row in rows for a, b in zip(row["slip"], row[law], strict=True)]
            for law in ("law", "whole_law")
        )
        names = ("the law alone", "with softness and sinking") if n == 0 else (None, None)
        look: Any = {"ls": "none", "marker": _GROUNDS[n]}
        ax.plot(rate, plain, ms=4, mfc="none", mew=1, color=GREY, label=names[0], **look)
        ax.plot(rate, whole, ms=2.5, color=_HUES[2], label=names[1], **look)
    ax.axhspan(-_WITHIN, _WITHIN, color=_HUES[2], alpha=0.12, lw=0)
    _label_softness(ax, next(iter(grounds.values())))
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.2 * (high - low))  # room for the legend
    ax.set(xscale="log", xlabel="rate b of the contacts [1/s]", ylabel="measured / law − 1 [%]")
    ax.legend(loc="upper left", ncols=2, columnspacing=1.0, handletextpad=0.2)
    _set_title(ax, "Softness and sinking explain the rest")


def _label_softness(ax: Axes, rows: Sequence[Row]) -> None:
    """Label each impratio below its last points, separately for each wheel where the law alone is not met."""
    last = max(row["damping"] for row in rows)
    for row in {row["impratio"]: row for row in rows if row["damping"] == last}.values():
        high = {
            f", {wheel} wheel": 100 * (slip / law - 1)
            for wheel, slip, law in zip(("rear", "front"), row["slip"], row["law"], strict=True)
        }
        if max(map(abs, high.values())) < _WITHIN:
            high = {", both wheels": min(high.values())}
        for name, value in high.items():
            text = f"impratio {row['impratio']:g}{name}"
            ax.annotate(
                text, (last, value), xytext=(0, -12), textcoords="offset points", ha="right", color=GREY, fontsize=6.5
            )


def _draw_energy(ax: Axes, rows: Sequence[Row]) -> None:
    """Draw the energy that integrators add, over the step."""
    names = list(dict.fromkeys(row["integrator"] for row in rows))
    steps = sorted({1e3 * row["step"] for row in rows})
    first_order = []
    for n, name in enumerate(names):
        chosen = sorted((row for row in rows if row["integrator"] == name), key=lambda row: row["step"])
        step, gain = (np.array([row[key] for row in chosen]) for key in ("step", "gain"))
        order = np.log(abs(gain[-1] / gain[0])) / np.log(step[-1] / step[0])
        first_order += list(gain / (1e3 * step)) if round(order) == 1 else []
        look: Any = {"marker": _GROUNDS[n], "ms": 8 - 2 * n, "mfc": "none", "color": _HUES[n]}
        ax.plot(1e3 * step, abs(gain), lw=1, label=name, **look)
    if first_order:
        text, above = f"{np.median(first_order):.2g} W a millisecond of step", max(abs(row["gain"]) for row in rows)
        ax.text(steps[-1], above / 8, text, ha="right", va="top", color=GREY, fontsize=7)
    ax.set(xscale="log", yscale="log", xlabel="step [ms]", ylabel="power added [W]")
    ax.set_xticks(steps, [f"{step:g}" for step in steps])
    ax.minorticks_off()
    ax.legend(loc="center left")
    _set_title(ax, "First-order integrators add energy")


def _draw_price(ax: Axes, rows: Sequence[Row], ground: str) -> None:
    """Draw the slip over CPU time; choices that no other choice beats are full and labelled."""
    shades = assign_colours(dict.fromkeys(row["engine"] for row in rows))
    labels = []
    for engine in shades:
        shade: Any = tuple(_DARKER * part / 255 for part in shades[engine])
        for row in (row for row in rows if row["engine"] == engine and rode(row)):
            best = not any(beats(other, row) for other in rows)
            point = (1e3 * cost(row), 1e3 * row["slip"])
            ax.plot(*point, marker="o", ms=5, mfc=shade if best else "none", color=shade, ls="none")
            if best:
                labels.append(Label(label(row), point))
        fallen = [row for row in rows if row["engine"] == engine and not row["changed"] and not rode(row)]
        note = f", off its circle after {fallen[0]['ridden']:.2g} s as it is" if fallen else ""
        ax.plot([], [], marker="o", ms=5, color=shade, ls="none", label=engine + note)
    ax.set(xscale="log", yscale="log", xlabel="CPU time [ms a simulated second]", ylabel="slip [mm/s]")
    ax.margins(x=0.12)
    title = "full: no other choice beats it"
    ax.legend(
        loc="lower left", bbox_to_anchor=(0, 0.1), title=title, alignment="left", title_fontsize=7, handletextpad=0.2
    )
    _set_title(ax, f"What less slip costs, on {ground}")
    place_labels(ax, labels)
