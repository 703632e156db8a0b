"""What the command shows: progress, tables, JSON documents."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich import progress as bars
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ...reference.bicycle import Bicycle
from ...reference.circular import CircularMotion
from ...reference.contact import observe
from ...reference.families import find_motion
from ...reference.kinematics import YAW
from ...reference.stability import growth_rate, linearise
from ...reference.surface import Surface
from ...reports.drawing import COLUMNS, format_cell, format_verdict, make_remarks
from ..error import ScenarioError
from ..gate import SHOWN
from ..scenario import make_bowl, name_surface

if TYPE_CHECKING:
    from ..gate import Verdict
    from ..run import RunOutcome, RunPlan


class ProgressBars:
    """A bar an engine, on stderr; quiet where stderr is no terminal."""

    def __init__(self) -> None:
        columns = (
            bars.TextColumn("{task.description:<16}"),
            bars.BarColumn(),
            bars.TextColumn("{task.completed:.1f} of {task.total:g} s"),
            bars.TimeRemainingColumn(),
        )
        self._console = Console(stderr=True)
        self._bars = bars.Progress(*columns, console=self._console, transient=True)
        self._tasks: dict[str, bars.TaskID] = {}

    def __enter__(self) -> ProgressBars:
        if self._console.is_terminal:
            self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        # Bars that never started would still print an empty line.
        if self._console.is_terminal:
            self._bars.stop()

    def watch(self, engine: str, time: float, duration: float) -> None:
        """Show that an engine has reached a simulated time."""
        if engine not in self._tasks:
            self._tasks[engine] = self._bars.add_task(engine, total=duration)
        self._bars.update(self._tasks[engine], completed=time, total=duration)

    def note(self, line: str) -> None:
        """Say a line without disturbing the bars."""
        self._console.print(line, soft_wrap=True, highlight=False, markup=False)


@contextmanager
def show_working(line: str) -> Iterator[None]:
    """Show on a terminal's stderr that something is under way."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    with console.status(line):
        yield


def show_outcome(console: Console, plan: RunPlan, outcome: RunOutcome) -> None:
    """Print the table of a run and where its folder is."""
    duration = plan.scenario.simulation.duration
    console.print()
    console.print(f"{plan.name}: {plan.scenario.title}, {duration:g} s", style="bold", markup=False)
    cells = {
        name: [format_cell(values, metric, part) for _, _, metric, part in COLUMNS]
        for name, values in outcome.metrics.items()
    }
    for table in _metric_tables(cells, console.width):
        console.print(table)
    for name, values in outcome.metrics.items():
        for line in make_remarks(name, values, duration):
            console.print(line, style="yellow", markup=False, soft_wrap=True)
    for name, reason in plan.left_out.items():
        console.print(f"{name} left out: {reason}", style="dim", markup=False, highlight=False, soft_wrap=True)
    for name, reason in outcome.failures.items():
        console.print(f"{name} did not run: {reason}", style="red", markup=False, soft_wrap=True)
    for verdict in outcome.verdicts:
        style = "green" if verdict["holds"] else "red"
        console.print(format_verdict(verdict), style=style, markup=False, soft_wrap=True)
    command = Path(sys.executable).with_name("velodrome")
    if command.is_relative_to(Path.cwd()):
        command = command.relative_to(Path.cwd())
    console.print(f"run folder: {outcome.folder}", markup=False, highlight=False, soft_wrap=True)
    console.print(f"report:     {outcome.folder / 'report.html'}", markup=False, highlight=False, soft_wrap=True)
    if (outcome.folder / "comparison.rrd").exists():
        console.print(f"recording:  {command} view {outcome.folder}", markup=False, highlight=False, soft_wrap=True)


