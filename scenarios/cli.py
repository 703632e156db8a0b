"""The command `velodrome`.

Compiled kernels, engines and plots take seconds to import: each command imports what it needs, and none
of them waits for the others'.
"""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .error import ScenarioError

if TYPE_CHECKING:
    from reference.surface import Surface

    from .run_folder import Plan

app = typer.Typer(
    name="velodrome",
    help="Cross-validation of multibody engines on a bicycle that rides hands-free in circles inside a bowl.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

_STARTING = "computing the motion (the first time on a machine, kernels are compiled: half a minute)"

_Alpha = Annotated[
    float | None, typer.Option("--alpha", help="Shape of the bowl z = alpha (x² + y²) [1/m]; 0 is the plane.")
]
_Ground = Annotated[
    str | None,
    typer.Option("--surface", metavar="KIND:KEY=VALUE,...", help="Another bowl instead, e.g. sphere:radius=20."),
]
_Changes = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a field, e.g. simulation.duration=5.")
]
_Duration = Annotated[float | None, typer.Option(help="Simulated time [s].")]
Json = Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")]


@app.command("list")
def list_command(as_json: Json = False) -> None:
    """Scenarios of the library and installed engines."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from engines.engine import engine_names, load_engine

    from .scenario import library_names, load_scenario

    scenarios = []
    for name in library_names():
        _, scenario = load_scenario(name)
        scenarios.append({"name": name, "title": scenario.title, "tags": list(scenario.tags)})
    engines = []
    for name in engine_names():
        try:
            engine = load_engine(name)
            engines.append({"name": name, "version": engine.version, "gives": list(engine.gives)})
        except ValueError as error:
            engines.append({"name": name, "version": None, "gives": [], "error": " ".join(str(error).split())})
    if as_json:
        _print_json({"scenarios": scenarios, "engines": engines})
        return
    table = Table("scenario", "title", "tags", box=None, pad_edge=False)
    for entry in scenarios:
        table.add_row(entry["name"], entry["title"], ", ".join(entry["tags"]))
    console = Console()
    console.print(table)
    console.print()
    table = Table("engine", "version", "gives, beside coordinates and poses", box=None, pad_edge=False)
    for entry in engines:
        given = Text(entry["error"], "red") if "error" in entry else ", ".join(entry["gives"])
        table.add_row(entry["name"], entry["version"] or "–", given)
    console.print(table)


@app.command("run")
def run_command(
    scenario: Annotated[list[str] | None, typer.Argument(help="Library names or paths to TOML files.")] = None,
    engine: Annotated[list[str] | None, typer.Option(help="Run only this engine, beside the reference.")] = None,
    tag: Annotated[str | None, typer.Option(help="Run all library scenarios with this tag.")] = None,
    change: _Changes = None,
    duration: _Duration = None,
    out: Annotated[Path, typer.Option(help="Folder for the run folders.")] = Path("runs"),
    as_json: Json = False,
) -> None:
    """Run scenarios in every engine from the same computed start and compare with the reference."""
    from rich.console import Console

    from . import present
    from .runner import run

    sources = [*(scenario or []), *(_tagged(tag) if tag is not None else [])]
    if not sources:
        raise ScenarioError("nothing to run: name a scenario, or a tag with --tag; velodrome list shows them")
    changes = _changed(change, duration)
    with present.working(_STARTING):
        plans = [_plan(source, changes, engine) for source in dict.fromkeys(sources)]
    console = Console(stderr=as_json)
    outcomes = []
    for plan in plans:
        with present.Progress() as progress:
            outcome = run(plan, out, progress.watch, progress.note)
        outcomes.append((plan, outcome))
        present.show_outcome(console, plan, outcome)
        if outcome.interrupted:
            break
    if as_json:
        _print_json({"runs": [present.outcome_json(plan, outcome) for plan, outcome in outcomes]})
    if any(outcome.interrupted for _, outcome in outcomes):
        raise typer.Exit(130)
    if any(outcome.failures or not all(v["holds"] for v in outcome.verdicts) for _, outcome in outcomes):
        raise typer.Exit(1)


@app.command("circular")
def circular_command(
    rear_rate: Annotated[float, typer.Option(max=1e4, help="Rear-wheel rate [rad/s].")],
    alpha: _Alpha = None,
    surface: _Ground = None,
    family: Annotated[int | None, typer.Option(help="Solution family, 1 to 4.")] = None,
    near: Annotated[str | None, typer.Option(metavar="LEAN,STEER", help="Angles it is near to [rad].")] = None,
    as_json: Json = False,
) -> None:
    """One circular motion: its 21 constants, contact forces, eigenvalues, verdict on stability."""
    from rich.console import Console

    from . import present

    angles, ground = _angles(near), _ground(alpha, surface)
    with present.working(_STARTING):
        found = present.circular(ground, rear_rate, family, angles)
    if as_json:
        _print_json(found)
    else:
        present.show_circular(Console(), found)


@app.command("families")
def families_command(
    alpha: _Alpha = None,
    surface: _Ground = None,
    out: Annotated[Path | None, typer.Option(help="Folder for families.json and the figure families.png.")] = None,
    as_json: Json = False,
) -> None:
    """The four solution families by continuation: special points, stable sections."""
    from rich.console import Console

    from . import present
    from .survey import families_document, write_families

    ground = _ground(alpha, surface)
    with present.working(_STARTING):
        document = families_document(ground)
    if out is not None:
        write_families(document, out)
    if as_json:
        _print_json(document)
    else:
        present.show_families(Console(), document)


@app.command("critical")
def critical_command(as_json: Json = False) -> None:
    """The critical α: cusps collide, families merge, their last stable sections vanish."""
    from rich.console import Console

    from . import present
    from .survey import critical_document

    with present.Progress() as progress:
        document = critical_document(progress.watch)
    if as_json:
        _print_json(document)
    else:
        present.show_critical(Console(), document)


@app.command("atlas")
def atlas_command(
    out: Annotated[
        Path, typer.Option(help="Folder for atlas.parquet (some 60 MB), boundaries.json and the figures.")
    ] = Path("atlas"),
    size: Annotated[int, typer.Option(help="Number of motions, roughly.")] = 400_000,
    largest: Annotated[float, typer.Option(help="Largest alpha [1/m], at most 1.")] = 1.0,
    as_json: Json = False,
) -> None:
    """Stability of all circular motions over alpha and rear rate: data, boundaries, figures (half a minute)."""
    from rich.console import Console

    from . import present
    from .atlas import make_atlas

    with present.Progress() as progress:
        document = make_atlas(out, size, largest, lambda done: progress.watch("atlas", done, 1.0))
    if as_json:
        _print_json(document)
    else:
        present.show_atlas(Console(), document, out)


@app.command("paper")
def paper_command(
    out: Annotated[Path | None, typer.Option(help="Folder for the figures, tables and ledger.")] = None,
    as_json: Json = False,
) -> None:
    """Every figure and printed number of Xiong et al. (2020), computed and held against the print."""
    from rich.console import Console

    from reports.paper.ledger import document
    from reports.paper.table import show_ledger

    from . import present
    from .paper import ledger
    from .paper_figures import write_paper

    with present.Progress() as progress:
        lines = ledger(lambda part, done, parts: progress.watch(part, done, parts))
        written = [] if out is None else write_paper(out, lines, progress.watch)
    found = document(lines)
    if as_json:
        _print_json(found)
    else:
        show_ledger(Console(), lines)
        for path in written:
            Console().print(f"written: {path}", markup=False, highlight=False, soft_wrap=True)
    if not found["holds"]:
        raise typer.Exit(1)


@app.command("precision")
def precision_command(
    scenario: Annotated[str, typer.Argument(help="Library name or path to a TOML file.")],
    engine: Annotated[list[str] | None, typer.Option(help="Study only this engine, beside the reference.")] = None,
    change: _Changes = None,
    duration: _Duration = None,
    levels: Annotated[
        int, typer.Option(min=2, max=12, help="Steps: four times the scenario's, then halved each time.")
    ] = 5,
    eigenvalues: Annotated[bool, typer.Option(help="Measure each engine's own eigenvalues too.")] = True,
    out: Annotated[Path | None, typer.Option(help="Folder for the document and its figure.")] = None,
    as_json: Json = False,
) -> None:
    """Work-precision: error and CPU time over step sizes, observed order, limit, the engine's own eigenvalues."""
    from rich.console import Console

    from . import present
    from .precision import precision, write_precision
    from .scenario import load_scenario

    changes = _changed(change, duration)
    name, loaded = load_scenario(scenario, changes)
    with present.Progress() as progress:
        document = precision(name, loaded, engine, levels, eigenvalues, progress.watch)
    written = [] if out is None else write_precision(document, out)
    if as_json:
        _print_json(document)
        return
    present.show_precision(Console(), document)
    for path in written:
        Console().print(f"written: {path}", markup=False, highlight=False, soft_wrap=True)


