"""MuJoCo's settings for a wheel that rolls: `python -m benchmarks.mujoco_settings`.

Five tables: the cost of a step compared with MuJoCo's own step of the same tree, the effect of single settings on
slip, energy and radius on a circle, the slip compared with its law, the energy that integrators add, and the drifts
of a long ride. The numbers come from `study` and `laws`. With `--json` they are printed as one JSON document
instead; with `--out FOLDER` that document, a figure and a Markdown table with advice are written.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from velodrome.engines.engine import Problem
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.families import find_motion
from velodrome.reference.surface import Paraboloid, Plane, SurfaceOfRevolution
from velodrome.scenarios.files import write_text

from .advice import advice, markdown_table
from .creep_figure import creep_figure
from .laws import CreepRow, EnergyRow, creep_study, energy_study
from .study import LADDER, DriftRow, Rate, Row, drift_study, plain_step_cost, settings_study

# Time constants of the contacts over more than two decades [s].
TIME_CONSTANTS = (0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02)
# MuJoCo's default friction, and the largest ratio that still reduces the slip.
IMPRATIOS = (1.0, 100.0)
STEPS = (0.004, 0.002, 0.001, 0.0005)
SURFACES: dict[str, SurfaceOfRevolution] = {"the plane": Plane(), "the bowl, α = 1/200": Paraboloid(1 / 200)}


def circle(surface: SurfaceOfRevolution, duration: float, interval: float = 0.01) -> Problem:
    """Return the tight circle of family 2 at a rear rate of 18 rad/s; in the bowl it is the paper's Q2."""
    _, motion = find_motion(Bicycle(), surface, 18.0, 2, (0.74, 2.84))
    return Problem(Bicycle(), surface, *motion.state(), np.arange(round(duration / interval) + 1) * interval)


def costs(problem: Problem) -> list[dict[str, Any]]:
    """Measure the CPU time of a step of each model, at its own settings, and of MuJoCo's step of the same tree [s]."""
    rows = []
    for engine in LADDER:
        settings = engine.settings()
        trajectory = engine.simulate(problem, settings, lambda _: None)
        plain = plain_step_cost(problem, settings.integrator, settings.step)
        cost = trajectory.cpu_time / trajectory.steps
        rows.append({"engine": engine.name, "integrator": settings.integrator, "cost": cost, "plain": plain})
    return rows


def _format_rate(rate: Rate | None, scale: float = 1.0) -> str:
    return "–" if rate is None else f"{scale * rate.value:.3g} ± {scale * rate.half_width:.1g}"


def cost_table(rows: list[dict[str, Any]]) -> Table:
    """Make the table of costs and of their ratio to the plain step."""
    table = Table("model", "integrator", "µs a step", "plain step µs", "ratio", box=None, pad_edge=False)
    for row in rows:
        ratio = row["cost"] / row["plain"]
        table.add_row(
            row["engine"], row["integrator"], f"{1e6 * row['cost']:.0f}", f"{1e6 * row['plain']:.1f}", f"{ratio:.1f}"
        )
    return table


def settings_table(title: str, rows: list[Row]) -> Table:
    """Make the table of settings, one choice in a row."""
    columns = ("slip mm/s", "law mm/s", "dE/dt W", "of it slip W", "dR/dt mm/s", "µs a step", "ridden s", "advice")
    table = Table(title, "changed", *columns, box=None, pad_edge=False)
    for row, recommendation in zip(rows, advice([asdict(row) for row in rows]), strict=True):
        changed = ", ".join(f"{name} {value}" for name, value in row.changed.items())
        table.add_row(
            row.engine.removeprefix("mujoco-"),
            changed or "–",
            f"{1e3 * row.slip:.3g}",
            "–" if row.law is None else f"{1e3 * row.law:.3g}",
            _format_rate(row.energy_rate),
            f"{row.slip_power:.2g}",
            _format_rate(row.radius_rate, 1e3),
            f"{1e6 * row.step_cost:.0f}",
            f"{row.ridden:g}",
            recommendation,
        )
    return table