def _metric_tables(cells: Mapping[str, list[str]], width: int) -> Iterator[Table]:
    """The table of a run, or several one below the other where it is wider than the terminal.

    Every engine's name and every figure is whole at any width.
    """
    texts = [(*title.split(), unit) for title, unit, _, _ in COLUMNS]
    widths = [max(map(len, (*text, *(row[k] for row in cells.values())))) for k, text in enumerate(texts)]
    gap, room = 2, width - max((len(name) for name in cells), default=0)
    parts, used = [[]], 0
    for k, column in enumerate(widths):
        if parts[-1] and used + gap + column > room:
            parts.append([])
            used = 0
        parts[-1].append(k)
        used += gap + column
    for part in parts:
        table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0))
        table.add_column("engine", no_wrap=True)
        for k in part:
            table.add_column("{}\n{}\n[dim]{}[/dim]".format(*texts[k]), justify="right", no_wrap=True)
        for name, row in cells.items():
            table.add_row(name, *(row[k] for k in part))
        yield table


def outcome_json(plan: RunPlan, outcome: RunOutcome) -> dict[str, Any]:
    """JSON of one run."""
    return {
        "scenario": plan.name,
        "folder": str(outcome.folder),
        "complete": not outcome.interrupted,
        "engines": outcome.metrics,
        "failures": outcome.failures,
        "left_out": plan.left_out,
        "verdicts": outcome.verdicts,
    }


def circular(
    ground: Surface | float, rear_rate: float, family: int | None, near: tuple[float, float] | None
) -> dict[str, Any]:
    """Compute one circular motion of the benchmark bicycle as the JSON document of `velodrome circular`.

    Parameters
    ----------
    ground : Surface or float
        A surface of revolution, or the alpha of a paraboloid [1/m].
    rear_rate : float
        [rad/s].
    family : int or None
    near : tuple of float or None
        Lean and steer that it is near to [rad].

    Raises
    ------
    ScenarioError
        If there is none.
    """
    bicycle, surface = Bicycle(), make_bowl(ground)
    try:
        number, motion = find_motion(bicycle, surface, rear_rate, family, near)
        q, qd = motion.state()
        reduced = linearise(bicycle, surface, q, qd)
    except ValueError as error:
        raise ScenarioError(str(error)) from error
    seen = observe(bicycle, surface, q[None], qd[None])
    normal_force = np.einsum("wi,wi->w", motion.force, seen.normal[0])
    growth = growth_rate(surface, reduced.eigenvalues, float(qd[YAW]))
    return {
        **name_surface(surface),
        "family": number,
        **_constants(motion),
        "contact_point": _by_wheel(seen.point[0].tolist()),
        "contact_force": _by_wheel(motion.force.tolist()),
        "normal_force": _by_wheel(normal_force.tolist()),
        "energy": float(seen.kinetic_energy[0] + seen.potential_energy[0]),
        "residual": motion.residual,
        "eigenvalues": [[value.real, value.imag] for value in reduced.eigenvalues],
        "jacobian": reduced.jacobian.tolist(),
        "lyapunov_stable": bool(growth < 0),
        "physical": bool(np.all(normal_force > 0)),
    }


def _constants(motion: CircularMotion) -> dict[str, Any]:
    names = ("rear_rate", "front_rate", "yaw_rate", "lean", "steer", "pitch")
    return {name: getattr(motion, name) for name in names} | {"position": motion.position.tolist()}


def _by_wheel(pair: list[Any]) -> dict[str, Any]:
    return {"rear": pair[0], "front": pair[1]}


def show_circular(console: Console, found: dict[str, Any]) -> None:
    """Print a circular motion."""
    table = Table(box=None, show_header=False, pad_edge=False)
    if found["alpha"] is not None:
        table.add_row("alpha", _shown(found["alpha"]), "1/m")
    else:
        for name, value in found["surface"].items():
            table.add_row("surface" if name == "kind" else name, _shown(value))
    for name, unit in (
        *(("family", ""), ("rear_rate", "rad/s"), ("front_rate", "rad/s"), ("yaw_rate", "rad/s")),
        *(("lean", "rad"), ("steer", "rad"), ("pitch", "rad"), ("energy", "J"), ("residual", "")),
    ):
        table.add_row(name, f"{found[name]:.12g}", unit)
    table.add_row("position", _numbers(found["position"]), "m, D in the heading frame")
    for wheel in ("rear", "front"):
        table.add_row(f"{wheel} contact", _numbers(found["contact_point"][wheel]), "m")
        table.add_row(f"{wheel} force", _numbers(found["contact_force"][wheel]), "N, on the wheel")
        table.add_row(f"{wheel} normal force", f"{found['normal_force'][wheel]:.9g}", "N")
    for i, (real, imaginary) in enumerate(found["eigenvalues"]):
        value = (
            f"{real:.9g}" if imaginary == 0 else f"{real:.9g} {'+' if imaginary > 0 else '-'} {abs(imaginary):.9g} i"
        )
        table.add_row("eigenvalues" if i == 0 else "", value, "1/s" if i == 0 else "")
    console.print(table)
    stable = "Lyapunov stable" if found["lyapunov_stable"] else "unstable"
    physical = "both wheels are pushed" if found["physical"] else "not physical: the ground would have to pull a wheel"
    console.print(f"{stable}; {physical}")