@app.command("diff")
def diff_command(
    before: Annotated[Path, typer.Argument(metavar="RUN", help="The earlier run's folder.")],
    after: Annotated[Path, typer.Argument(metavar="RUN", help="The later run's folder.")],
    engine: Annotated[list[str] | None, typer.Option(help="Compare only this engine, beside the reference.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for diff.json, diff.md and the recording diff.rrd.")] = None,
    as_json: Json = False,
) -> None:
    """Two stored runs of one scenario against each other: what moved by more than round-off."""
    from rich.console import Console

    from .diff import diff, read_pair, write_diff
    from .present_diff import show_diff

    pair = read_pair(before, after, engine)
    found = diff(pair)
    written = [] if out is None else write_diff(pair, found, out)
    if as_json:
        _print_json(found)
    else:
        show_diff(Console(), found)
        for path in written:
            Console().print(f"written: {path}", markup=False, highlight=False, soft_wrap=True)
    if not found["same"]:
        raise typer.Exit(1)


@app.command("view")
def view_command(
    run_folder: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")],
    web: Annotated[bool, typer.Option("--web", help="Serve the report page with the viewer in it.")] = False,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port for --web; any free one if not given.")
    ] = None,
) -> None:
    """A run's recording in the native viewer, or its report page in the browser, for this machine only."""
    from . import view

    if web:
        view.serve(run_folder, port or 0, lambda address: print(f"{address}\nCtrl-C ends it", flush=True))
    elif port is not None:
        raise ScenarioError("--port goes with --web")
    else:
        view.open_native(run_folder)


