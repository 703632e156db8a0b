"""Documents of commands, small and stored, so that a test of what is printed computes nothing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

from rich.console import Console

from velodrome.scenarios.commands.present_run import show_outcome
from velodrome.scenarios.run import RunOutcome
from velodrome.scenarios.scenario import Scenario

HERE = Path(__file__).parent


def stored(name: str) -> Any:
    return json.loads((HERE / "stored" / f"{name}.json").read_text(encoding="utf-8"))


def show_stored_run(console: Console, run: Mapping[str, Any]) -> None:
    """Print what `velodrome run` prints of metrics, verdicts and failures."""
    scenario = SimpleNamespace(title=run["title"], simulation=SimpleNamespace(duration=run["duration"]))
    outcome = SimpleNamespace(
        metrics=run["metrics"],
        verdicts=run["verdicts"],
        failures=run["failures"],
        left_out=run["left_out"],
        folder=Path("runs/q2-plus-20260102T030405"),
        interrupted=False,
        release=None,
    )
    show_outcome(console, run["name"], cast(Scenario, scenario), cast(RunOutcome, outcome))
