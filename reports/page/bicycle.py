"""The page of a bicycle, as one self-contained HTML document without a script."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .curve_chart import draw_plane
from .document import list_engine_styles, render_page
from .tables import PageTable, TableColumn, format_complex

_REAL_PARTS = (-10.0, 10.0)  # [1/s]: beyond, the castering mode is alone
_ROWS = 11  # speeds of the table of eigenvalues, at most


def make_bicycle_page(document: Mapping[str, Any], units: Mapping[str, str], libraries: Mapping[str, str]) -> str:
    """Write the page of a bicycle.

    Parameters
    ----------
    document : mapping
        As `velodrome bicycle --json` prints it.
    units : mapping of str to str
        Units of the parameters.
    libraries : mapping of str to str
        Versions by name.

    Returns
    -------
    str
        A self-contained HTML document. All text is escaped.
    """
    modes = _number_modes(document["modes"]["names"])
    return render_page(
        "bicycle.html",
        document=document,
        made={"libraries": libraries, "platform": {}},
        facts=[
            ("Convention", document["convention"]),
            ("Steer damping", f"{document['steer_damping']:g} N m s/rad"),
            ("Weave speed", _format_speed(document, "weave")),
            ("Capsize speed", _format_speed(document, "capsize")),
        ],
        engines=list_engine_styles(modes),
        headline=_write_headline(document),
        drawn=_draw(document, modes),
        table=_make_eigenvalue_table(document),
        parameters=_make_parameter_table(document, units),
        canonical=document["canonical"],
    )


def _number_modes(names: Sequence[str]) -> list[str]:
    """Return names of modes, both branches of a pair with their number."""
    return [
        f"{name} {list(names[: k + 1]).count(name)}" if list(names).count(name) > 1 else name
        for k, name in enumerate(names)
    ]


def _format_speed(document: Mapping[str, Any], mode: str) -> str:
    speed, deviation = document[f"{mode}_speed"], document["speed_deviations"].get(mode)
    spread = f" ± {deviation:.2g}" if deviation else ""
    return "none" if speed is None else f"{speed:.6g}{spread} m/s"


def _write_headline(document: Mapping[str, Any]) -> str:
    """Return at which speeds upright riding is stable, and where each mode changes."""
    ranges = [
        f"above {start:.4g} m/s" if end is None else f"from {start:.4g} to {end:.4g} m/s"
        for start, end in document["stable_speeds"]
    ]
    told = f"Upright riding is stable {' and '.join(ranges)}." if ranges else "Upright riding is stable at no speed."
    changes = [
        f"{change['mode']} becomes {'stable' if change['stabilises'] else 'unstable'} at {change['speed']:.4g} m/s"
        for change in document["stability_changes"]
    ]
    return f"{told} {'; '.join(changes).capitalize()}." if changes else told


def _draw(document: Mapping[str, Any], modes: list[str]) -> dict[str, Any] | None:
    speeds = np.array(document["speeds"])
    if len(speeds) < 2:
        return None
    values = np.array(document["modes"]["eigenvalues"])[:, :, 0]
    stable = [(start, math.inf if end is None else end) for start, end in document["stable_speeds"]]
    return draw_plane(
        {mode: (speeds, values[:, k]) for k, mode in enumerate(modes)},
        modes,
        box=(float(speeds[0]), float(speeds[-1]), *_REAL_PARTS),
        bands=stable,
    )


def _make_eigenvalue_table(document: Mapping[str, Any]) -> PageTable:
    speeds = document["speeds"]
    chosen = np.unique(np.linspace(0, len(speeds) - 1, min(_ROWS, len(speeds))).round().astype(int)).tolist()
    found = document["modes"]
    return PageTable(
        caption="Eigenvalues of upright motion; a mode is stable where the real part is negative.",
        head="speed [m/s]",
        names=[f"{speeds[k]:.4g}" for k in chosen],
        columns=[
            TableColumn(name, "1/s", [format_complex(*found["eigenvalues"][k][mode], digits=4) for k in chosen])
            for mode, name in enumerate(found["names"])
        ],
    )


def _make_parameter_table(document: Mapping[str, Any], units: Mapping[str, str]) -> PageTable:
    parameters, spread = document["parameters"], document["uncertainties"]
    columns = [
        TableColumn("value", "", [f"{value:.9g}" for value in parameters.values()]),
        TableColumn("unit", "", [units[name] for name in parameters], words=True),
    ]
    if spread:
        # A file that states no deviation of a number has 0.
        texts = [f"± {spread[name]:.2g}" if spread.get(name) else "–" for name in parameters]
        columns.insert(1, TableColumn("standard deviation", "", texts))
    return PageTable(
        caption="z up; mass moments of inertia about the centres of mass.",
        head="parameter",
        names=[name.replace("_", " ") for name in parameters],
        columns=columns,
    )
