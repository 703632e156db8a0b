"""What a history rides: the releases, the engines of the package, and the scenarios; all bad input is found here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...engines.engine import REFERENCE
from ...engines.names import suggest_name
from ...engines.registry import list_library_packages
from ..error import ScenarioError
from ..run import configure_engine, installed_engines
from ..scenario import choose_engines, join_complaints, show_value
from .adapters import digest_adapter
from .children import Children
from .dates import find_release_dates
from .environments import list_cached_versions
from .pip_calls import PipError, list_registry_versions
from .problems import MeasuredRide, describe_comparison, digest_json, prepare_ride
from .releases import (
    Release,
    ReleaseRange,
    nearest_version,
    order_releases,
    parse_release_range,
    read_wheel_releases,
)

HISTORY_SCENARIOS = ("plane-circle", "q2-plus")  # a circle and a disturbed one; both measure the order


@dataclass(frozen=True)
class PlannedRide:
    """One release in one engine on one scenario.

    Attributes
    ----------
    release : Release
    engine, scenario : str
    key : str
        SHA-256 of all that determines its row.
    ride, comparison : str
        SHA-256 of two parts of it: the ride in the engine, and what results depend on beside ride and release.
    """

    release: Release
    engine: str
    scenario: str
    key: str
    ride: str
    comparison: str


@dataclass(frozen=True)
class HistoryPlan:
    """A history that has been checked.

    Attributes
    ----------
    package : str
        Canonical name.
    releases : tuple of Release
        Oldest first.
    engines : tuple of str
    scenarios : dict
        By name.
    rides : tuple of PlannedRide
        In the order of releases, scenarios and engines.
    remarks : tuple of str
        Lines for the user, such as that the registry could not be asked.
    dates : dict
        Day of upload by version, ISO 8601, where the registry gives it.
    """

    package: str
    releases: tuple[Release, ...]
    engines: tuple[str, ...]
    scenarios: Mapping[str, MeasuredRide]
    rides: tuple[PlannedRide, ...]
    remarks: tuple[str, ...] = ()
    dates: Mapping[str, str] = field(default_factory=dict)

    def find_date(self, release: Release) -> str | None:
        """Return the day on which a release was uploaded; None where it is unknown, and for a wheel."""
        return self.dates.get(release.version) if release.wheel is None else None


def plan_history(
    wanted: str,
    sources: Sequence[str] = (),
    engines: Sequence[str] = (),
    wheels: Sequence[Path] = (),
    *,
    cache: Path,
    children: Children,
) -> HistoryPlan:
    """Find the releases and engines, and compute the start of every scenario.

    Parameters
    ----------
    wanted : str
        A package with its releases, as `parse_release_range` takes it.
    sources : sequence of str
        Scenarios by library name or path; `HISTORY_SCENARIOS` without any.
    engines : sequence of str
        Engines of the package by name or pattern; all installed ones without any.
    wheels : sequence of Path
        Further releases, with companions that they require.
    cache : Path
        Folder of environments.
    children : Children

    Raises
    ------
    ScenarioError
        If anything of it is wrong, in one line.
    """
    asked = parse_release_range(wanted)
    names = choose_package_engines(asked.package, engines)
    own = read_wheel_releases(wheels, asked.package)
    if not asked.alternatives and not own:
        raise ScenarioError(
            f"{show_value(repr(wanted))}: name the releases too, e.g. '{asked.package}>=1.0', or give wheels by --wheel"
        )
    versions, remarks = find_versions(asked, cache, children)
    releases = order_releases(asked.package, versions, own)
    if not releases:
        raise ScenarioError(f"{show_value(wanted)}: no release is known. {' '.join(remarks)}".strip())
    rides: dict[str, MeasuredRide] = {}
    for source in dict.fromkeys(sources or HISTORY_SCENARIOS):
        ride = prepare_ride(source)
        if ride.scenario in rides:
            raise ScenarioError(f"{show_value(source)}: a second scenario named {ride.scenario!r}; rename the file")
        for engine in names:
            configure_engine(engine, ride.settings_of(engine))  # bad settings are found before anything is installed
        rides[ride.scenario] = ride
    compared_with = describe_comparison(asked.package)
    planned = [
        PlannedRide(
            release,
            engine,
            name,
            key=_identify(release, engine, ride, compared_with),
            ride=ride.identify_for(engine),
            comparison=digest_json([dict(compared_with), digest_adapter(engine, release.package)]),
        )
        for release in releases
        for name, ride in rides.items()
        for engine in names
    ]
    # Where the registry has not answered, it is not asked again.
    dates = find_release_dates(asked.package, versions, cache, children, ask=not remarks)
    return HistoryPlan(asked.package, releases, tuple(names), rides, tuple(planned), tuple(remarks), dates)


def choose_package_engines(package: str, wanted: Sequence[str]) -> list[str]:
    """Return the engines whose results depend on the releases of a package.

    Raises
    ------
    ScenarioError
        If no installed engine is of the package, or one that is named is not.
    """
    known = {name: _list_packages_safely(name) for name in installed_engines() if name != REFERENCE}
    fitting = [name for name, found in known.items() if package in found]
    if not fitting:
        there = sorted({one for found in known.values() for one in found})
        raise ScenarioError(
            f"no installed engine is of the package {show_value(repr(package))} ({suggest_name(package, there)})"
        )
    if not wanted:
        return fitting
    choice, faults = choose_engines(wanted)
    complaints = list(faults.values())
    complaints += [
        f"engine {name!r} is not of the package {package!r} (there are {', '.join(fitting)})"
        for name in sorted(choice.named)
        if name not in fitting
    ]
    chosen = [name for name in choice.names if name in fitting]
    if not complaints and not chosen:
        complaints = [f"--engine: no engine of the package {package!r} fits (there are {', '.join(fitting)})"]
    if complaints:
        raise ScenarioError(join_complaints(complaints))
    return chosen


def _list_packages_safely(engine: str) -> tuple[str, ...]:
    try:
        return list_library_packages(engine)
    except ValueError:  # an engine that cannot be loaded is no reason against the others
        return ()


def find_versions(asked: ReleaseRange, cache: Path, children: Children) -> tuple[list[str], list[str]]:
    """Return the versions that a range names, and lines for the user.

    The registry is asked unless all versions are written out and in the cache. If it cannot be asked, the range is that
    of the cache; versions that are written out remain, since a wheel of them may be found all the same.

    Raises
    ------
    ScenarioError
        If the registry has releases, and one that is written out or all of the range are not among them.
    """
    if not asked.alternatives:
        return [], []
    cached = list_cached_versions(asked.package, cache)
    exact = asked.exact
    if exact is not None and {*exact} <= {*cached}:
        return asked.select(exact), []
    pre = any(one.prereleases for one in asked.alternatives)
    try:
        there = list_registry_versions(asked.package, pre, children)
    except PipError as error:
        found = asked.select(exact if exact is not None else cached)
        there_are = f"{len(asked.select(cached))} of them in the cache"
        return found, [f"the releases of {asked.package} are not known ({error}); {there_are}"]
    known = {*there, *cached}
    missing = [text for one in asked.alternatives if not list(one.filter(known)) for text in [str(one)]]
    if missing and (exact is not None or len(missing) == len(asked.alternatives)):
        near = nearest_version(missing[0].lstrip("=<>!~").partition(",")[0], known)
        hint = f"; the nearest is {near}" if near is not None else ""
        raise ScenarioError(f"{asked.package}: no release fits {' or '.join(missing)} on this platform{hint}")
    return asked.select(known), []


def _identify(release: Release, engine: str, ride: MeasuredRide, compared_with: Mapping[str, Any]) -> str:
    adapter = digest_adapter(engine, release.package)
    settings = ride.settings_of(engine)
    return digest_json([release.key, release.digest, engine, adapter, settings, ride.digest, dict(compared_with)])
