"""The recording of a stored run, made from its files."""

from __future__ import annotations

from pathlib import Path

from ..run import RunPlan, read_document, read_stored_scenario, write_run_recording
from ..scenario import make_start
from .stored_rides import naming_broken_files, read_shown_rides


def record_stored_run(folder: Path) -> None:
    """Write the recording of a stored run into its folder, as `velodrome run` writes it.

    Parameters
    ----------
    folder : Path
        A run folder.

    Raises
    ------
    ScenarioError
        If the folder is not a run folder, with the file that is missing or cannot be read.
    """
    manifest, measured = read_document(folder, "manifest.json"), read_document(folder, "metrics.json")
    scenario = read_stored_scenario(folder, manifest)
    with naming_broken_files(folder):
        plan = RunPlan(manifest["scenario"], scenario, make_start(scenario), {}, {})
        problem = plan.start.problem
        shown = read_shown_rides(folder, manifest, measured, problem.bicycle, problem.surface)
        entries = manifest["engines"].items()
        failures = {name: str(entry["failed"]) for name, entry in entries if "failed" in entry}
        write_run_recording(folder, plan, shown, measured, failures, manifest.get("verdicts", []))
