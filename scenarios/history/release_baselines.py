"""Baselines of the gate that one release of an engine's package gives, ridden in the release's own environment."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from packaging.version import Version

from ...engines.registry import load_engine
from ..error import ScenarioError
from ..gate import GivenBaselines, gate_scenarios, gated_names
from .children import Children
from .companions import describe_registry_companions
from .one_release import open_named_environment, parse_one_release, require_one_release
from .plan import HistoryPlan, PlannedRide, plan_history
from .problems import store_rides
from .process import ride_tasks
from .releases import Release
from .ride import RODE

_OPTION = "--baseline-of"


def plan_release_baselines(
    wanted: str,
    sources: Sequence[str] = (),
    engines: Sequence[str] = (),
    wheels: Sequence[Path] = (),
    *,
    cache: Path,
    children: Children,
) -> HistoryPlan:
    """Find the release whose rides are to be baselines, its engines, and the starts of the scenarios.

    Parameters
    ----------
    wanted : str
        ``PACKAGE==VERSION``, or the package alone where a wheel is given.
    sources : sequence of str
        Scenarios by library name or path; the library's gated ones without any.
    engines : sequence of str
        Engines of the package by name or pattern; all installed ones without any.
    wheels : sequence of Path
        The release, if it is a build: its wheel and those of its companions.
    cache : Path
        Folder of environments.
    children : Children

    Raises
    ------
    ScenarioError
        If anything of it is wrong, in one line, or it is more or less than one release.
    """
    parse_one_release(wanted, wheels, _OPTION)
    plan = plan_history(wanted, sources or gated_names(), engines, wheels, cache=cache, children=children)
    require_one_release(plan.releases, wanted, _OPTION)
    return plan


def ride_release_baselines(
    plan: HistoryPlan,
    watch: Callable[[int, int], None],
    note: Callable[[str], None],
    *,
    all_rides: bool,
    cache: Path,
    time_limit: float,
    children: Children,
) -> GivenBaselines:
    """Ride one release, and return what its engines measure as baselines.

    Parameters
    ----------
    plan : HistoryPlan
        By `plan_release_baselines`.
    watch : callable
        Called with the number of rides that are done and that of all.
    note : callable
        Called with lines for the user.
    all_rides : bool
        Whether engines with long rides ride every scenario, as they do where scenarios are named.
    cache : Path
        Folder of environments.
    time_limit : float
        Wall-clock time after which a ride counts as hung [s].
    children : Children

    Raises
    ------
    ScenarioError
        If the release cannot be installed, or none of its engines rides anything.
    """
    (release,) = plan.releases
    name = f"{release.package} {release.label}"
    rides = [one for one in plan.rides if all_rides or _is_ridden_unnamed(one)]
    entries: dict[str, dict[str, Any]] = {}
    reasons: dict[str, dict[str, str]] = {}
    with (
        open_named_environment(release, _OPTION, cache, children) as environment,
        store_rides(plan.scenarios) as file,
    ):
        remark = describe_registry_companions(release, environment.packages)
        if remark is not None:
            note(remark)
        tasks = [(ride.scenario, ride.engine) for ride in rides]
        watch(0, len(rides))
        arriving = ride_tasks(release, environment, tasks, file, time_limit, children)
        for done, (ride, row) in enumerate(zip(rides, arriving, strict=True), 1):
            if row["status"] == RODE:
                entries.setdefault(ride.scenario, {})[ride.engine] = _make_entry(release, name, ride.engine, row)
            else:
                why = f"no baseline: with {name} it did not ride ({row['status']}): {row['reason']}"
                reasons.setdefault(ride.scenario, {})[ride.engine] = why
            watch(done, len(rides))
    if not entries:
        scenario, found = next(iter(reasons.items()))
        engine, why = next(iter(found.items()))
        raise ScenarioError(f"{_OPTION}: {name} gives no baseline: {engine} on {scenario}: {why.partition(': ')[2]}")
    return GivenBaselines(plan.package, name, plan.engines, entries, reasons)


def _is_ridden_unnamed(ride: PlannedRide) -> bool:
    """Whether the gate rides a scenario in an engine where no scenario is named."""
    return ride.scenario in gate_scenarios().get(ride.engine, [ride.scenario])


def _make_entry(release: Release, name: str, engine: str, row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row of a ride as an entry of a baseline."""
    return {
        "release": name,
        "version": _tell_apart(release, name, engine, row["version"]),
        "settings": row["settings"],
        "step_noise": row["step_noise"],
        "quantities": row["quantities"],
    }


def _tell_apart(release: Release, name: str, engine: str, ridden: str) -> str:
    """Return the version of a ride, which differs from the installed engine's if the release is another one.

    An engine's version may not tell its releases apart: those of two builds are the same, and so are those of an engine
    that names another library's version.
    """
    if _is_installed(release) or ridden != load_engine(engine).version:
        return ridden
    return f"{ridden} of {name}"


def _is_installed(release: Release) -> bool:
    """Whether a release of the registry is the one in the suite's own environment, by its version."""
    try:
        return release.wheel is None and Version(version(release.package)) == Version(release.version)
    except PackageNotFoundError:
        return False
