"""The run folder: its manifest, recording and report page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ...engines.engine import Engine, Settings, Trajectory
from ...engines.registry import packages
from ...engines.releases import find_reach
from ...reports.drawing import find_unsteadiness
from ..error import ScenarioError
from ..files import write_sealed, write_text
from ..scenario import Scenario, Start, resolve_scenario
from .machine import describe_machine, find_commit

LIBRARIES = ("velodrome", "numpy", "scipy", "numba", "exudyn", "mujoco", "rerun-sdk", "pyarrow", "jinja2")


SCENARIO_FILE = "scenario.toml"
RECORDING = "comparison.rrd"
SCENARIO_DIGEST_KEY = "scenario_sha256"
# Format version of manifest.json and metrics.json; files of version 1 have neither a digest nor a version.
RUN_VERSION = 2


@dataclass(frozen=True)
class RunPlan:
    """A run whose scenario, engines and settings have been checked.

    Attributes
    ----------
    name : str
    scenario : Scenario
    start : Start
    engines : dict
        Pairs of engine and settings by name, the reference first.
    left_out : dict
        Reasons by engine, for engines that were not requested by name and do not support this problem.
    release : mapping, optional
        Facts about the release with which its engines run, where that is not the one of the suite's environment; see
        `velodrome.scenarios.history.release_run`.
    """

    name: str
    scenario: Scenario
    start: Start
    engines: dict[str, tuple[Engine, Settings]]
    left_out: dict[str, str]
    release: Mapping[str, Any] | None = None


def new_folder(out: Path, name: str) -> Path:
    """Make a new folder named after the scenario and the time; existing folders are never changed."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S")
    for attempt in range(1, 1000):
        folder = out / (f"{name}-{stamp}" if attempt == 1 else f"{name}-{stamp}-{attempt}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise ScenarioError(f"{out}: the run folder cannot be made: {error.strerror}") from error
        return folder
    raise ScenarioError(f"{out}: too many runs of {name} in one second")


def resolve_plan(plan: RunPlan) -> Scenario:
    """Return the scenario of a plan with all parameters and all settings of the engines that take part."""
    return resolve_scenario(plan.scenario, {name: settings for name, (_, settings) in plan.engines.items()})


def write_manifest(
    folder: Path,
    plan: RunPlan,
    scenario_digest: str,
    trajectories: Mapping[str, Trajectory],
    failures: Mapping[str, str],
    verdicts: Sequence[Mapping[str, Any]] = (),
    complete: bool = False,
    recording: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Write the manifest of a run (engines, versions, settings, start) and return it.

    Parameters
    ----------
    folder : Path
    plan : RunPlan
    scenario_digest : str
        `velodrome.scenarios.files.file_digest` of the folder's scenario file.
    trajectories : mapping
        Finished trajectories by engine.
    failures : mapping
        Reasons by engine, for engines that gave no trajectory.
    verdicts : sequence of mapping
    complete : bool
        Whether every engine has finished or failed.
    recording : mapping, optional
        What is to be known of the recording: under ``leaves_out``, what `write_run_recording` returns.
    """
    start = plan.start
    engines: dict[str, Any] = {}
    for name, (engine, settings) in plan.engines.items():
        entry: dict[str, Any] = {"version": engine.version, "settings": settings.model_dump()}
        reach = find_reach(engine)
        if reach is not None:
            entry |= reach.list_adaptations()
        if name in trajectories:
            done = trajectories[name]
            entry |= {"cpu_time": done.cpu_time, "steps": done.steps, "ended": done.ended}
        if name in failures:
            entry["failed"] = failures[name]
        engines[name] = entry
    manifest = {
        "scenario": plan.name,
        "title": plan.scenario.title,
        SCENARIO_DIGEST_KEY: scenario_digest,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "complete": complete,
        **({} if plan.release is None else {"release": dict(plan.release)}),
        "engines": engines,
        "left_out": plan.left_out,
        "warnings": list(plan.start.problem.bicycle.warnings()),
        "verdicts": list(verdicts),
        "recording": recording,
        **describe_run_environment(),
        "inputs": asdict(start.problem.inputs),
        "start": {
            "family": start.family,
            "growth_rate": start.growth_rate,
            "q": start.problem.q.tolist(),
            "qd": start.problem.qd.tolist(),
        },
    }
    write_sealed(folder / "manifest.json", manifest, RUN_VERSION)
    return manifest


def describe_run_environment() -> dict[str, Any]:
    """Return what results depend on beside their input: ``libraries``, the ``suite``'s commit and the ``platform``."""
    return {"libraries": library_versions(), "suite": find_commit(), "platform": describe_machine()}


def library_versions() -> dict[str, str]:
    """Return the versions of the installed libraries that results depend on, and of the engines' packages."""
    found = packages()
    for library in LIBRARIES:
        try:
            found[library] = version(library)
        except PackageNotFoundError:
            continue
    return found


def write_run_recording(
    folder: Path,
    plan: RunPlan,
    shown: Mapping[str, Trajectory],
    measured: Mapping[str, Mapping[str, Any]],
    failures: Mapping[str, str],
    verdicts: Sequence[Mapping[str, Any]],
    *,
    rate: float | None = None,
) -> str | None:
    """Write the recording of the trajectories to show; without trajectories, write nothing.

    Parameters
    ----------
    folder : Path
    plan : RunPlan
    shown, measured, failures, verdicts
        See `velodrome.scenarios.run.runner.RunResult`.
    rate : float, optional
        Largest number of samples a second [Hz]; see `velodrome.reports.recording.write_recording`.

    Returns
    -------
    str or None
        What the recording leaves out; None if it holds every sample.
    """
    if not shown:
        return None
    # Imported here, since loading rerun takes a second and only runs need it.
    from ...reports.recording import make_summary, make_verdict, write_recording

    problem, duration = plan.start.problem, plan.scenario.simulation.duration
    unsteady = find_unsteadiness(problem.surface, problem.inputs, plan.start.motion is not None)
    facts = (plan.start.growth_rate, duration, unsteady)
    return write_recording(
        folder / RECORDING,
        plan.scenario.title,
        problem.bicycle,
        problem.surface,
        shown,
        make_verdict(measured, failures, verdicts, duration),
        make_summary(plan.scenario.title, measured, failures, verdicts, *facts),
        undisturbed=plan.start.undisturbed if unsteady is None else None,
        inputs=problem.inputs,
        rate=rate,
    )


def write_page(
    folder: Path,
    plan: RunPlan,
    shown: Mapping[str, Trajectory],
    measured: Mapping[str, Mapping[str, Any]],
    manifest: Mapping[str, Any],
) -> None:
    """Write the report page of the trajectories to show; see `velodrome.reports.page`."""
    from ...reports.page import make_page

    surface = plan.start.problem.surface
    text = make_page(manifest, plan.scenario.model_dump(), measured, manifest["verdicts"], shown, surface)
    write_text(folder / "report.html", text)
