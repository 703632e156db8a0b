"""An engine with one thing changed: what it is given, what it gives, or how it breaks."""

from __future__ import annotations

import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from engines.engine import Engine, Problem, Progress, Settings, Trajectory


@dataclass(frozen=True)
class Altered:
    """Another engine behind two functions.

    Attributes
    ----------
    inner : Engine
    before : callable, optional
        Applied to the problem.
    after : callable, optional
        Applied to the trajectory; it may raise.
    """

    inner: Engine
    before: Callable[[Problem], Problem] = lambda problem: problem
    after: Callable[[Trajectory], Trajectory] = lambda trajectory: trajectory

    @property
    def name(self) -> str:
        return self.inner.name

    @property
    def version(self) -> str:
        return self.inner.version

    @property
    def gives(self) -> tuple[str, ...]:
        return self.inner.gives

    @property
    def settings(self) -> type[Settings]:
        return self.inner.settings

    def check(self, problem: Problem, settings: Any) -> None:
        self.inner.check(problem, settings)

    def step_noise(self, settings: Any) -> float:
        return self.inner.step_noise(settings)

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        return self.after(self.inner.simulate(self.before(problem), settings, progress))


# Where `raising` raises, as it is named.
RAISED_AT = f"altered.py:{Path(__file__).read_text().splitlines().index('        raise error') + 1}"


def raising(error: BaseException) -> Callable[[Trajectory], Trajectory]:
    """An `after` that breaks the engine when its work is nearly done."""

    def fail(_: Trajectory) -> Trajectory:
        raise error

    return fail


def pressing_ctrl_c(trajectory: Trajectory) -> Trajectory:
    """An `after` during which the user presses Ctrl-C."""
    signal.raise_signal(signal.SIGINT)
    return trajectory
