"""Baselines that stand in no file, such as those of one release of an engine's package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class GivenBaselines:
    """Baselines of one call of the gate.

    Attributes
    ----------
    package, release : str
        The package, and the name of what was ridden.
    engines : tuple of str
        The engines to judge.
    entries : dict
        By scenario and engine, as a file of baselines has them, with the ``release``.
    reasons : dict
        By scenario and engine: why there is no entry.
    """

    package: str
    release: str
    engines: tuple[str, ...]
    entries: Mapping[str, Mapping[str, Mapping[str, Any]]]
    reasons: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
