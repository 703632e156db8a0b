"""Read a run folder back into what `velodrome.run` gave."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...engines.engine import Problem
from ..error import ScenarioError
from ..run import find_part, read_document, read_ride, read_start_state
from ..scenario import Scenario, load_scenario, output_times, show_value
from ..view import RECORDING
from .arguments import read_path
from .result import Run
from .table import MetricsTable


def load(folder: str | Path) -> Run:
    """Read the run folder that `velodrome run` or ``velodrome.run(..., out=...)`` has written.

    Parameters
    ----------
    folder : str or Path

    Returns
    -------
    Run
        Trajectories, metrics and start are to the bit those that were written.

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
    _, scenario = load_scenario(str(find_part(folder, "scenario.toml")))
    try:
        return _read(folder, manifest, metrics, scenario)
    except ScenarioError:
        raise
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        raise ScenarioError(f"{folder}: not the files of one run: {show_value(f'{kind}{error}')}") from error


def _read(folder: Path, manifest: Mapping[str, Any], metrics: Mapping[str, Any], scenario: Scenario) -> Run:
    def record(where: Path) -> None:
        shutil.copy(find_part(folder, RECORDING), where)

    q, qd = read_start_state(manifest)
    bicycle, surface = scenario.make_bicycle(), scenario.surface.make()
    family, entries = manifest["start"]["family"], manifest["engines"]
    return Run(
        name=str(manifest["scenario"]),
        title=str(manifest["title"]),
        start=Problem(bicycle, surface, q, qd, output_times(scenario.simulation)),
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
