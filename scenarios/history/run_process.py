"""The process that runs a scenario with one release: ``python -m velodrome.scenarios.history.run_process``.

Standard input: the `RunSetup` as one line of JSON. Standard output: lines of JSON, each a message about the run and the
last one its outcome, or why there is none. The process lays the release's environment over its own; an engine whose
ride loaded anything of the release's packages from elsewhere has failed.
"""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from traceback import format_exception
from typing import Any

from ...engines.engine import REFERENCE
from ..error import ScenarioError
from ..run import RunOutcome, plan_run, run_plan
from ..scenario import EngineChoice, validate_scenario
from .overlay import WrongRelease, lay_over, require_loaded_from, require_release
from .protocol import die_with, reserve_streams, send_message

_PROGRESS = 0.1  # [s] between two messages on how far a ride is


@dataclass(frozen=True)
class RunSetup:
    """What the process runs.

    Attributes
    ----------
    parent : int
        Process with which it ends.
    folder : str
        The release's environment.
    version : str
        Of the release.
    release : dict
        Facts about it for the manifest, its ``package`` among them.
    name : str
        Of the scenario.
    scenario : dict
        The scenario as JSON values.
    engines, named : list of str
        Engines of the package, and those of them that the user named.
    out : str
        Folder in which the run folder is made.
    recording : bool
        Whether to write the recording.
    record_rate : float or None
        Its largest number of samples a second [Hz]; None thins long rides.
    """

    parent: int
    folder: str
    version: str
    release: dict[str, Any]
    name: str
    scenario: dict[str, Any]
    engines: list[str]
    named: list[str]
    out: str
    recording: bool
    record_rate: float | None

    def line(self) -> str:
        """Return the setup as one line of JSON."""
        return json.dumps(asdict(self))


def main() -> None:
    """Run what standard input says."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background inherits that it is ignored
    lines, results = reserve_streams()

    def tell(**message: Any) -> None:
        send_message(results, message)

    try:
        setup = RunSetup(**json.loads(lines.readline()))
        die_with(setup.parent)
        outcome = _run(setup, tell)
        tell(outcome=asdict(outcome) | {"folder": str(outcome.folder)})
    except (ScenarioError, WrongRelease) as error:
        tell(refused=" ".join(str(error).split()), trace=_format_cause(error))
    except KeyboardInterrupt:
        tell(interrupted=True)


def _run(setup: RunSetup, tell: Callable[..., None]) -> RunOutcome:
    folder = Path(setup.folder)
    own = lay_over(folder)
    require_release(folder, setup.release["package"], setup.version)
    scenario = validate_scenario(setup.scenario, setup.name)
    choice = EngineChoice((REFERENCE, *setup.engines), frozenset(setup.named))
    plan = plan_run(setup.name, scenario, choice, setup.release)
    if [*plan.engines] == [REFERENCE]:
        raise ScenarioError("; ".join(dict.fromkeys(plan.left_out.values())))
    told = -_PROGRESS

    def watch(name: str, done: float, total: float, unit: str = "s", /) -> None:
        nonlocal told
        if time.monotonic() - told >= _PROGRESS or done >= total:
            told = time.monotonic()
            tell(progress=[name, float(done), float(total), unit])

    def accept(name: str) -> None:
        if name != REFERENCE:
            require_loaded_from(own)

    return run_plan(
        plan,
        Path(setup.out),
        watch,
        note=lambda line: tell(note=line),
        trace=lambda name, error: tell(trace=f"{name}:\n{''.join(format_exception(error))}"),
        accept=accept,
        recording=setup.recording,
        record_rate=setup.record_rate,
    )


def _format_cause(error: Exception) -> str | None:
    return None if error.__cause__ is None else "".join(format_exception(error.__cause__))


if __name__ == "__main__":
    main()
