"""What to set in MuJoCo for a wheel that rolls: `python benchmarks/mujoco_settings.py`.

Four tables: what a step costs beside MuJoCo's own step of the same tree, what single settings do to slip,
energy and radius on a circle, the slip held against its law, and the drifts of a long ride. The numbers come
from `engines.mujoco.study`. With `--json` they are printed as one JSON document instead.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from engines.engine import Problem
from engines.mujoco.study import (
    LADDER,
    CreepRow,
    DriftRow,
    Rate,
    Row,
    creep_study,
    drift_study,
    plain_step_cost,
    settings_study,
)
from reference.bicycle import Bicycle
from reference.families import find_motion
from reference.surface import Paraboloid, Plane, SurfaceOfRevolution

# Time constants of the contacts over more than two decades [s].
TIME_CONSTANTS = (0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02)
SURFACES: dict[str, SurfaceOfRevolution] = {"plane": Plane(), "bowl": Paraboloid(1 / 200)}


def circle(surface: SurfaceOfRevolution, duration: float, interval: float = 0.01) -> Problem:
    """The tight circle of family 2 at a rear rate of 18 rad/s: in the bowl it is the paper's Q2."""
    _, motion = find_motion(Bicycle(), surface, 18.0, 2, (0.74, 2.84))
    return Problem(Bicycle(), surface, *motion.state(), np.arange(round(duration / interval) + 1) * interval)


def costs(problem: Problem) -> list[dict[str, Any]]:
    """CPU time of a step of each model, at its own settings, and of MuJoCo's step of the same tree [s]."""
    rows = []
    for engine in LADDER:
        settings = engine.settings()
        trajectory = engine.simulate(problem, settings, lambda _: None)
        plain = plain_step_cost(problem, settings.integrator, settings.step)
        cost = trajectory.cpu_time / trajectory.steps
        rows.append({"engine": engine.name, "integrator": settings.integrator, "cost": cost, "plain": plain})
    return rows


def _rate(rate: Rate | None, scale: float = 1.0) -> str:
    return "–" if rate is None else f"{scale * rate.value:.3g} ± {scale * rate.half_width:.1g}"


def cost_table(rows: list[dict[str, Any]]) -> Table:
    """Costs, and their ratio to the plain step."""
    table = Table("model", "integrator", "µs a step", "plain step µs", "ratio", box=None, pad_edge=False)
    for row in rows:
        ratio = row["cost"] / row["plain"]
        table.add_row(
            row["engine"], row["integrator"], f"{1e6 * row['cost']:.0f}", f"{1e6 * row['plain']:.1f}", f"{ratio:.1f}"
        )
    return table


def settings_table(title: str, rows: list[Row]) -> Table:
    """One choice of settings a row."""
    columns = ("slip mm/s", "law mm/s", "dE/dt W", "of it slip W", "dR/dt mm/s", "µs a step", "ridden s")
    table = Table(title, "changed", *columns, box=None, pad_edge=False)
    for row in rows:
        changed = ", ".join(f"{name} {value}" for name, value in row.changed.items())
        table.add_row(
            row.engine.removeprefix("mujoco-"),
            changed or "–",
            f"{1e3 * row.slip:.3g}",
            "–" if row.law is None else f"{1e3 * row.law:.3g}",
            _rate(row.energy_rate),
            f"{row.slip_power:.2g}",
            _rate(row.radius_rate, 1e3),
            f"{1e6 * row.step_cost:.0f}",
            f"{row.ended:g}",
        )
    return table


def creep_table(title: str, rows: list[CreepRow]) -> Table:
    """Measured slip over the law, for the rear and the front wheel."""
    table = Table(title, "step ms", "slip mm/s", "law mm/s", "rear / law", "front / law", box=None, pad_edge=False)
    for row in rows:
        ratios = [slip / law for slip, law in zip(row.slip, row.law, strict=True)]
        cells = (f"{1e3 * np.mean(row.slip):.4g}", f"{1e3 * np.mean(row.law):.4g}", *(f"{r:.4f}" for r in ratios))
        table.add_row(f"b = {row.damping:.0f} 1/s", f"{1e3 * row.step:.4g}", *cells)
    return table


def drift_table(title: str, rows: list[DriftRow]) -> Table:
    """Drift rates with the half widths of their confidence intervals."""
    table = Table(title, "dR/dt mm/s", "dE/dt W", "rear rate rad/s²", "slip m/s", "ridden s", box=None, pad_edge=False)
    for row in rows:
        drifts = (_rate(row.radius, 1e3), _rate(row.energy), _rate(row.rear_rate))
        table.add_row(row.engine, *drifts, f"{row.slip:.2g}", f"{row.ridden:g}")
    return table


def main() -> None:
    """Compute and print."""
    parser = argparse.ArgumentParser(description="MuJoCo's settings for rolling wheels.")
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    parser.add_argument("--duration", type=float, default=120.0, help="of the long ride [s]")
    options, console, status = parser.parse_args(), Console(), Console(stderr=True)
    with status.status("riding"):
        long = circle(SURFACES["bowl"], options.duration, 0.02)
        found = {
            "costs": costs(replace(long, times=np.arange(11.0))),
            "settings": {name: settings_study(circle(surface, 2.0)) for name, surface in SURFACES.items()},
            "creep": {name: creep_study([circle(surface, 0.5)], TIME_CONSTANTS) for name, surface in SURFACES.items()},
            "drift": drift_study(long),
        }
    if options.json:
        print(json.dumps(found, default=asdict))
        return
    tables = [cost_table(found["costs"])]
    tables += [settings_table(name, rows) for name, rows in found["settings"].items()]
    tables += [creep_table(name, rows) for name, rows in found["creep"].items()]
    tables += [drift_table(f"Q2, {options.duration:g} s", found["drift"])]
    for table in tables:
        console.print(table)
        console.print()


if __name__ == "__main__":
    main()
