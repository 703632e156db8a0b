"""Load a run folder as the result that `velodrome.run` returned."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...engines.engine import Problem
from ..error import ScenarioError
from ..run import read_document, read_ride, read_start_state, read_stored_scenario
from ..scenario import Scenario, output_times, show_value
from ..view import find_recording
from .arguments import read_path
from .result import Run
from .table import MetricsTable


def load(folder: str | Path) -> Run:
    """Load a run folder that `velodrome run` or ``velodrome.run(..., out=...)`` has written.

    Parameters
    ----------
    folder : str or Path

    Returns
    -------
    Run
        The run; trajectories, metrics and start equal the written ones to the bit.

    Raises
    ------
    ScenarioError
        If it is no path or no run folder, or a file of it is missing, damaged or of another run.

    Examples
    --------
    >>> import tempfile, velodrome
    >>> with tempfile.TemporaryDirectory() as out:
    ...     written = velodrome.run("plane-circle", engines=["mujoco-native"], duration=0.1, out=out)
    ...     again = velodrome.load(written.folder)
    >>> again.metrics == written.metrics
    True
    """
    folder = read_path("folder", folder)
    manifest, metrics = read_document(folder, "manifest.json"), read_document(folder, "metrics.json")
    scenario = read_stored_scenario(folder, manifest)
    try:
        return _read_run(folder, manifest, metrics, scenario)
    except ScenarioError:
        raise
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        raise ScenarioError(f"{folder}: not the files of one run: {show_value(f'{kind}{error}')}") from error


def _read_run(folder: Path, manifest: Mapping[str, Any], metrics: Mapping[str, Any], scenario: Scenario) -> Run:
    def record(where: Path) -> None:
        shutil.copy(find_recording(folder), where)

    q, qd = read_start_state(manifest)
    bicycle, surface = scenario.make_bicycle(), scenario.surface.make()
    family, entries = manifest["start"]["family"], manifest["engines"]
    return Run(
        name=str(manifest["scenario"]),
        title=str(manifest["title"]),
        start=Problem(bicycle, surface, q, qd, output_times(scenario.simulation), scenario.make_inputs()),
        growth_rate=float(manifest["start"]["growth_rate"]),
        family=None if family is None else int(family),
        trajectories={name: read_ride(folder, manifest, metrics, name) for name in metrics},
        metrics=MetricsTable(metrics, scenario.simulation.duration),
        verdicts=tuple(manifest["verdicts"]),
        failures={name: str(entry["failed"]) for name, entry in entries.items() if "failed" in entry},
        left_out=dict(manifest["left_out"]),
        folder=folder,
        complete=bool(manifest["complete"]),
        recorder=record,
    )
