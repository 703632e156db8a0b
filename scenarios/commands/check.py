"""The command `check`, which runs the drift gate."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..error import ScenarioError
from .completion import complete_engine, complete_scenario
from .options import (
    HISTORIES,
    LONGEST_RIDE,
    CacheOption,
    JsonOption,
    TracebackOption,
    ending_with,
    print_json,
    print_traceback,
    showing_traceback,
)

if TYPE_CHECKING:
    from ..gate import GivenBaselines, Verdict
    from .progress import ProgressBars


def check_command(
    scenario: Annotated[
        list[str] | None,
        typer.Argument(
            help="Library names or paths to TOML files; all gated ones if none is named.",
            autocompletion=complete_scenario,
        ),
    ] = None,
    engine: Annotated[
        list[str] | None,
        typer.Option(
            help="Judge only these engines: a name, a pattern, or all; may be given several times. "
            "Their settings are those of the scenario's "
            "[engines.NAME].",
            autocompletion=complete_engine,
        ),
    ] = None,
    baselines: Annotated[Path | None, typer.Option(help="Folder of the baselines instead of the suite's own.")] = None,
    baseline_of: Annotated[
        str | None,
        typer.Option(
            metavar="'PACKAGE==VERSION'",
            help="Hold the engines of a package against a release of it, which rides in an environment of its own "
            "first; see velodrome history. With --wheel the package alone.",
        ),
    ] = None,
    wheel: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.whl",
            help="A build as the release of --baseline-of; given again for wheels of packages that it requires.",
        ),
    ] = None,
    cache: CacheOption = None,
    history: Annotated[
        Path | None,
        typer.Option(
            help="Folder of a history, or of several, by which a message names the release that moved something; "
            "history if not given and there is one."
        ),
    ] = None,
    update: Annotated[
        bool, typer.Option("--update", help="Write the values of engines that moved, changed or are new as baselines.")
    ] = False,
    reason: Annotated[str | None, typer.Option(help="Why, for the new baselines; what moved if not given.")] = None,
    hold_cpu: Annotated[
        bool,
        typer.Option(
            "--hold-cpu",
            help="Judge CPU times too: relative to the reference's in the same run, an engine's may at most double. "
            "The baselines must have been written with this option, on the same machine.",
        ),
    ] = False,
    junit: Annotated[Path | None, typer.Option(help="Write the verdicts as JUnit XML.")] = None,
    markdown: Annotated[Path | None, typer.Option(help="Write the verdicts as Markdown, worst first.")] = None,
    page: Annotated[Path | None, typer.Option(help="Write the verdicts as an HTML page.")] = None,
    traceback: TracebackOption = False,
    as_json: JsonOption = False,
) -> None:
    """The drift gate: run the gated scenarios and hold them against the committed baselines."""
    from .progress import COMPUTING, ProgressBars
    from .terminal import make_console

    with showing_traceback(traceback), ProgressBars() as progress:
        from ..files import write_text
        from ..gate import (
            UNFINISHED_JUNIT,
            UNFINISHED_MARKDOWN,
            GivenBaselines,
            check_gate,
            html_page,
            junit_xml,
            list_bicycle_warnings,
            list_left_out,
            list_unjudged_engines,
            markdown_page,
            read_baselines,
            refused_verdicts,
        )
        from ..history import find_stored_histories, name_origins
        from ..run import configure_engine
        from .present_gate import show_unjudged, show_update, show_verdicts, show_warnings

        if reason is not None and not update:
            raise ScenarioError("--reason: it belongs to --update, which writes new baselines")
        # Checked first, so that minutes of work are not lost.
        _check_baseline_options(baseline_of, wheel, baselines, update, hold_cpu)
        histories = find_stored_histories(HISTORIES if history is None else history, named=history is not None)
        if baselines is not None and not baselines.exists() and not update:
            raise ScenarioError(f"--baselines {baselines}: there is no such folder; with --update it is made")
        for option, path in (("--junit", junit), ("--markdown", markdown), ("--page", page)):
            if path is not None:
                _check_path(option, path)
        files = [(junit, junit_xml), (markdown, markdown_page)]
        unfinished = {junit: UNFINISHED_JUNIT, markdown: UNFINISHED_MARKDOWN}
        with _mark_unfinished(unfinished | ({} if page is None else {page: html_page([])})):
            trace = print_traceback if traceback else None
            held: Path | GivenBaselines | None = baselines
            if baseline_of is not None:
                held = _ride_baselines(progress, baseline_of, scenario, engine, wheel, cache)
            progress.say(COMPUTING)
            verdicts, fresh = check_gate(progress.watch, scenario, engine, held, configure_engine, trace, hold_cpu)
            if histories:
                after = {name: one["engines"] for name, one in fresh.items()}
                verdicts = name_origins(verdicts, scenario or (), read_baselines(held, scenario), after, histories)
    for path, write in files:
        if path is not None:
            write_text(path, write(verdicts))
    written = _write_baselines(fresh, verdicts, reason, baselines) if update else []
    refused = refused_verdicts(verdicts) if update else []
    warnings = list_bicycle_warnings(scenario)
    left_out = {} if engine or baseline_of else list_left_out(baselines, scenario)
    if page is not None:
        write_text(page, html_page(verdicts, left_out))
    others = [] if engine or not isinstance(held, GivenBaselines) else list_unjudged_engines(held)
    passes = not refused if update else all(verdict.passes for _, verdict in verdicts)
    with ending_with(0 if passes else 1):
        if as_json:
            rows = [{"scenario": name} | verdict.as_json() for name, verdict in verdicts]
            print_json(
                {
                    "passes": passes,
                    "updated": written,
                    "warnings": warnings,
                    "left_out": left_out,
                    "baseline_of": held.release if isinstance(held, GivenBaselines) else None,
                    "of_other_packages": others,
                    "verdicts": rows,
                }
            )
        else:
            console = make_console()
            show_verdicts(console, verdicts, renewed=update)
            package = held.package if isinstance(held, GivenBaselines) else None
            show_unjudged(console, package, others, left_out)
            show_warnings(console, warnings)
            if update:
                show_update(console, written, refused)


def _write_baselines(
    fresh: Mapping[str, Any], verdicts: Sequence[tuple[str, Verdict]], reason: str | None, baselines: Path | None
) -> list[str]:
    """Write new baselines, and return their files.

    Engines that are no longer installed are removed from the baselines; engines that failed must not be.

    Raises
    ------
    ScenarioError
        If an installed engine did not run. Nothing is written then.
    """
    from ..gate import update_baselines
    from ..run import installed_engines

    installed = installed_engines()
    absent = [
        verdict
        for _, verdict in verdicts
        if verdict.engine in installed and verdict.quantity == "run" and verdict.reason.startswith("did not")
    ]
    if absent:
        raise ScenarioError(f"no baseline written: {absent[0].engine} {absent[0].reason}")
    return [str(path) for path in update_baselines(fresh, verdicts, reason, baselines)]


def _check_baseline_options(
    baseline_of: str | None, wheel: list[Path] | None, baselines: Path | None, update: bool, hold_cpu: bool
) -> None:
    """Raise a ScenarioError if options do not go together."""
    if baseline_of is None:
        if wheel:
            raise ScenarioError("--wheel: it belongs to --baseline-of, e.g. --baseline-of mujoco --wheel FILE.whl")
        return
    if update:
        raise ScenarioError("--baseline-of: it writes no baselines; give it without --update")
    if baselines is not None:
        raise ScenarioError("--baseline-of: the release takes the place of the baselines; give it without --baselines")
    if hold_cpu:
        raise ScenarioError(
            "--baseline-of: CPU times of a release are not measured; give it without --hold-cpu, or write baselines in "
            "an environment that has the release"
        )


def _ride_baselines(
    progress: ProgressBars,
    wanted: str,
    scenarios: list[str] | None,
    engines: list[str] | None,
    wheels: list[Path] | None,
    cache: Path | None,
) -> GivenBaselines:
    """Install a release, ride it, and return its baselines."""
    from ..history import Children, find_cache_folder, plan_release_baselines, ride_release_baselines

    children, environments = Children(), find_cache_folder(cache)
    try:
        plan = plan_release_baselines(
            wanted, scenarios or (), engines or (), wheels or (), cache=environments, children=children
        )
        for line in plan.remarks:
            progress.note(line)
        name = f"{plan.package} {plan.releases[0].label}"
        return ride_release_baselines(
            plan,
            lambda done, total: progress.watch(name, done, total, "rides"),
            progress.note,
            all_rides=bool(scenarios),
            cache=environments,
            time_limit=LONGEST_RIDE,
            children=children,
        )
    finally:
        children.stop()


@contextmanager
def _mark_unfinished(pages: Mapping[Path | None, str]) -> Iterator[None]:
    """Write files that state that the check is not finished, so that a process that ends early leaves no stale ones.

    If the input is bad, the files are removed.
    """
    from ..files import write_text

    paths = [path for path in pages if path is not None]
    for path in paths:
        write_text(path, pages[path])
    try:
        yield
    except ScenarioError:
        for path in paths:
            path.unlink(missing_ok=True)
        raise


def _check_path(option: str, path: Path) -> None:
    """Raise a ScenarioError if a file cannot be written."""
    if path.is_dir():
        raise ScenarioError(f"{option} {path}: it is a folder; name a file")
    if not path.parent.is_dir():
        raise ScenarioError(f"{option} {path}: there is no folder {path.parent}")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise ScenarioError(f"{option} {path}: no file can be written to {path.parent}")
