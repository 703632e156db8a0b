"""Trajectories of long rides with their arrays in temporary files, which are mapped into memory.

The arrays are ordinary ones to whoever reads or writes them. Their memory is the system's cache of the file: the system
takes it back where memory is short, and `release_pages` gives it back at once.
"""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .engine import SHAPES, Trajectory

LONG_RIDE = 1 << 16  # samples from which on a ride is moved to disk: 35 MB of the widest trajectory's numbers
BLOCK = 1 << 14  # samples that are written or computed at once


def is_long(trajectory: Trajectory) -> bool:
    """Return whether a trajectory has so many samples that its arrays are better kept in a file."""
    return len(trajectory.time) >= LONG_RIDE


def slice_blocks(samples: int) -> Iterator[slice]:
    """Yield the consecutive slices of `BLOCK` samples; their bounds depend on nothing else."""
    for begin in range(0, samples, BLOCK):
        yield slice(begin, min(begin + BLOCK, samples))


def move_to_disk(trajectory: Trajectory, folder: Path) -> Trajectory:
    """Return a copy of a trajectory whose arrays lie in a temporary file.

    Parameters
    ----------
    trajectory : Trajectory
        With one sample or more.
    folder : Path
        Folder in which the file is made. It has no name there, or is removed with the last of the arrays.

    Returns
    -------
    Trajectory
        Its arrays are contiguous arrays of float64, which share no memory with those given.

    Raises
    ------
    OSError
        If the file cannot be written, for example where the disk is full.
    """
    given = {name: value for name in SHAPES if (value := getattr(trajectory, name)) is not None}
    samples = len(trajectory.time)
    blocks = ({name: value[rows] for name, value in given.items()} for rows in slice_blocks(samples))
    return replace(trajectory, **write_disk_arrays(blocks, samples, folder))


def write_disk_arrays(blocks: Iterable[Mapping[str, np.ndarray]], samples: int, folder: Path) -> dict[str, Any]:
    """Write arrays that are given in consecutive blocks to a temporary file, and map it into memory.

    Parameters
    ----------
    blocks : iterable of mapping
        Arrays (k, ...) by name: k samples each, of the same names and shapes in all blocks, ``samples`` in all.
    samples : int
    folder : Path
        As `move_to_disk` takes it.

    Returns
    -------
    dict of str to ndarray
        The whole arrays (samples, ...), of float64.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    item, place = np.dtype(float).itemsize, 0
    shapes: dict[str, tuple[int, ...]] = {}
    begins: dict[str, int] = {}
    with tempfile.TemporaryFile(prefix=".long-ride-", dir=folder) as file:
        done = 0
        for block in blocks:
            if not shapes:
                shapes = {name: value.shape[1:] for name, value in block.items()}
                for name, shape in shapes.items():
                    begins[name], place = place, place + samples * _count(shape)
            for name, value in block.items():
                file.seek((begins[name] + done * _count(shapes[name])) * item)
                file.write(np.ascontiguousarray(value, float).data)
            done += len(next(iter(block.values())))
        file.flush()
        mapped = np.memmap(file, dtype=float, mode="r+", shape=(place,))
    numbers = np.asarray(mapped)
    return {
        name: numbers[begins[name] : begins[name] + samples * _count(shape)].reshape(samples, *shape)
        for name, shape in shapes.items()
    }


def _count(shape: tuple[int, ...]) -> int:
    return int(np.prod(shape, dtype=int))


def release_pages(*trajectories: Trajectory) -> None:
    """Give back the memory of trajectories in temporary files; where they are read again, it is filled from the files.

    No number changes. Arrays in memory stay as they are, and so do all on systems that take no such advice; these take
    the memory back where it is short.
    """
    maps = (_find_map(getattr(trajectory, name)) for trajectory in trajectories for name in SHAPES)
    for one in {id(one): one for one in maps if one is not None}.values():
        if hasattr(mmap, "MADV_DONTNEED"):
            one.madvise(mmap.MADV_DONTNEED)


def _find_map(values: object) -> mmap.mmap | None:
    """Return the map of a file that an array's memory belongs to, if any."""
    while isinstance(values, np.ndarray):
        values = values.base
    return values if isinstance(values, mmap.mmap) else None
