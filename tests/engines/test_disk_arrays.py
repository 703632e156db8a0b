"""Rides in temporary files: the same numbers, no file left, and no memory once it is released."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from velodrome.engines import disk_arrays
from velodrome.engines.disk_arrays import move_to_disk, release_pages, slice_blocks, write_disk_arrays
from velodrome.engines.engine import SHAPES, Trajectory

SAMPLES = 2 * disk_arrays.BLOCK + 7


@pytest.fixture(scope="module")
def ride() -> Trajectory:
    random = np.random.default_rng(7)
    arrays: dict[str, Any] = {name: random.standard_normal((SAMPLES, *shape)) for name, shape in SHAPES.items()}
    arrays["slip"] = None
    return Trajectory(engine="own", version="1", settings={}, steps=3, cpu_time=1.0, **arrays)


def test_a_ride_on_disk_has_the_same_numbers(ride: Trajectory, tmp_path: Path) -> None:
    moved = move_to_disk(ride, tmp_path)
    for name in SHAPES:
        given, found = getattr(ride, name), getattr(moved, name)
        if given is None:
            assert found is None
            continue
        assert type(found) is np.ndarray
        assert found.flags.c_contiguous
        assert found.dtype == float
        assert np.array_equal(found, given), name
        assert not np.shares_memory(found, given), name
    assert (moved.engine, moved.steps, moved.cpu_time) == ("own", 3, 1.0)


@pytest.mark.skipif(sys.platform == "win32", reason="a file in use has a name there")
def test_no_file_is_left_in_the_folder(ride: Trajectory, tmp_path: Path) -> None:
    moved = move_to_disk(ride, tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert moved.q[-1, 0] == ride.q[-1, 0]


def test_arrays_of_any_layout_are_moved(ride: Trajectory, tmp_path: Path) -> None:
    """An engine may give views of wider arrays, in any order of the memory, of single precision."""
    wide = np.zeros((SAMPLES, 20))
    wide[:, 3:12] = ride.q
    single = np.asarray(ride.gap, np.float32)
    turned = replace(ride, q=wide[:, 3:12], qd=np.asfortranarray(ride.qd), gap=single)
    moved = move_to_disk(turned, tmp_path)
    assert np.array_equal(moved.q, ride.q)
    assert np.array_equal(moved.qd, ride.qd)
    assert moved.gap is not None
    assert np.array_equal(moved.gap, single.astype(float))


def test_numbers_written_to_an_array_stay(ride: Trajectory, tmp_path: Path) -> None:
    moved = move_to_disk(ride, tmp_path)
    moved.q[0] = 5.0
    release_pages(moved)
    assert (moved.q[0] == 5.0).all()
    assert np.array_equal(moved.q[1:], ride.q[1:])
    assert np.array_equal(moved.qd, ride.qd)


def test_blocks_cover_all_samples_once() -> None:
    for samples in (1, disk_arrays.BLOCK, disk_arrays.BLOCK + 1, SAMPLES):
        found = np.concatenate([np.arange(samples)[rows] for rows in slice_blocks(samples)])
        assert np.array_equal(found, np.arange(samples))


def test_a_ride_whose_file_cannot_be_made_is_refused(ride: Trajectory, tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file"):
        move_to_disk(ride, tmp_path / "absent")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_released_pages_take_no_memory(tmp_path: Path) -> None:
    samples = 1 << 19  # 4 MiB a column
    columns = np.arange(9.0)
    blocks = ({"q": (np.arange(samples)[rows, None] + columns)} for rows in slice_blocks(samples))
    arrays = write_disk_arrays(blocks, samples, tmp_path)
    ride = Trajectory(
        **{**{name: np.zeros((1, *shape)) for name, shape in SHAPES.items()}, "q": arrays["q"]},
        **{"engine": "own", "version": "1", "settings": {}, "steps": 1, "cpu_time": 0.0},
    )
    total, taken = arrays["q"].sum(), _mapped_bytes()
    release_pages(ride)
    # All of it but the pages at its ends, which it may share with its neighbours.
    assert taken - _mapped_bytes() > arrays["q"].nbytes - (1 << 20)
    assert arrays["q"].sum() == total


def _mapped_bytes() -> int:
    """Return the memory of this process that is of files."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("RssFile")) * 1024
