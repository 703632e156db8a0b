"""The process that rides one release: ``python -m velodrome.scenarios.history.ride``, in lines of JSON.

Standard input: first the `RideSetup`, then one task per line. Standard output: one line per task; and, when the process
is asked by a signal, where it is in its code. The process lays the release's environment over its own and loads the
reference. Every ride is done by a fork of it, in which the engine's library is loaded: no ride can change another one,
and a crash ends one ride only. A result is held back unless all that was loaded of the release's packages comes from
its environment.
"""

from __future__ import annotations

import json
import math
import os
import signal
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any

import numpy as np

from ...engines.engine import REFERENCE, Trajectory, UnsuitableProblem, why_failed
from ...engines.guard import call_engine
from ...engines.registry import load_engine
from ...engines.storage import digest, trajectory_table
from ..error import ScenarioError
from ..gate import SHOWN, take_sample
from ..run import configure_engine
from .adapters import digest_adapter
from .loaded import list_loaded_packages
from .overlay import WrongRelease, lay_over, require_loaded_from, require_release
from .problems import MeasuredRide, digest_suite, read_rides
from .protocol import ASKING, answer_where, describe_exit, die_with, reserve_streams, send_message
from .requirements import list_top_modules

_MOST_SAMPLES = 41  # of a stored ride; the digest covers all of it
_LONGEST_REASON = 500  # characters
_TIMING = "cpu_ratio"  # it differs from run to run
RODE, REFUSED, FAILED, NOT_INSTALLABLE = "rode", "refused", "failed", "not-installable"
REPEATED = "repeated"  # key of rows that are ridden again when the history goes on: it was not the release that broke


@dataclass(frozen=True)
class RideSetup:
    """What a ride process needs to know before its first task.

    Attributes
    ----------
    parent : int
        Process with which it ends.
    folder : str
        The release's environment.
    package, version : str
        The release.
    rides, rides_sha256 : str
        File of the rides, by `velodrome.scenarios.history.problems.store_rides`, and its digest.
    suite_sha256 : str
        Digest of the suite's code, with which this process must ride too.
    adapters : dict
        Digests of the adapters' code, by engine; None where the suite's or the release's covers it.
    """

    parent: int
    folder: str
    package: str
    version: str
    rides: str
    rides_sha256: str
    suite_sha256: str
    adapters: dict[str, str | None]

    def line(self) -> str:
        """Return the setup as one line of JSON."""
        return json.dumps(asdict(self))


def main() -> None:
    """Do tasks until the input ends."""
    tasks, results = reserve_streams()
    answer_where(results)
    try:
        setup = RideSetup(**json.loads(tasks.readline()))
        die_with(setup.parent)
        folder = Path(setup.folder)
        own = lay_over(folder)
        require_release(folder, setup.package, setup.version)
        if digest_suite() != setup.suite_sha256:
            raise WrongRelease("the suite's own code has changed since the history was started")
        for engine, known in setup.adapters.items():
            if digest_adapter(engine, setup.package) != known:
                raise WrongRelease(f"the code of the engine {engine} has changed since the history was started")
        rides = read_rides(Path(setup.rides), setup.rides_sha256)
        _warm_up(next(iter(rides.values())))
        owners = packages_distributions()
    except Exception as error:  # reported to the parent, since there is no other output
        send_message(results, {"broken": reason_of_failure(error)})
        sys.exit(1)
    for line in tasks:
        task = json.loads(line)
        send_message(results, _ride_in_fork(rides[task["scenario"]], task["engine"], own, owners))


def _ride_in_fork(ride: MeasuredRide, engine: str, own: list[Path], owners: Mapping[str, list[str]]) -> dict[str, Any]:
    """Ride in a fork of this process, and return the row."""
    ours, theirs = os.pipe()
    parent = os.getpid()
    signal.pthread_sigmask(signal.SIG_BLOCK, {ASKING})  # from now on the fork answers
    child = os.fork()
    if child == 0:
        status = 1
        try:
            die_with(parent)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {ASKING})
            row = ride_release(ride, engine, own)
            send_message(theirs, row | {"loaded": list_loaded_packages(own, owners)})
            status = 0
        finally:
            os._exit(status)
    os.close(theirs)
    with os.fdopen(ours, "rb") as answer:
        line = answer.readline()  # up to its end, or to the end of the process
    _, ended = os.waitpid(child, 0)
    try:
        return json.loads(line)
    except ValueError:
        how = describe_exit(os.waitstatus_to_exitcode(ended))
        return {"status": FAILED, "reason": f"its process ended by {how}", REPEATED: True}


