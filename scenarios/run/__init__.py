"""Runs of a scenario in every engine: planning, simulation, measurement and the run folder."""

from ..scenario import configure_engine, installed_engines
from .folder import RECORDING, RunPlan, describe_run_environment, library_versions, write_run_recording
from .runner import (
    RunOutcome,
    RunResult,
    RunWatch,
    Trace,
    claimed_noise,
    measure_one,
    measure_run,
    plan_run,
    ride_plan,
    run_plan,
    store_run,
)
from .stored import (
    check_stored_scenario,
    find_part,
    read_document,
    read_json,
    read_ride,
    read_sealed,
    read_start_state,
    read_stored_scenario,
)

__all__ = [
    "RECORDING",
    "RunOutcome",
    "RunPlan",
    "RunResult",
    "RunWatch",
    "Trace",
    "check_stored_scenario",
    "claimed_noise",
    "configure_engine",
    "describe_run_environment",
    "find_part",
    "installed_engines",
    "library_versions",
    "measure_one",
    "measure_run",
    "plan_run",
    "read_document",
    "read_json",
    "read_ride",
    "read_sealed",
    "read_start_state",
    "read_stored_scenario",
    "ride_plan",
    "run_plan",
    "store_run",
    "write_run_recording",
]