def creep_table(title: str, rows: list[CreepRow]) -> Table:
    """Make the table of measured slip over the law and over the whole law, for the rear and the front wheel."""
    columns = ("impratio", "step ms", "slip mm/s", "law mm/s", "rear, front / law", "/ whole law")
    table = Table(title, *columns, box=None, pad_edge=False)
    for row in rows:
        ratios = [
            " ".join(f"{slip / expected:.4f}" for slip, expected in zip(row.slip, law, strict=True))
            for law in (row.law, row.whole_law)
        ]
        sizes = (f"{1e3 * np.mean(row.slip):.4g}", f"{1e3 * np.mean(row.law):.4g}")
        table.add_row(f"b = {row.damping:.0f} 1/s", f"{row.impratio:g}", f"{1e3 * row.step:.4g}", *sizes, *ratios)
    return table


def energy_table(rows: list[EnergyRow]) -> Table:
    """Make the table of the energy that integrators add, in total and per millisecond of step."""
    table = Table("integrator", "step ms", "energy added W", "W a ms", box=None, pad_edge=False)
    for row in rows:
        table.add_row(row.integrator, f"{1e3 * row.step:g}", f"{row.gain:.3g}", f"{row.gain / row.step / 1e3:.3g}")
    return table


def drift_table(title: str, rows: list[DriftRow]) -> Table:
    """Make the table of drift rates with the half widths of their confidence intervals."""
    table = Table(title, "dR/dt mm/s", "dE/dt W", "rear rate rad/s²", "slip m/s", "ridden s", box=None, pad_edge=False)
    for row in rows:
        drifts = (_format_rate(row.radius, 1e3), _format_rate(row.energy), _format_rate(row.rear_rate))
        table.add_row(row.engine, *drifts, f"{row.slip:.2g}", f"{row.ridden:g}")
    return table


def measure(duration: float) -> dict[str, Any]:
    """Run all studies; ``duration`` is that of the long ride [s]."""
    plane, bowl = SURFACES.values()
    long = circle(bowl, duration, 0.02)
    creep = {name: circle(surface, 0.5) for name, surface in SURFACES.items()}
    return {
        "costs": costs(replace(long, times=np.arange(11.0))),
        "settings": {name: settings_study(circle(surface, 2.0)) for name, surface in SURFACES.items()},
        "creep": {
            name: [row for ratio in IMPRATIOS for row in creep_study([problem], TIME_CONSTANTS, impratio=ratio)]
            for name, problem in creep.items()
        },
        "energy": energy_study(circle(plane, 2.0, 0.02), STEPS),
        "drift": drift_study(long),
    }


def write(folder: Path, document: dict[str, Any]) -> None:
    """Write the document, its figure and the tables with advice."""
    folder.mkdir(parents=True, exist_ok=True)
    tables = [f"On {name}\n\n{markdown_table(rows)}" for name, rows in document["settings"].items()]
    texts = {"settings.json": json.dumps(document, indent=1), "settings.md": "\n".join(tables)}
    for name, text in texts.items():
        write_text(folder / name, text)
    for ending in (".png", ".svg"):
        creep_figure(folder / f"settings{ending}", document)


def main() -> None:
    """Compute and print."""
    parser = argparse.ArgumentParser(description="MuJoCo's settings for rolling wheels.")
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    parser.add_argument("--out", type=Path, help="write the document, a figure and a table with advice to this folder")
    parser.add_argument("--duration", type=float, default=120.0, help="duration of the long ride [s]")
    options, console, status = parser.parse_args(), Console(), Console(stderr=True)
    with status.status("riding"):
        found = measure(options.duration)
    text = json.dumps(found, default=asdict)
    if options.out:
        write(options.out, json.loads(text))
    if options.json:
        print(text)
        return
    tables = [cost_table(found["costs"])]
    tables += [settings_table(name, rows) for name, rows in found["settings"].items()]
    tables += [creep_table(name, rows) for name, rows in found["creep"].items()]
    tables += [energy_table(found["energy"]), drift_table(f"Q2, {options.duration:g} s", found["drift"])]
    for table in tables:
        console.print(table)
        console.print()


if __name__ == "__main__":
    main()
