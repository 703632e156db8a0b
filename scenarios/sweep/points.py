"""The runs of a sweep by number: rows of its list, times a Latin hypercube, times a grid, times its engines."""

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import prod
from typing import Any

from ...engines.engine import REFERENCE
from .file import SweepFile
from .hypercube import draw_sample


def find_engine(key: str) -> str | None:
    """Return the engine to which the setting of a dotted key belongs; None if the key is no engine's setting."""
    table, _, rest = key.partition(".")
    return rest.partition(".")[0] if table == "engines" else None


def concerns_all(key: str) -> bool:
    """Return whether a key concerns all engines: no engine's setting, or one of the reference they are held against."""
    return find_engine(key) in (None, REFERENCE)


@dataclass(frozen=True)
class _Group:
    """Rows of the list that differ in settings of single engines only.

    Attributes
    ----------
    shared : dict
        Changes that concern all engines.
    own : dict
        By engine, its own changes in each of these rows.
    """

    shared: dict[str, Any]
    own: dict[str, list[dict[str, Any]]]


class Points:
    """All runs of a sweep: engines with their changes, found from their index by arithmetic.

    What concerns all engines changes slowest, so that the runs of all engines at one point are neighbours; the last
    key of the grid changes fastest. Settings of one engine do not multiply the runs of another, and equal values and
    equal rows of the list count once.

    Parameters
    ----------
    sweep : SweepFile
        With the names of its engines, no patterns.
    base : mapping
        The base scenario as resolved; rows of the list may repeat its values.
    """

    def __init__(self, sweep: SweepFile, base: Mapping[str, Any]) -> None:
        self._engines, self._cube = sweep.engines, sweep.latin_hypercube
        self._grid = {key: _drop_equal(values) for key, values in sweep.grid.items()}
        self._groups = _group_rows(sweep, base)
        drawn = () if self._cube is None else self._cube.ranges
        samples = 1 if self._cube is None else self._cube.count
        self._shared_cube = any(map(concerns_all, drawn))
        shared = [len(values) for key, values in self._grid.items() if concerns_all(key)]
        points = prod(shared) * (samples if self._shared_cube else 1)
        self._samples: dict[str, int] = {}  # by engine, samples that concern it alone
        self._starts: list[list[int]] = []  # by group and engine, where its runs begin among those of a point
        for engine in self._engines:
            own = not self._shared_cube and any(find_engine(key) == engine for key in drawn)
            self._samples[engine] = samples if own else 1
        for group in self._groups:
            sizes = [len(group.own[engine]) * self._count_own(engine) for engine in self._engines]
            self._starts.append([0, *accumulate(sizes)])
        self._ends = list(accumulate(points * starts[-1] for starts in self._starts))

    def __len__(self) -> int:
        return self._ends[-1]

    def _count_own(self, engine: str) -> int:
        """Return the number of combinations of an engine's own settings, without those of the list."""
        return self._samples[engine] * prod(
            len(values) for key, values in self._grid.items() if find_engine(key) == engine and engine != REFERENCE
        )

    def at(self, index: int) -> tuple[str, dict[str, Any]]:
        """Return an engine and its changes by dotted key.

        Parameters
        ----------
        index : int
            From 0 up to ``len``, exclusive.
        """
        g, engine, point, own = self._locate(index)
        group = self._groups[g]
        values: dict[str, Any] = {}
        for key in reversed(self._grid):
            choices = self._grid[key]
            if concerns_all(key):
                point, k = divmod(point, len(choices))
                values[key] = choices[k]
            elif find_engine(key) == engine:
                own, k = divmod(own, len(choices))
                values[key] = choices[k]
        row, sample = divmod(own, self._samples[engine])
        if self._shared_cube:
            sample = point
        drawn = {} if self._cube is None else draw_sample(self._cube, sample)
        return engine, self._join(engine, {**group.shared, **group.own[engine][row]}, drawn, values)

    def engine_at(self, index: int) -> str:
        """Return the engine of a run."""
        return self._locate(index)[1]

    def first_at_point(self, index: int) -> int:
        """Return the first of the runs that differ from a run in the engine and its own settings only."""
        g = bisect_right(self._ends, index)
        first = self._ends[g - 1] if g else 0
        return index - (index - first) % self._starts[g][-1]

    def _locate(self, index: int) -> tuple[int, str, int, int]:
        """Return the group of a run, its engine, its point in the group, and its number among the engine's there."""
        g = bisect_right(self._ends, index)
        starts = self._starts[g]
        point, own = divmod(index - (self._ends[g - 1] if g else 0), starts[-1])
        e = bisect_right(starts, own) - 1
        return g, self._engines[e], point, own - starts[e]

    def _join(
        self, engine: str, row: Mapping[str, Any], drawn: Mapping[str, Any], values: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Return changes in the order of the file, without settings of other engines."""
        found = {**row, **drawn, **{key: values[key] for key in self._grid if key in values}}
        return {key: value for key, value in found.items() if concerns_all(key) or find_engine(key) == engine}

    def vary_each(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield engines with changes that contain every row of the list and every value of the grid at least once.

        Their number grows with the length of the file and not with that of the sweep. In the place of a drawn point is
        the middle of its cube, and once its lower and its upper corner.
        """
        ranges = {} if self._cube is None else self._cube.ranges
        middle = {key: low + (high - low) / 2 for key, (low, high) in ranges.items()}
        corners = [{key: limits[side] for key, limits in ranges.items()} for side in (0, 1)] if ranges else []
        first = {key: values[0] for key, values in self._grid.items()}
        for engine in self._engines:
            rows = [{**group.shared, **row} for group in self._groups for row in group.own[engine]]
            for row in rows:
                yield engine, self._join(engine, row, middle, first)
            for corner in corners:
                yield engine, self._join(engine, rows[0], corner, first)
            for key, values in self._grid.items():
                if concerns_all(key) or find_engine(key) == engine:
                    for value in values[1:]:
                        yield engine, self._join(engine, rows[0], middle, first | {key: value})

    def value_types(self) -> dict[str, set[type]]:
        """Return all keys that runs change, in the order of the file, with the types of their values."""
        found: dict[str, set[type]] = {}
        for group in self._groups:
            for row in (group.shared, *(row for engine in self._engines for row in group.own[engine])):
                for key, value in row.items():
                    found.setdefault(key, set()).add(type(value))
        for key in () if self._cube is None else self._cube.ranges:
            found[key] = {float}
        for key, values in self._grid.items():
            found[key] = {type(value) for value in values}
        return found

    def describe(self) -> list[Any]:
        """Return JSON values that are the same for equal runs in equal order."""
        rows = [[group.shared, *(group.own[engine] for engine in self._engines)] for group in self._groups]
        cube = None if self._cube is None else self._cube.model_dump(mode="json")
        # Lists, since the order of keys matters.
        return [list(self._engines), rows, cube and [cube, list(cube["ranges"])], list(self._grid.items())]


def _group_rows(sweep: SweepFile, base: Mapping[str, Any]) -> list[_Group]:
    groups: dict[str, tuple[dict[str, Any], dict[str, dict[str, dict[str, Any]]]]] = {}
    for row in sweep.list or ({},):
        shared = {key: value for key, value in row.items() if concerns_all(key)}
        _, rows = groups.setdefault(_text_of_changes(shared, base), (shared, {name: {} for name in sweep.engines}))
        for engine in sweep.engines:
            own = {key: value for key, value in row.items() if key not in shared and find_engine(key) == engine}
            rows[engine].setdefault(_text_of_changes(own, base), own)
    return [
        _Group(shared, {engine: list(found.values()) for engine, found in rows.items()})
        for shared, rows in groups.values()
    ]


def _text_of_changes(changes: Mapping[str, Any], base: Mapping[str, Any]) -> str:
    """Return a text that is the same for changes that lead to the same scenario."""
    texts = {key: _text_of_value(value) for key, value in changes.items()}
    return json.dumps(
        {key: text for key, text in texts.items() if text != _text_of_value(_look_up(base, key))}, sort_keys=True
    )


def _look_up(data: Any, key: str) -> Any:
    for part in key.split("."):
        data = data.get(part) if isinstance(data, Mapping) else None
    return data


def _drop_equal(values: Sequence[Any]) -> list[Any]:
    found: dict[str, Any] = {}
    for value in values:
        found.setdefault(_text_of_value(value), value)
    return list(found.values())


def _text_of_value(value: Any) -> str:
    """Return a text that is the same for equal values: 5 and 5.0, but not 1 and true."""
    return json.dumps(_unify_numbers(value), sort_keys=True, default=repr)


def _unify_numbers(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _unify_numbers(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_unify_numbers(part) for part in value]
    exact = isinstance(value, int) and not isinstance(value, bool) and abs(value) <= 2**53
    return float(value) if exact else value
