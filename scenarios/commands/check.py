"""The command `check`, which runs the drift gate."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from ..error import ScenarioError
from .completion import complete_engine, complete_scenario
from .options import JsonOption, TracebackOption, ending_with, print_json, print_traceback, showing_traceback


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
    traceback: TracebackOption = False,
    as_json: JsonOption = False,
) -> None:
    """The drift gate: run the gated scenarios and hold them against the committed baselines."""
    from ..files import write_text
    from ..gate import (
        UNFINISHED_JUNIT,
        UNFINISHED_MARKDOWN,
        check_gate,
        junit_xml,
        list_bicycle_warnings,
        list_left_out,
        markdown_page,
        refused_verdicts,
        update_baselines,
    )
    from ..run import configure_engine, installed_engines
    from .present_gate import show_verdicts
    from .progress import ProgressBars
    from .terminal import make_console

    if reason is not None and not update:
        raise ScenarioError("--reason: it belongs to --update, which writes new baselines")
    # Checked first, so that minutes of work are not lost.
    if baselines is not None and not baselines.exists() and not update:
        raise ScenarioError(f"--baselines {baselines}: there is no such folder; with --update it is made")
    for option, path in (("--junit", junit), ("--markdown", markdown)):
        if path is not None:
            _check_path(option, path)
    files = [(junit, junit_xml), (markdown, markdown_page)]
    unfinished = _mark_unfinished({junit: UNFINISHED_JUNIT, markdown: UNFINISHED_MARKDOWN})
    with showing_traceback(traceback), unfinished, ProgressBars() as progress:
        trace = print_traceback if traceback else None
        verdicts, fresh = check_gate(progress.watch, scenario, engine, baselines, configure_engine, trace, hold_cpu)
    for path, page in files:
        if path is not None:
            write_text(path, page(verdicts))
    written = []
    if update:
        # Engines that are no longer installed are removed from the baselines; engines that failed must not be.
        installed = installed_engines()
        absent = [
            verdict
            for _, verdict in verdicts
            if verdict.engine in installed and verdict.quantity == "run" and verdict.reason.startswith("did not")
        ]
        if absent:
            raise ScenarioError(f"no baseline written: {absent[0].engine} {absent[0].reason}")
        written = [str(path) for path in update_baselines(fresh, verdicts, reason, baselines)]
    refused = refused_verdicts(verdicts) if update else []
    warnings = list_bicycle_warnings(scenario)
    left_out = {} if engine else list_left_out(baselines, scenario)
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
                    "verdicts": rows,
                }
            )
        else:
            console = make_console()
            show_verdicts(console, verdicts, renewed=update)
            if left_out:
                install = "; ".join(dict.fromkeys(left_out.values()))
                line = f"not judged, their libraries are not installed: {', '.join(left_out)}; install: {install}"
                console.print(line, markup=False, highlight=False, soft_wrap=True)
            for name, lines in warnings.items():
                for line in lines:
                    text = f"warning: {name}: {line}"
                    console.print(text, style="yellow", markup=False, soft_wrap=True)
            if update and not written and not refused:
                console.print("no baseline written: nothing moved beyond its limit")
            for name in written:
                console.print(f"baseline written: {name}", soft_wrap=True)
            for name, verdict in refused:
                line = f"no baseline written of {verdict.engine} on {name}: {verdict.reason}"
                console.print(line, style="red", markup=False, soft_wrap=True)


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
