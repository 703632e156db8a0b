"""Terminal output of `velodrome circular`, `families`, `critical` and `atlas`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from ..scenario import BENCHMARK
from .tables import Column, print_table


def show_bicycle_name(console: Console, document: Mapping[str, Any]) -> None:
    """Print the name of a document's bicycle, unless it is the benchmark, and what is remarkable about it."""
    name = document["bicycle"]["name"]
    if name != BENCHMARK:
        console.print(f"bicycle: {name or 'not the benchmark'}", markup=False, highlight=False, soft_wrap=True)
    for line in document["warnings"]:
        console.print(f"warning: {line}", style="yellow", markup=False, highlight=False, soft_wrap=True)


def show_circular(console: Console, found: dict[str, Any]) -> None:
    """Print a circular motion."""
    show_bicycle_name(console, found)
    table = Table(box=None, show_header=False, pad_edge=False)
    if found["alpha"] is not None:
        table.add_row("alpha", _format_value(found["alpha"]), "1/m")
    else:
        for name, value in found["surface"].items():
            table.add_row("surface" if name == "kind" else name, _format_value(value))
    # Only a straight motion has a yaw rate of exactly zero.
    unnumbered = "none: straight motion" if found["yaw_rate"] == 0 else "none of the benchmark's"
    table.add_row("family", unnumbered if found["family"] is None else str(found["family"]))
    for name, unit in (("steer_torque", "N m"), ("steer_damping", "N m s/rad")):
        if found["inputs"][name] != 0:
            table.add_row(name, _format_value(found["inputs"][name]), unit)
    for name, unit in (
        *(("rear_rate", "rad/s"), ("front_rate", "rad/s"), ("yaw_rate", "rad/s")),
        *(("lean", "rad"), ("steer", "rad"), ("pitch", "rad"), ("energy", "J"), ("residual", "")),
    ):
        table.add_row(name, f"{found[name]:.12g}", unit)
    table.add_row("position", _format_numbers(found["position"]), "m, D in the heading frame")
    for wheel in ("rear", "front"):
        table.add_row(f"{wheel} contact", _format_numbers(found["contact_point"][wheel]), "m")
        table.add_row(f"{wheel} force", _format_numbers(found["contact_force"][wheel]), "N, on the wheel")
        table.add_row(f"{wheel} normal force", f"{found['normal_force'][wheel]:.9g}", "N")
    for i, (real, imaginary) in enumerate(found["eigenvalues"]):
        value = (
            f"{real:.9g}" if imaginary == 0 else f"{real:.9g} {'+' if imaginary > 0 else '-'} {abs(imaginary):.9g} i"
        )
        table.add_row("eigenvalues" if i == 0 else "", value, "1/s" if i == 0 else "")
    console.print(table)
    stable = "Lyapunov stable" if found["lyapunov_stable"] else "unstable"
    console.print(stable)
    if found["physical"]:
        friction = f"{found['required_friction']:.6g}"
        console.print(f"it can be ridden: rolling needs a coefficient of friction of {friction}", soft_wrap=True)
    for reason in found["unphysical_because"]:
        console.print(f"it cannot be ridden: {reason}", style="yellow", markup=False, soft_wrap=True)


