"""Groups of problems that can be ridden in one call of compiled code."""

from __future__ import annotations

from collections.abc import Sequence

from .engine import Problem


def group_by_times(problems: Sequence[Problem]) -> list[list[int]]:
    """Return the indices of problems in groups with the same output times."""
    groups: dict[bytes, list[int]] = {}
    for i, problem in enumerate(problems):
        groups.setdefault(problem.times.tobytes(), []).append(i)
    return list(groups.values())
