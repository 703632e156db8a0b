"""An engine around another one, for tests that change a part of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from velodrome.engines.engine import Engine, Problem, Settings


@dataclass(frozen=True)
class WrappedEngine:
    """All of an engine but its rides.

    Attributes
    ----------
    inner : Engine
    """

    inner: Engine

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