@app.command("check")
def check_command(
    scenario: Annotated[
        list[str] | None, typer.Argument(help="Library names or paths to TOML files; all gated ones if none is named.")
    ] = None,
    engine: Annotated[list[str] | None, typer.Option(help="Judge only this engine.")] = None,
    baselines: Annotated[Path | None, typer.Option(help="Folder of the baselines instead of the suite's own.")] = None,
    update: Annotated[bool, typer.Option("--update", help="Write this run's values as the new baselines.")] = False,
    reason: Annotated[str | None, typer.Option(help="Why, for the new baselines; what moved if not given.")] = None,
    junit: Annotated[Path | None, typer.Option(help="Write the verdicts as JUnit XML.")] = None,
    markdown: Annotated[Path | None, typer.Option(help="Write the verdicts as Markdown, worst first.")] = None,
    as_json: Json = False,
) -> None:
    """The drift gate: run the gated scenarios and hold them against the committed baselines."""
    from rich.console import Console

    from engines.engine import engine_names
    from reports.verdicts import junit_xml, markdown_page

    from . import gate, present
    from .files import write_text

    if reason is not None and not update:
        raise ScenarioError("--reason: it belongs to --update, which writes new baselines")
    console = Console(stderr=as_json)
    with present.Progress() as progress:
        verdicts, fresh = gate.check(progress.watch, scenario, engine, baselines)
    for path, page in ((junit, junit_xml), (markdown, markdown_page)):
        if path is not None:
            write_text(path, page(verdicts))
    written = []
    if update:
        # An engine that is not installed any more leaves the baselines; one that broke must not.
        absent = [
            verdict
            for _, verdict in verdicts
            if verdict.engine in engine_names() and verdict.quantity == "run" and verdict.reason.startswith("did not")
        ]
        if absent:
            raise ScenarioError(f"no baseline written: {absent[0].engine} {absent[0].reason}")
        written = [str(path) for path in gate.update(fresh, verdicts, reason, baselines)]
    passes = update or all(verdict.passes for _, verdict in verdicts)
    if as_json:
        rows = [{"scenario": name} | verdict.as_json() for name, verdict in verdicts]
        _print_json({"passes": passes, "updated": written, "verdicts": rows})
    else:
        present.show_verdicts(console, verdicts, renewed=update)
        for path in written:
            console.print(f"baseline written: {path}", soft_wrap=True)
    if not passes:
        raise typer.Exit(1)