def _shown(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def _numbers(values: list[float]) -> str:
    return ", ".join(f"{value:.9g}" for value in values)


def show_families(console: Console, document: Mapping[str, Any]) -> None:
    """Print the families: where each runs, its special points, its stable sections."""
    for family in document["families"]:
        points = family["points"]
        console.print(
            f"family {family['family']}: {len(points['lean'])} points, from {family['ends'][0]} to {family['ends'][1]}",
            style="bold",
            markup=False,
            highlight=False,
        )
        table = Table("", "kind", box=None, pad_edge=False)
        for title in ("rear rate", "front rate", "lean", "steer"):
            table.add_column(title, justify="right")
        for name, point in family["special_points"].items():
            numbers = (f"{point[key]:.9f}" for key in ("rear_rate", "front_rate", "lean", "steer"))
            table.add_row(name, point["kind"], *numbers)
        if family["special_points"]:
            console.print(table)
        for section in family["stable_sections"]:
            rates, causes = section["rear_rate"], section["cause"]
            line = " to ".join(f"{rate:.9f} ({cause})" for rate, cause in zip(rates, causes, strict=True))
            console.print(f"Lyapunov stable: rear rate {line}", style="green", markup=False, highlight=False)
    for number, reason in document["absent"].items():
        console.print(f"family {number}: no curve: {reason}", style="yellow", markup=False, soft_wrap=True)


def show_critical(console: Console, document: Mapping[str, Any]) -> None:
    """Print the critical shapes of the bowl."""
    table = Table("families", "what happens", box=None, pad_edge=False)
    for title in ("alpha", "rear rate", "lean", "steer"):
        table.add_column(title, justify="right", no_wrap=True)
    rows = [("2, 4", "cusps D, I meet", document["cusp_collision"])]
    rows += [(", ".join(map(str, point["families"])), "curves touch", point) for point in document["merging"]]
    rows += [(n, "last stable", point) for n, point in document["last_stable"].items() if point is not None]
    for families, what, point in rows:
        numbers = (f"{point[key]:.9f}" for key in ("rear_rate", "lean", "steer"))
        table.add_row(families, what, f"{point['alpha']:.11f}", *numbers)
    console.print(table)
    for number, point in document["last_stable"].items():
        if point is None:
            console.print(f"family {number} has no stable section", markup=False, highlight=False)


def show_atlas(console: Console, document: Mapping[str, Any], out: Path) -> None:
    """Print the stable regions of the atlas, and where it is."""
    table = Table("family", box=None, pad_edge=False)
    for title in ("stable from alpha", "to alpha", "where at rear rate"):
        table.add_column(title, justify="right")
    for region in document["stable"]:
        end = region["vanishing"]
        last = ("and on", "") if end is None else (f"{end['alpha']:.10f}", f"{end['rear_rate']:.6f}")
        table.add_row(str(region["family"]), f"{region['alpha'][0]:g}", *last)
    console.print(table)
    console.print(f"{document['motions']} motions in {out}", markup=False, highlight=False, soft_wrap=True)


def show_precision(console: Console, document: Mapping[str, Any]) -> None:
    """Print a work-precision study: a table an engine."""
    # Here, since the other commands' tables need none of what it imports.
    from ...reports.measure import compared_time

    limit = "" if document["horizon"] is None else "; beyond, the motion's own instability leaves nothing to compare"
    title = f"{document['scenario']}: errors over {compared_time(document):.4g} s{limit}"
    console.print(title, style="bold", markup=False, soft_wrap=True)
    for name, entry in document["engines"].items():
        console.print()
        console.print(name, style="bold", markup=False)
        table = Table(box=None, pad_edge=False)
        for title in ("step", "position error", "energy drift", "largest slip", "CPU time", "order"):
            table.add_column(title, justify="right", no_wrap=True)
        orders = ["", "", *("–" if order is None else f"{order:.3f}" for order in entry["orders"])]
        for point, order in zip(entry["points"], orders, strict=False):
            keys = ("step", "position_error", "energy_drift", "max_slip", "cpu_time")
            table.add_row(*("–" if point[key] is None else f"{point[key]:.4g}" for key in keys), order)
        console.print(table)
        for line in _precision_lines(entry):
            console.print(line, markup=False, highlight=False, soft_wrap=True)
        for failure in entry["failures"]:
            what = "" if failure["step"] is None else f"step {failure['step']:g}: "
            console.print(f"{what}{failure['reason']}", style="yellow", markup=False, highlight=False, soft_wrap=True)


def _precision_lines(entry: Mapping[str, Any]) -> Iterator[str]:
    if entry["richardson_error"] is not None:
        yield (
            f"limit of the steps: {entry['richardson_error']:.2g} m from the reference over {entry['window']:.4g} s, "
            f"known to {entry['richardson_uncertainty']:.2g} m"
        )
    found = entry["eigenvalues"]
    if found is not None:
        yield f"its own eigenvalues: {found['error']:.2g} 1/s from the reference's at the most"


STATUS_STYLES = {
    "holds": "green",
    "shown": "green",
    "better": "cyan",
    "changed": "red",
    "worse": "red",
    "missing": "red",
}


def show_verdicts(console: Console, verdicts: list[tuple[str, Verdict]], renewed: bool = False) -> None:
    """Print the gate's verdicts: a line an engine, then everything that does not hold in plain lines.

    Of baselines that are ``renewed`` at once there is nothing to pass or fail.
    """
    for name, group in groupby(verdicts, key=lambda item: item[0]):
        console.print(name, style="bold", markup=False)
        table = Table("engine", box=None, pad_edge=False)
        table.add_column("hold", justify="right")
        table.add_column("friction\nneeded", justify="right")
        table.add_column("CPU time,\nreference 1", justify="right")
        table.add_column("moved most, against its limit")
        for engine, rows in groupby((verdict for _, verdict in group), key=lambda verdict: verdict.engine):
            table.add_row(*_engine_row(engine, list(rows)))
        console.print(table)
    for name, verdict in verdicts:
        if verdict.told:
            line = f"{name}: {verdict.engine}: {verdict.quantity}: {verdict.status}: {verdict.reason}"
            console.print(line, style=STATUS_STYLES[verdict.status], markup=False, highlight=False, soft_wrap=True)
    if renewed:
        return
    passes = all(verdict.passes for _, verdict in verdicts)
    console.print("the gate holds" if passes else "the gate fails", style="bold green" if passes else "bold red")


def _engine_row(engine: str, verdicts: list[Verdict]) -> tuple[str, Text, str, str, str]:
    held = sum(verdict.status == "holds" for verdict in verdicts)
    judged = sum(verdict.status != "shown" for verdict in verdicts)
    passes = all(verdict.passes for verdict in verdicts)
    shares = {verdict.quantity: share for verdict in verdicts if (share := verdict.share) is not None}
    moved = "nothing moved" if shares else "–"
    if any(shares.values()):
        most = max(shares, key=lambda quantity: shares[quantity])
        moved = f"{most}, {shares[most]:.2g}"
    values = {verdict.quantity: verdict.value for verdict in verdicts}
    friction, cpu = ("–" if (value := values.get(name)) is None else f"{value:.2g}" for name in SHOWN)
    return engine, Text(f"{held} of {judged}", "green" if passes else "red"), friction, cpu, moved
