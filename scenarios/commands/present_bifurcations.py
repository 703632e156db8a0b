"""Terminal output of `velodrome bifurcations`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console

from .present_motions import show_bicycle_name, show_bounds
from .tables import Column, print_table
from .terminal import print_words


def show_bifurcations(console: Console, document: Mapping[str, Any]) -> None:
    """Print the Hopf points, then the orbits born at each."""
    show_bicycle_name(console, document)
    points = document["hopf"]
    if points:
        names = _name_points(points)
        columns = [
            Column("Hopf point", names, right=False),
            Column("family", [str(point["family"] or "none") for point in points], right=False),
            Column("ends stable\nsection", [_say(point["ends_stable_section"]) for point in points], right=False),
            Column("ridden", [_say(point["physical"]) for point in points], right=False),
            Column("rear rate", [f"{point['rear_rate']:.6f}" for point in points], "rad/s"),
            Column("lean", [f"{point['lean']:z.6f}" for point in points], "rad"),
            Column("steer", [f"{point['steer']:z.6f}" for point in points], "rad"),
            Column("energy", [f"{point['energy']:.5f}" for point in points], "J"),
            Column("frequency", [f"{point['frequency']:.6f}" for point in points], "rad/s"),
            Column("criticality", [point["criticality"] or "undefined" for point in points], right=False),
            Column("d(A²)/dE", [_show_slope(point["amplitude_slope"]) for point in points], "rad²/J"),
        ]
        print_table(console, columns)
        for name, point in zip(names, points, strict=True):
            _show_branch(console, name, point)
    else:
        console.print("no Hopf point", markup=False)
    for section in document["stable_sections"]:
        _show_section(console, section)
    if document["no_engines_because"] is not None:
        print_words(console, f"no ends of engines are measured: {document['no_engines_because']}", "yellow")
    _show_engines(console, document["engines"])
    for number, reason in document["absent"].items():
        print_words(console, f"family {number}: no curve: {reason}", "yellow")


def _name_points(points: Sequence[Mapping[str, Any]]) -> list[str]:
    return [f"H{k}" for k in range(1, len(points) + 1)]


def _say(value: bool) -> str:
    return "yes" if value else "no"


def _show_slope(slope: float | None) -> str:
    return "" if slope is None else f"{slope:z.6e}"


def _show_branch(console: Console, name: str, point: Mapping[str, Any]) -> None:
    """Print the orbits of a branch and its bifurcations."""
    if point["no_orbits_because"] is not None:
        print_words(console, f"{name}: no orbits: {point['no_orbits_because']}", "yellow")
        return
    print_words(console, f"{name}: orbits, A half of the peak-to-peak of the lean", "bold")
    rows = [("orbit", orbit) for orbit in point["orbits"]]
    rows += [(event["kind"], event) for event in point["orbit_bifurcations"]]
    orbits = [orbit for _, orbit in rows]
    columns = [
        Column("A", [f"{orbit['lean_amplitude']:.9f}" for orbit in orbits], "rad"),
        Column("", [kind for kind, _ in rows], right=False),
        Column("energy", [f"{orbit['energy']:.6f}" for orbit in orbits], "J"),
        Column("period", [f"{orbit['period']:.9f}" for orbit in orbits], "s"),
        Column("largest\nmultiplier", [f"{_largest_multiplier(orbit):.9f}" for orbit in orbits]),
        Column("ridden", [_say(orbit["physical"]) if "physical" in orbit else "" for orbit in orbits], right=False),
    ]
    print_table(console, columns, keys=2)
    print_words(console, f"  {_END_WORDS[point['branch_end']]}")


def _show_section(console: Console, section: Mapping[str, Any]) -> None:
    """Print the circles of a stable section with the amplitude within which they are stable."""
    name = "a curve without a number" if section["family"] is None else f"family {section['family']}"
    show_bounds(console, f"stable section of {name}", section)


def _show_engines(console: Console, ends: Sequence[Mapping[str, Any]]) -> None:
    """Print where engines' own stable sections end."""
    if not ends:
        return
    print_words(console, "where engines' own stable sections end, from the reference's Hopf point", "bold")
    found = [end for end in ends if end["failed_because"] is None]
    if found:
        columns = [
            Column("engine", [end["engine"] for end in found], right=False),
            Column("Hopf point", [f"H{end['hopf'] + 1}" for end in found], right=False),
            Column("step", [f"{end['step']:.6f}" for end in found], "s"),
            Column("rear rate", [f"{end['rear_rate']:.6f}" for end in found], "rad/s"),
            Column("shift", [f"{end['shift']:z.4e}" for end in found], "rad/s"),
            Column("its error", [f"{end['error']:.0e}" for end in found], "rad/s"),
            Column("law", ["" if end["law"] is None else f"{end['law']:z.4e}" for end in found], "rad/s"),
            Column("shift / law", ["" if end["law"] is None else f"{end['shift'] / end['law']:.4f}" for end in found]),
        ]
        print_table(console, columns, keys=3)
    for end in ends:
        if end["failed_because"] is not None:
            where = f"{end['engine']}, H{end['hopf'] + 1}, {end['step']:g} s"
            print_words(console, f"{where}: {end['failed_because']}", "yellow")


_END_WORDS = {
    "hopf": "the branch ends at another Hopf point",
    "largest": "the branch goes on to larger orbits",
    "flat": "the branch goes on to orbits on which the bicycle lies nearly flat",
    "lost": "no further orbit is found",
    "unfinished": "the branch goes on",
}


def _largest_multiplier(orbit: Mapping[str, Any]) -> float:
    """Return the size of the largest multiplier but those of time and energy, which come first."""
    return max(abs(complex(*value)) for value in orbit["multipliers"][2:])
