"""Rows of a batch as they travel: the names of their values once, not once a row."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator

from .pool import Done


def pack_rows(rows: Iterable[Done]) -> bytes:
    """Pack finished tasks as JSON values without their names."""
    layouts: dict[tuple[tuple[str, ...], tuple[str, ...]], int] = {}  # rows have few different sets of names
    packed = []
    for done in rows:
        layout = layouts.setdefault((tuple(done.row), tuple(done.timing)), len(layouts))
        packed.append((done.index, layout, tuple(done.row.values()), tuple(done.timing.values())))
    return json.dumps((list(layouts), packed), separators=(",", ":"), allow_nan=False).encode()


def unpack_rows(data: bytes) -> Iterator[Done]:
    """Yield the tasks that `pack_rows` packed."""
    layouts, packed = json.loads(data)
    for index, layout, values, times in packed:
        names, clocks = layouts[layout]
        yield Done(index, dict(zip(names, values, strict=True)), dict(zip(clocks, times, strict=True)))
