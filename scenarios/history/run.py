"""Ride the releases of a history, several at once, and keep every row as soon as it is there."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .bisect import bisect_history
from .children import Children, StoppedError
from .document import make_history_document
from .environments import NotInstallable, open_environment, read_cached_packages
from .pairs import make_pair_documents
from .plan import HistoryPlan, PlannedRide
from .problems import RideFile, store_rides
from .process import ride_tasks
from .releases import Release
from .ride import NOT_INSTALLABLE, RODE
from .store import HistoryFolder

# (ride, row, whether it was ridden in this session)
HistoryWatch = Callable[[PlannedRide, Mapping[str, Any], bool], None]
_LOOK = 0.2  # [s] between two moments at which Ctrl-C is noticed


@dataclass(frozen=True)
class HistoryOptions:
    """How a history is ridden.

    Attributes
    ----------
    cache : Path
        Folder of environments.
    workers : int
        Number of releases that ride at once.
    time_limit : float
        Wall-clock time after which a ride counts as hung [s].
    bisect : bool
        Whether to ride only the releases that are needed to find those that moved something.
    """

    cache: Path
    workers: int
    time_limit: float
    bisect: bool = False


def run_history(
    plan: HistoryPlan, folder: HistoryFolder, options: HistoryOptions, watch: HistoryWatch, children: Children
) -> tuple[dict[str, Any], list[Path]]:
    """Ride what is missing, and write the documents, the table and the pages.

    Ctrl-C ends the rides that run; the finished ones are in the document, which is then not complete.

    Returns
    -------
    document : dict
    paths : list of Path
    """
    rows: dict[PlannedRide, Mapping[str, Any]] = {}
    complete = True

    def ride_missing(rides: Sequence[PlannedRide]) -> dict[PlannedRide, Mapping[str, Any]]:
        found: dict[PlannedRide, Mapping[str, Any]] = {}
        cached = {release: read_cached_packages(release, options.cache) for release in {ride.release for ride in rides}}
        for ride in rides:
            row = folder.read(ride)
            # The same version may have other bytes by now: a row counts for those that would ride.
            if row is not None and cached[ride.release] in (None, row["packages"]):
                rows[ride] = found[ride] = row
                watch(ride, row, False)
        missing = [ride for ride in rides if ride not in found]
        found.update(_ride_all(plan, missing, folder, options, watch, children, rows))
        return found

    with folder.lock():
        try:
            if options.bisect:
                bisect_history(plan, ride_missing)
            else:
                ride_missing(plan.rides)
        except KeyboardInterrupt:
            complete = False
        finally:
            children.stop()
        found = {ride: rows[ride] for ride in plan.rides if ride in rows}
        document = make_history_document(plan, found, complete=complete, bisected=options.bisect)
        return document, folder.finish(document, make_pair_documents(plan, found, document), found)


def _ride_all(
    plan: HistoryPlan,
    rides: Sequence[PlannedRide],
    folder: HistoryFolder,
    options: HistoryOptions,
    watch: HistoryWatch,
    children: Children,
    rows: dict[PlannedRide, Mapping[str, Any]],
) -> dict[PlannedRide, Mapping[str, Any]]:
    """Ride all, several releases at once; put every row into ``rows`` as soon as it is there, and return them."""
    by_release: dict[Release, list[PlannedRide]] = {}
    for ride in rides:
        by_release.setdefault(ride.release, []).append(ride)
    if not by_release:
        return {}
    lock, found = threading.Lock(), dict[PlannedRide, Mapping[str, Any]]()

    def keep(ride: PlannedRide, row: Mapping[str, Any]) -> None:
        with lock:
            folder.write(ride, row)
            rows[ride] = found[ride] = row
            watch(ride, row, True)

    with store_rides(plan.scenarios) as file, ThreadPoolExecutor(min(options.workers, len(by_release))) as pool:
        waiting = {
            pool.submit(_ride_release, release, missing, file, options, keep, children)
            for release, missing in by_release.items()
        }
        try:
            while waiting:
                done, waiting = wait(waiting, timeout=_LOOK, return_when=FIRST_COMPLETED)
                for future in done:
                    future.result()
        except BaseException:
            children.stop()
            for future in waiting:
                future.cancel()
            raise
    return found


def _ride_release(
    release: Release,
    rides: Sequence[PlannedRide],
    file: RideFile,
    options: HistoryOptions,
    keep: Callable[[PlannedRide, Mapping[str, Any]], None],
    children: Children,
) -> None:
    tasks = [(ride.scenario, ride.engine) for ride in rides]
    try:
        with open_environment(release, options.cache, children) as environment:
            about = {"packages": environment.packages, "installed": environment.installed}
            arriving = ride_tasks(release, environment, tasks, file, options.time_limit, children)
            for ride, row in zip(rides, arriving, strict=True):
                if children.stopped:
                    return
                if row["status"] != RODE and not environment.is_there():
                    # A row that --resume tries again: what the ride says was the removal's fault.
                    row = {"status": NOT_INSTALLABLE, "reason": f"{environment.folder} was removed while it rode"}
                keep(ride, row | about)
    except NotInstallable as error:
        if children.stopped:
            return  # pip was ended, and says nothing about the release
        for ride in rides:
            keep(ride, {"status": NOT_INSTALLABLE, "reason": str(error)})
    except StoppedError:
        return