def _plan(source: str, changes: dict[str, Any], wanted: list[str] | None) -> Plan:
    from .runner import plan_run
    from .scenario import load_scenario

    name, scenario = load_scenario(source, changes)
    try:
        return plan_run(name, scenario, wanted)
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from error


def _tagged(tag: str) -> list[str]:
    from .scenario import library_names, load_scenario

    tags = {name: load_scenario(name)[1].tags for name in library_names()}
    names = [name for name in tags if tag in tags[name]]
    if not names:
        known = ", ".join(sorted({word for words in tags.values() for word in words}))
        raise ScenarioError(f"--tag {tag}: no scenario has it; there are {known}")
    return names


def _changed(change: list[str] | None, duration: float | None) -> dict[str, Any]:
    """Fields that --set and --duration override."""
    changes = dict(_assignment(text) for text in change or [])
    if duration is not None:
        changes["simulation.duration"] = duration
    return changes


def _assignment(text: str) -> tuple[str, Any]:
    """Split KEY=VALUE; the value is TOML, or a plain word."""
    key, equals, value = text.partition("=")
    key = key.strip()
    if not equals or not key or not all(key.split(".")):
        raise ScenarioError(f"--set {text}: must be KEY=VALUE, e.g. simulation.duration=5")
    try:
        return key, tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key, value


def _angles(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        lean, steer = (float(part) for part in text.split(","))
    except ValueError:
        raise ScenarioError(f"--near {text}: must be two angles LEAN,STEER in rad, e.g. 0.74,2.84") from None
    return lean, steer


def _ground(alpha: float | None, surface: str | None) -> Surface | float:
    """What a motion rides on: one of --alpha and --surface."""
    if (alpha is None) == (surface is None):
        raise ScenarioError("give the bowl by one of --alpha and --surface, e.g. --alpha 0.005")
    if surface is None:
        assert alpha is not None
        return alpha
    from .surfaces import parse_surface

    return parse_surface(surface)


def _print_json(data: Any) -> None:
    print(json.dumps(data, indent=1, allow_nan=False))


def main() -> None:
    """Run the command; bad input ends with one line on stderr and exit status 2."""
    status = 0
    try:
        status = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except ScenarioError as error:
        _complain(str(error))
    except typer.TyperException as error:
        _complain(error.format_message())
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # The reader of a pipe (head, less) has gone: nothing is wrong here.
        sys.stderr.close()
        sys.exit(0)
    except SystemExit:
        # What rich makes of a broken pipe; the commands themselves end with typer.Exit.
        sys.exit(0)
    except OSError as error:
        _complain(f"cannot write: {error}")
    sys.exit(status or 0)


def _complain(message: str) -> None:
    print(f"velodrome: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)
