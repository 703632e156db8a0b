"""The rides of a history: their starts, computed once, and the digests that identify them."""

from __future__ import annotations

import hashlib
import json
import pickle
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from ...engines.registry import packages
from ..files import digest_named_files
from ..gate import Exact, find_exact, gate_settings, gated_content, load_gated
from ..run import library_versions
from ..scenario import Gate, Start, make_start

_LIBRARIES = ("velodrome", "numpy", "scipy", "numba")  # what the reference and the measurement compute with


@dataclass(frozen=True)
class MeasuredRide:
    """A scenario as every release rides it.

    Attributes
    ----------
    scenario : str
    source : str
        Its library name or the path of its file, as the user named it.
    title : str
    gate : Gate
        What is measured.
    start : Start
    exact : Exact
        The ride against which the releases are measured.
    settings : dict
        Settings by engine, as the scenario and the gate give them.
    digest : str
        SHA-256 of all that determines the ride, without the engine.
    """

    scenario: str
    source: str
    title: str
    gate: Gate
    start: Start
    exact: Exact
    settings: dict[str, dict[str, Any]]
    digest: str

    def settings_of(self, engine: str) -> dict[str, Any]:
        """Return the settings of an engine that are not its defaults."""
        return self.settings.get(engine, {})

    def identify_for(self, engine: str) -> str:
        """Return the SHA-256 of all that determines the ride in an engine, without its version."""
        return digest_json([self.digest, self.settings_of(engine)])


def prepare_ride(source: str) -> MeasuredRide:
    """Load a scenario with the duration and output rate of the gate, and compute its start and its exact ride.

    Raises
    ------
    ScenarioError
        If the scenario is invalid, its motion does not exist, or the reference does not ride to the end.
    """
    name, scenario = load_gated(source)
    start = make_start(scenario)
    gate = scenario.gate or Gate()
    settings = {
        engine: gate_settings().get(engine, {}) | scenario.engines.get(engine, {})
        for engine in {*gate_settings(), *scenario.engines}
    }
    determined = {
        "content": gated_content(scenario),
        "gate": gate.model_dump(mode="json"),
        "q": start.problem.q.tolist(),
        "qd": start.problem.qd.tolist(),
        "times": start.problem.times.tolist(),
    }
    return MeasuredRide(name, source, scenario.title, gate, start, find_exact(start), settings, digest_json(determined))


@dataclass(frozen=True)
class RideFile:
    """The file of the rides of a session, and its SHA-256."""

    path: Path
    digest: str


@contextmanager
def store_rides(rides: Mapping[str, MeasuredRide]) -> Iterator[RideFile]:
    """Yield a file with rides for the processes of this session, in a folder that nobody else can write."""
    data = pickle.dumps(dict(rides))
    with tempfile.TemporaryDirectory(prefix="velodrome-rides-") as own:
        path = Path(own) / "rides.pickle"
        path.write_bytes(data)
        yield RideFile(path, hashlib.sha256(data).hexdigest())


def read_rides(path: Path, digest: str) -> dict[str, MeasuredRide]:
    """Read what `store_rides` has written in the same session.

    Raises
    ------
    ValueError
        If the file is another one.
    """
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() != digest:
        raise ValueError(f"{path} is not the file of rides that was written")
    return pickle.loads(data)


def digest_json(values: Any) -> str:
    """Return the SHA-256 of JSON values, the same for equal values."""
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def describe_comparison(package: str) -> dict[str, str]:
    """Return what results depend on beside a release and its ride: versions, and the digest of the suite's code."""
    found = library_versions()
    names = [name for name in (*_LIBRARIES, *packages()) if name in found and name != package]
    return {name: found[name] for name in sorted(names)} | {"suite_sha256": digest_suite()}


@cache
def digest_suite() -> str:
    """Return the SHA-256 of the suite's code, since a change of it may change a ride.

    All of its code counts, also what only shows results: no list of exceptions has to be kept true, and a ride too many
    costs time only. Texts and styles of pages are no code.
    """
    return digest_named_files(_list_code())


def _list_code() -> Iterator[tuple[str, Path]]:
    """Yield the files of the suite's code with their names."""
    root = Path(__file__).parents[2]
    # In an editable install the floors are links, which rglob does not follow below a folder.
    for floor in ("reference", "engines", "reports", "scenarios"):
        folder = (root / floor).resolve()
        for path in sorted(path for path in folder.rglob("*") if path.suffix in (".py", ".toml") and path.is_file()):
            yield f"{floor}/{path.relative_to(folder)}", path