def _format_value(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def _format_numbers(values: list[float]) -> str:
    return ", ".join(f"{value:.9g}" for value in values)


def _make_number_columns(points: Sequence[Mapping[str, Any]], keys: Iterable[str]) -> list[Column]:
    """Return a column for each key, with nine decimals; a negative number that rounds to zero has no sign."""
    return [Column(key.replace("_", " "), [f"{point[key]:z.9f}" for point in points]) for key in keys]


def show_families(console: Console, document: Mapping[str, Any]) -> None:
    """Print the families: the ends, special points and stable sections of each."""
    show_bicycle_name(console, document)
    for family in document["families"]:
        points = family["points"]
        console.print(
            f"{_curve_name(family)}: {len(points['lean'])} points, from {family['ends'][0]} to {family['ends'][1]}",
            style="bold",
            markup=False,
            highlight=False,
        )
        specials = family["special_points"]
        if specials:
            columns = [
                Column("", list(specials), right=False),
                Column("kind", [point["kind"] for point in specials.values()], right=False),
                _make_physical_column(list(specials.values())),
            ]
            columns += _make_number_columns(list(specials.values()), ("rear_rate", "front_rate", "lean", "steer"))
            print_table(console, columns)
        for section in family["stable_sections"]:
            line = _format_section(section)
            style = "yellow" if section["rideable"] == "not" else "green"
            console.print(f"Lyapunov stable: rear rate {line}", style=style, markup=False, highlight=False)
            if section["rideable"] != "wholly":
                ridden = [_format_section(part) for part in section["rideable_parts"]]
                words = f"only {' and '.join(ridden)} of it can be ridden" if ridden else "none of it can be ridden"
                console.print(f"  {words}", style="yellow", markup=False, highlight=False, soft_wrap=True)
        if not all(points["physical"]):
            ridden = [_format_section(part) for part in family["rideable_parts"]]
            words = f"can be ridden: rear rate {', '.join(ridden)}" if ridden else "cannot be ridden"
            console.print(words, style="yellow", markup=False, highlight=False, soft_wrap=True)
    for number, reason in document["absent"].items():
        console.print(f"family {number}: no curve: {reason}", style="yellow", markup=False, soft_wrap=True)


def _format_section(section: Mapping[str, Any]) -> str:
    """Format the rear rates at both ends of a section, each with what ends it."""
    ends = zip(section["rear_rate"], section["cause"], strict=True)
    return " to ".join(f"{rate:z.9f} ({cause})" for rate, cause in ends)


def _make_physical_column(points: Sequence[Mapping[str, Any]]) -> Column:
    return Column("ridden", ["yes" if point["physical"] else "no" for point in points], right=False)


def _curve_name(family: Mapping[str, Any]) -> str:
    """Name a curve by the families on it."""
    if family["family"] is None:
        return "no family of the benchmark's"
    numbers = [family["family"], *family["joined_families"]]
    return f"famil{'ies' if len(numbers) > 1 else 'y'} {', '.join(map(str, numbers))}"


def show_critical(console: Console, document: Mapping[str, Any]) -> None:
    """Print the critical shapes of the bowl."""
    show_bicycle_name(console, document)
    collision = document["cusp_collision"]
    rows = [] if collision is None else [("2, 4", "cusps D, I meet", collision)]
    rows += [(", ".join(map(str, point["families"])), "curves touch", point) for point in document["merging"]]
    rows += [(n, "last stable", point) for n, point in document["last_stable"].items() if point is not None]
    if rows:
        families, what, points = zip(*rows, strict=True)
        columns = [
            Column("families", families, right=False),
            Column("what happens", what, right=False),
            Column("alpha", [f"{point['alpha']:.11f}" for point in points]),
            *_make_number_columns(points, ("rear_rate", "lean", "steer")),
            _make_physical_column(points),
        ]
        print_table(console, columns, keys=2)
        for point in points:
            for reason in point["unphysical_because"]:
                line = f"at alpha {point['alpha']:.11f} the motion cannot be ridden: {reason}"
                console.print(line, style="yellow", markup=False, highlight=False, soft_wrap=True)
    if collision is None:
        console.print("no cusps of families 2 and 4 meet", markup=False, highlight=False)
    for number, point in document["last_stable"].items():
        if point is None and number not in document["not_found"]:
            console.print(f"family {number} has no stable section", markup=False, highlight=False)
    _show_not_found(console, document["not_found"])
    _show_unnumbered_remark(console, document)


def _show_not_found(console: Console, reasons: Mapping[str, str]) -> None:
    for number, reason in reasons.items():
        line = f"family {number}: not followed: {reason}"
        console.print(line, style="yellow", markup=False, highlight=False, soft_wrap=True)


def _show_unnumbered_remark(console: Console, document: Mapping[str, Any]) -> None:
    """Say for another bicycle what is not looked at: the families are curves of the benchmark bicycle."""
    if document["bicycle"]["name"] != BENCHMARK:
        line = "curves without a number are not followed over alpha; velodrome families finds them at one alpha"
        console.print(line, style="yellow", markup=False, highlight=False, soft_wrap=True)


def show_atlas(console: Console, document: Mapping[str, Any], out: Path) -> None:
    """Print the stable regions of the atlas and the path of its folder."""
    show_bicycle_name(console, document)
    regions = document["stable"]
    ends = [region["vanishing"] for region in regions]
    columns = [
        Column("family", [str(region["family"]) for region in regions], right=False),
        Column("stable from alpha", [f"{region['alpha'][0]:g}" for region in regions]),
        Column("to alpha", [_format_end(region, document["alphas"][-1]) for region in regions]),
        Column("where at rear rate", ["" if end is None else f"{end['rear_rate']:.6f}" for end in ends]),
    ]
    if regions:
        print_table(console, columns)
    else:
        console.print("no family has a stable motion", markup=False, highlight=False)
    _show_not_found(console, _sum_up_absences(document))
    _show_unnumbered_remark(console, document)
    console.print(f"{document['motions']} motions in {out}", markup=False, highlight=False, soft_wrap=True)


def _format_end(region: Mapping[str, Any], largest: float) -> str:
    """Return the alpha at which a stable region vanishes; if that is not known, the last one at which it was found."""
    if region["vanishing"] is not None:
        return f"{region['vanishing']['alpha']:.10f}"
    last = region["alpha"][-1]
    return "and on" if last == largest else f"{last:g} at least"


def _sum_up_absences(document: Mapping[str, Any]) -> dict[str, str]:
    """Return a line for every family that is absent from an atlas at some alpha, with the first reason."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for entry in document["absent"]:
        found.setdefault(str(entry["family"]), []).append(entry)
    return {
        number: f"at {len(entries)} of {len(document['alphas'])} alpha from {entries[0]['alpha']:g} to "
        f"{entries[-1]['alpha']:g}: {entries[0]['reason']}"
        for number, entries in found.items()
    }