def _warm_up(ride: MeasuredRide) -> None:
    """Load what every ride needs, so that its fork has it."""
    reference = load_engine(REFERENCE)
    take_sample(ride.start, ride.exact, ride.gate, reference, reference.settings(), lambda _: None)


def ride_release(ride: MeasuredRide, name: str, own: list[Path]) -> dict[str, Any]:
    """Ride an engine with the laid-over release, and return the row of its result."""
    try:
        engine, settings = configure_engine(name, ride.settings_of(name), any_release=True)
        sample = call_engine(take_sample, ride.start, ride.exact, ride.gate, engine, settings, watch=lambda _: None)
        require_loaded_from(own)
    except Exception as error:  # an engine may raise anything; the row says what
        status = REFUSED if isinstance(error, UnsuitableProblem | ScenarioError) else FAILED
        return {"status": status, "reason": reason_of_failure(error), REPEATED: _is_of_surroundings(error, own)}
    quantities = {quantity: value for quantity, value in sample.values.items() if quantity != _TIMING}
    return {
        "status": RODE,
        "reason": None,
        "version": sample.version,
        "settings": sample.settings,
        "step_noise": sample.step_noise,
        "bits": digest_ride(sample.trajectory),
        "quantities": _to_finite(quantities),
        "limits": _to_finite({name: limit for name, limit in sample.limits.items() if name not in SHOWN}),
        "reasons": sample.reasons,
        "samples": thin_ride(sample.trajectory),
    }


def digest_ride(trajectory: Trajectory) -> str:
    """Return the SHA-256 of what an engine rode: samples, steps and end, but neither version, settings nor clock.

    The settings say what the model leaves out or replaces in a release, which need not change a bit of the ride. Nor
    need what the solver leaves, which is not known in every release.
    """
    ridden = replace(trajectory, version="", settings={}, cpu_time=0.0, unconverged_steps=None, largest_residual=None)
    return digest(trajectory_table(ridden)).decode()


def thin_ride(trajectory: Trajectory) -> dict[str, Any]:
    """Return at most some forty samples of a ride, its first and last among them, as JSON values."""
    count = len(trajectory.time)
    chosen = np.unique(np.linspace(0, count - 1, min(count, _MOST_SAMPLES)).round().astype(int))
    return {"time": trajectory.time[chosen].tolist(), "q": trajectory.q[chosen].tolist()}


def reason_of_failure(error: Exception) -> str:
    """Return one line, of limited length, that says why there is no ride."""
    own_words = isinstance(error, ScenarioError | UnsuitableProblem | WrongRelease)
    text = str(error) if own_words else why_failed(error)
    return " ".join(text.encode(errors="replace").decode().split())[:_LONGEST_REASON]


def _is_of_surroundings(error: BaseException, own: list[Path]) -> bool:
    """Whether a failure may be one of the machine or of the suite's environment, and not of the release."""
    tops = {top for folder in own if folder.is_dir() for top in list_top_modules(folder)}
    found: BaseException | None = error
    while found is not None:
        if isinstance(found, OSError | MemoryError | WrongRelease):
            return True
        # A module of its own is missing in the release, of others in the environment.
        if isinstance(found, ImportError) and (found.name or "").partition(".")[0] not in tops:
            return True
        found = found.__cause__ or found.__context__
    return False


def _to_finite(values: Mapping[str, float | None]) -> dict[str, float | None]:
    plain = {name: None if value is None else float(value) for name, value in values.items()}
    return {name: value if value is None or math.isfinite(value) else None for name, value in plain.items()}


if __name__ == "__main__":
    main()
