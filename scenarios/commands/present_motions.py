"""Terminal output of `velodrome circular`, `families`, `critical` and `atlas`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ...reference.stability import are_zero
from ..motions import NOT_SEARCHED
from ..scenario import BENCHMARK
from .tables import Column, print_table
from .terminal import print_line, print_words

_UNITS = {"rear_rate": "rad/s", "front_rate": "rad/s", "lean": "rad", "steer": "rad"}


def show_bicycle_name(console: Console, document: Mapping[str, Any]) -> None:
    """Print the name of a document's bicycle, unless it is the benchmark, and what is remarkable about it."""
    name = document["bicycle"]["name"]
    if name != BENCHMARK:
        print_words(console, f"bicycle: {name or 'not the benchmark'}")
    for line in document["warnings"]:
        print_words(console, f"warning: {line}", "yellow")


def show_circular(console: Console, found: dict[str, Any]) -> None:
    """Print a circular motion."""
    show_bicycle_name(console, found)
    rows: list[tuple[str, str, str]] = []  # name, value, unit
    if found["alpha"] is not None:
        rows.append(("alpha", _format_value(found["alpha"]), "1/m"))
    else:
        rows += [("surface" if name == "kind" else name, _format_value(v), "") for name, v in found["surface"].items()]
    # Only a straight motion has a yaw rate of exactly zero.
    unnumbered = "none: straight motion" if found["yaw_rate"] == 0 else "none of the benchmark's"
    rows.append(("family", unnumbered if found["family"] is None else str(found["family"]), ""))
    for name, unit in (("steer_torque", "N m"), ("steer_damping", "N m s/rad")):
        if found["inputs"][name] != 0:
            rows.append((name, _format_value(found["inputs"][name]), unit))
    for name, unit in (
        *(("rear_rate", "rad/s"), ("front_rate", "rad/s"), ("yaw_rate", "rad/s")),
        *(("lean", "rad"), ("steer", "rad"), ("pitch", "rad"), ("energy", "J")),
    ):
        rows.append((name, f"{found[name]:.12g}", unit))
    rows.append(("residual", f"{found['residual']:.2g}", ""))
    for wheel in ("rear", "front"):
        rows.append((f"{wheel} normal force", f"{found['normal_force'][wheel]:.9g}", "N"))
    rows += [
        ("eigenvalues" if k == 0 else "", value, "1/s" if k == 0 else "")
        for k, value in enumerate(_format_eigenvalues(found["eigenvalues"]))
    ]
    _print_rows(console, rows)
    console.print("in the heading frame; forces are those on the wheels", style="dim")
    vectors = {"D [m]": found["position"]}
    for wheel in ("rear", "front"):
        vectors[f"{wheel} contact [m]"] = found["contact_point"][wheel]
    for wheel in ("rear", "front"):
        vectors[f"{wheel} force [N]"] = found["contact_force"][wheel]
    components = [_format_vector(vector) for vector in vectors.values()]
    columns = [Column("", list(vectors), right=False)]
    columns += [Column(axis, [cells[k] for cells in components]) for k, axis in enumerate("xyz")]
    print_table(console, columns)
    print_words(console, _describe_stability(found))
    if found["physical"]:
        friction = f"{found['required_friction']:.6g}"
        print_words(console, f"it can be ridden: rolling needs a coefficient of friction of {friction}")
    for reason in found["unphysical_because"]:
        print_words(console, f"it cannot be ridden: {reason}", "yellow")


def _describe_stability(found: Mapping[str, Any]) -> str:
    """Say whether a motion is stable, and within what; stability by eigenvalues holds for small disturbances only."""
    if not found["lyapunov_stable"]:
        return "unstable"
    bound = found["stable_within"]
    if bound is not None:
        return f"Lyapunov stable, within {bound:.4g} rad ({math.degrees(bound):.3g} deg) of lean"
    why = found["no_bound_because"]
    if why == NOT_SEARCHED:
        return "Lyapunov stable: small disturbances die out; --within finds how large they may be"
    return f"Lyapunov stable: small disturbances die out; it is not known how large they may be: {why}"


def _print_rows(console: Console, rows: Sequence[tuple[str, str, str]]) -> None:
    """Print names, values and units, each row in one line."""
    table = Table(box=None, show_header=False, pad_edge=False)
    for _ in range(3):
        table.add_column(no_wrap=True)
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    console.print(table)


def _format_eigenvalues(values: Sequence[Sequence[float]]) -> list[str]:
    """Format eigenvalues, each pair in one line; one that is zero but for round-off is 0."""
    numbers = np.array([complex(*value) for value in values])
    numbers[are_zero(numbers)] = 0
    lines = [f"{value.real:z.9g}" for value in numbers if value.imag == 0]
    lines += [f"{value.real:.9g} ± {value.imag:.9g}i" for value in numbers if value.imag > 0]
    return lines


def _format_vector(values: Sequence[float]) -> list[str]:
    """Format a vector to nine digits of its largest component, below which digits may be round-off."""
    largest = max(map(abs, values))
    decimals = 8 - math.floor(math.log10(largest)) if largest > 0 else 0
    return [f"{value:z.{max(decimals, 0)}f}" for value in values]


