"""Terminal output of `velodrome basin`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from .present_motions import show_bicycle_name
from .tables import Column, print_table
from .terminal import print_words


def show_basin(console: Console, document: Mapping[str, Any]) -> None:
    """Print the circle, the edges of its basin, and the shares of the map and of the sample."""
    print_words(console, f"{document['scenario']}: {document['title']}", "bold")
    show_bicycle_name(console, document)
    _show_circle(console, document)
    if document["fixed_energy"]:
        print_words(console, "the rear rate is solved for so that every disturbance keeps the energy")
    _show_edges(console, document)
    if document["map"] is not None:
        keys = (document["map"][axis]["key"] for axis in ("x", "y"))
        counts = document["map"]["outcomes"]
        print_words(console, f"map over {' and '.join(keys)}: {_list_counts(counts)}")
    if document["sample"] is not None:
        _show_sample(console, document["sample"])


def _show_circle(console: Console, document: Mapping[str, Any]) -> None:
    circle, (low, high) = document["circle"], document["stable_energies"]
    rate = -circle["slowest_eigenvalue"][0]
    print_words(
        console,
        f"circle of rear rate {circle['rear_rate']:.6g} rad/s, lean {circle['lean']:.6f} rad, energy "
        f"{circle['energy']:.3f} J; its slowest mode decays with {rate:.6f} 1/s; circles of its family are stable from "
        f"{low:.3f} to {high:.3f} J",
    )
    orbit = circle["orbit"]
    if orbit is None:
        print_words(console, "no unstable orbit of its energy is known", "yellow")
    else:
        print_words(
            console,
            f"stable within a lean amplitude of {orbit['lean_amplitude']:.6f} rad, that of an unstable orbit of period "
            f"{orbit['period']:.6f} s",
        )


def _show_edges(console: Console, document: Mapping[str, Any]) -> None:
    edges = document["edges"]
    columns = [
        Column("edge along", [_name_direction(edge["along"]) for edge in edges], right=False),
        Column("size", ["" if edge["size"] is None else f"{edge['size']:.6f}" for edge in edges]),
        Column("error", ["" if edge["error"] is None else f"{edge['error']:.0e}" for edge in edges]),
        Column("inside", [_name_outcome(edge["inside"]) for edge in edges], right=False),
        Column("decided", [_show_time(edge["inside"]) for edge in edges], "s"),
        Column("outside", [_name_outcome(edge["outside"]) for edge in edges], right=False),
        Column("at", [_show_time(edge["outside"]) for edge in edges], "s"),
        Column("leads to", [_name_state(edge["leads_to"]) for edge in edges], right=False),
        Column("of lean\namplitude", [_show_amplitude(edge["leads_to"]) for edge in edges], "rad"),
    ]
    print_table(console, columns)
    for edge in edges:
        name = _name_direction(edge["along"])
        if edge["survivors_beyond"]:
            sizes = ", ".join(f"{size:.4g}" for size in edge["survivors_beyond"])
            print_words(console, f"{name}: survived beyond the edge too: {sizes}", "yellow")
        if edge["outside"] is None:
            print_words(console, f"{name}: all of the scan survive, up to {edge['scan']['size'][-1]:.4g}", "yellow")
        elif edge["inside"] is None:
            print_words(console, f"{name}: none of the scan survives, from {edge['scan']['size'][0]:.4g} on", "yellow")


def _name_direction(along: Mapping[str, float]) -> str:
    if len(along) == 1:
        ((key, value),) = along.items()
        return f"{'-' if value < 0 else '+'}{key}" if abs(value) == 1 else f"{key}={value:g}"
    return ",".join(f"{key}={value:g}" for key, value in along.items())


def _name_outcome(side: Mapping[str, Any] | None) -> str:
    if side is None:
        return "none"
    return side["outcome"] + (f":{side['detail']}" if side["detail"] else "")


def _show_time(side: Mapping[str, Any] | None) -> str:
    return "" if side is None else f"{side['time']:.3f}"


def _name_state(state: Mapping[str, Any] | None) -> str:
    if state is None:
        return ""
    if not state["settled"]:
        return "undecided"
    if state["orbit"] is None:
        return "circle" if state["lean_amplitude"] < 1e-4 else "orbit-not-solved"
    return {True: "known-orbit", False: "another-orbit", None: "unknown-orbit"}[state["is_known"]]


def _show_amplitude(state: Mapping[str, Any] | None) -> str:
    return "" if state is None else f"{state['lean_amplitude']:.6f}"


def _list_counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in counts.items())


def _show_sample(console: Console, sample: Mapping[str, Any]) -> None:
    box = ", ".join(f"{key} up to {size:g}" for key, size in sample["reach"].items())
    print_words(
        console,
        f"drawn evenly from {box}: {sample['survived']} of {sample['rides']} survived, a share of "
        f"{sample['share']:.4f} with a standard error of {sample['error']:.4f}; {_list_counts(sample['outcomes'])}",
    )
    columns = [
        Column("energy change", [f"{part['energy_change'][0]:.2f}" for part in sample["by_energy"]], "from, J"),
        Column("", [f"{part['energy_change'][1]:.2f}" for part in sample["by_energy"]], "to, J"),
        Column("rides", [str(part["rides"]) for part in sample["by_energy"]]),
        Column("survived", [str(part["survived"]) for part in sample["by_energy"]]),
    ]
    print_table(console, columns, keys=2)
