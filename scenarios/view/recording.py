"""The recording of a stored run, made from its files."""

from __future__ import annotations

from pathlib import Path

from ...reports.measure import cut_at_fall, evaluate_ride
from ..error import ScenarioError
from ..run import RunPlan, read_document, read_ride, read_stored_scenario, write_run_recording
from ..scenario import make_start, show_value


def record_stored_run(folder: Path, where: Path, rate: float | None = None) -> str | None:
    """Write the recording of a stored run into another folder, as `velodrome run` writes it.

    Parameters
    ----------
    folder : Path
        A run folder.
    where : Path
        Folder to write into.
    rate : float, optional
        Largest number of samples a second [Hz].

    Returns
    -------
    str or None
        What the recording leaves out; None if it holds every sample.

    Raises
    ------
    ScenarioError
        If the folder is not a run folder, with the file that is missing or cannot be read.
    """
    manifest, measured = read_document(folder, "manifest.json"), read_document(folder, "metrics.json")
    scenario = read_stored_scenario(folder, manifest)
    try:
        plan = RunPlan(manifest["scenario"], scenario, make_start(scenario), {}, {})
        on = plan.start.problem.bicycle, plan.start.problem.surface
        rides = {name: evaluate_ride(read_ride(folder, manifest, measured, name), *on) for name in measured}
        shown = {name: cut_at_fall(ride, *on) for name, ride in rides.items()}
        entries = manifest["engines"].items()
        failures = {name: str(entry["failed"]) for name, entry in entries if "failed" in entry}
        return write_run_recording(where, plan, shown, measured, failures, manifest.get("verdicts", []), rate=rate)
    except ScenarioError:
        raise
    except (LookupError, TypeError, AttributeError, ArithmeticError, ValueError) as error:
        what = show_value(f"{type(error).__name__}: {error}")
        raise ScenarioError(f"{folder}: not the files of one run: {what}") from error