def _format_value(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def _make_number_columns(points: Sequence[Mapping[str, Any]], keys: Iterable[str]) -> list[Column]:
    """Return a column for each key, with nine decimals; a negative number that rounds to zero has no sign."""
    return [Column(key.replace("_", " "), [f"{point[key]:z.9f}" for point in points], _UNITS[key]) for key in keys]


def show_families(console: Console, document: Mapping[str, Any]) -> None:
    """Print the families: the ends, special points and stable sections of each."""
    show_bicycle_name(console, document)
    for family in document["families"]:
        points = family["points"]
        print_words(
            console,
            f"{_curve_name(family)}: {len(points['lean'])} points, from {family['ends'][0]} to {family['ends'][1]}",
            "bold",
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
            print_words(console, f"Lyapunov stable: rear rate {line}", style)
            if section["rideable"] != "wholly":
                ridden = [_format_section(part) for part in section["rideable_parts"]]
                words = f"only {' and '.join(ridden)} of it can be ridden" if ridden else "none of it can be ridden"
                print_words(console, f"  {words}", "yellow")
            if section["within"] is not None:
                show_bounds(console, "stable", section["within"])
        if not all(points["physical"]):
            ridden = [_format_section(part) for part in family["rideable_parts"]]
            words = f"can be ridden: rear rate {', '.join(ridden)}" if ridden else "cannot be ridden"
            print_words(console, words, "yellow")
    if any(section["within"] is None for family in document["families"] for section in family["stable_sections"]):
        print_words(console, "Lyapunov stable: small disturbances die out; --within finds how large they may be", "dim")
    for number, reason in document["absent"].items():
        print_words(console, f"family {number}: no curve: {reason}", "yellow")


def show_bounds(console: Console, name: str, within: Mapping[str, Any]) -> None:
    """Print the circles of a named stable section with the lean amplitudes within which they are stable."""
    if within["no_circles_because"] is not None:
        print_words(console, f"{name}: {within['no_circles_because']}", "yellow")
        return
    print_words(console, f"{name}: within the lean amplitude of an unstable orbit", "bold")
    bounds = within["stable_within"]
    columns = [
        Column("rear rate", [f"{value:.6f}" for value in within["rear_rate"]], "rad/s"),
        Column("lean", [f"{value:z.6f}" for value in within["lean"]], "rad"),
        Column("steer", [f"{value:z.6f}" for value in within["steer"]], "rad"),
        Column("energy", [f"{value:.5f}" for value in within["energy"]], "J"),
        Column("stable within", ["" if bound is None else f"{bound:.9f}" for bound in bounds], "rad"),
    ]
    print_table(console, columns)


def _format_section(section: Mapping[str, Any]) -> str:
    """Format the rear rates at both ends of a section, each with what ends it."""
    ends = zip(section["rear_rate"], section["cause"], strict=True)
    return " to ".join(f"{rate:z.9f} rad/s ({cause})" for rate, cause in ends)


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
            Column("alpha", [f"{point['alpha']:.11f}" for point in points], "1/m"),
            *_make_number_columns(points, ("rear_rate", "lean", "steer")),
            _make_physical_column(points),
        ]
        print_table(console, columns, keys=2)
        for point in points:
            for reason in point["unphysical_because"]:
                line = f"at alpha {point['alpha']:.11f} the motion cannot be ridden: {reason}"
                print_words(console, line, "yellow")
    if collision is None:
        console.print("no cusps of families 2 and 4 meet", markup=False)
    for number, point in document["last_stable"].items():
        if point is None and number not in document["not_found"]:
            console.print(f"family {number} has no stable section", markup=False)
    _show_not_found(console, document["not_found"])
    _show_unnumbered_remark(console, document)


def _show_not_found(console: Console, reasons: Mapping[str, str]) -> None:
    for number, reason in reasons.items():
        line = f"family {number}: not followed: {reason}"
        print_words(console, line, "yellow")


def _show_unnumbered_remark(console: Console, document: Mapping[str, Any]) -> None:
    """Say for another bicycle what is not looked at: the families are curves of the benchmark bicycle."""
    if document["bicycle"]["name"] != BENCHMARK:
        line = "curves without a number are not followed over alpha; velodrome families finds them at one alpha"
        print_words(console, line, "yellow")


def show_atlas(console: Console, document: Mapping[str, Any], out: Path) -> None:
    """Print the stable regions of the atlas and the path of its folder."""
    show_bicycle_name(console, document)
    regions = document["stable"]
    ends = [region["vanishing"] for region in regions]
    columns = [
        Column("family", [str(region["family"]) for region in regions], right=False),
        Column("stable from alpha", [f"{region['alpha'][0]:g}" for region in regions], "1/m"),
        Column("to alpha", [_format_end(region, document["alphas"][-1]) for region in regions], "1/m"),
        Column("where at rear rate", ["" if end is None else f"{end['rear_rate']:.6f}" for end in ends], "rad/s"),
    ]
    if regions:
        print_table(console, columns)
        for region in regions:
            _show_sides(console, region)
    else:
        console.print("no family has a stable motion", markup=False)
    _show_not_found(console, _sum_up_absences(document))
    _show_unnumbered_remark(console, document)
    print_line(console, f"{document['motions']} motions in {out}")


def _show_sides(console: Console, region: Mapping[str, Any]) -> None:
    """Print what ends the stable sections of a region as alpha grows, and within what their circles are stable."""
    from ...reports.drawing import describe_end_kinds  # other tables of motions do not need drawings

    for side in ("start", "end"):
        words = f"family {region['family']}, {side} of stable sections: {describe_end_kinds(region[side])}"
        turns = [point for point in region["bautin"] if point["side"] == side]
        places = [f"alpha {point['alpha']:.12f}, rear rate {point['rear_rate']:.6f} rad/s" for point in turns]
        print_words(console, "\n  Bautin point at ".join([words, *places]))
    if region["within"] is not None:
        known = [bound for row in region["within"] for bound in row["stable_within"] if bound is not None]
        words = f"circles are stable within {min(known):.6f} to {max(known):.6f} rad" if known else "no bound is known"
        print_words(console, f"family {region['family']}: {words}, in {len(region['within'])} bowls")


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
