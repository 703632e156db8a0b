"""A sweep's tasks in batches that take about a second each, for workers that are far away.

A batch is a few ranges of indices, whatever its number of tasks, and is made when a worker has room for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from .points import Points
from .pool import GROUP
from .selection import SelectedTasks

_FIRST = 4  # tasks in the first batches
_GROWTH = 4  # by which a batch may be larger than those that are done: the first ones may have been easy
_LARGEST = 4096  # tasks in a batch, whose rows are a megabyte
_SPAN = 1.0  # [s] that a batch should take; what it costs beside its tasks is some milliseconds
_SHORTEST = 0.1  # [s] that the last ones should take, which are smaller, so that no worker waits long for another one
# Batches a second: each costs the client and the scheduler up to 2 ms together, so that they are idle half of the time.
_RATE = 250.0

Ranges = list[range]


class Batches:
    """Batches of a sweep's tasks, each of neighbours, which share a start.

    A batch whose worker was lost again and again is done task by task, and a task that is lost so once more is done
    while nothing else is: it is given up only if that loses its worker as well.

    Parameters
    ----------
    tasks : SelectedTasks
    """

    def __init__(self, tasks: SelectedTasks) -> None:
        self._points: Points = tasks.sweep.points
        self._waiting = len(tasks)
        self._source = tasks.ranges()
        self._heads: deque[range] = deque()  # come before those of the source
        self._singles: deque[range] = deque()
        self._suspects: deque[int] = deque()
        self._on_trial: int | None = None
        self._task_time: float | None = None  # [s] a task on a worker, of late
        self._largest_done = 0

    def next(self, threads: int, idle: bool) -> Ranges:
        """Return the next batch; empty if there is none now.

        Parameters
        ----------
        threads : int
            Of the workers.
        idle : bool
            Whether no batch is at work.
        """
        if self._waiting:
            return self._cut(self._choose_size(threads))
        if self._singles:
            return [self._take_single()]
        if self._suspects and idle:
            self._on_trial = self._suspects.popleft()
            return [range(self._on_trial, self._on_trial + 1)]
        return []

    def learn(self, count: int, seconds: float, threads: int) -> None:
        """Update the estimate of how long tasks take from a batch that is done."""
        if not count:
            return
        self._largest_done = max(self._largest_done, count)
        # A mean over the last batches, about one of each thread.
        weight = 1.0 if self._task_time is None else 1.0 / max(4, threads)
        self._task_time = (1.0 - weight) * (self._task_time or 0.0) + weight * seconds / count

    def return_undone(self, ranges: Sequence[range]) -> None:
        """Put back what a worker has left of a batch that took too long."""
        self._heads.extendleft(reversed(ranges))
        self._waiting += sum(map(len, ranges))

    def lose(self, batch: Ranges) -> int | None:
        """Return the index of a task to give up, if this batch's loss is its fault; otherwise queue the batch again."""
        if len(batch) > 1 or len(batch[0]) > 1:
            self._singles.extend(batch)
            return None
        (index,) = batch[0]
        if index == self._on_trial:
            return index
        self._suspects.append(index)
        return None

    def _take_single(self) -> range:
        head = self._singles.popleft()
        if len(head) > 1:
            self._singles.appendleft(head[1:])
        return head[:1]

    def _choose_size(self, threads: int) -> int:
        if self._task_time is None:
            return max(1, min(_FIRST, self._waiting // (2 * threads)))
        task_time = max(self._task_time, 1e-6)
        span = max(_SPAN, threads / _RATE)
        # The last batches: half of what is left for all threads, and so on.
        span = min(span, max(_SHORTEST, self._waiting * task_time / (2 * threads)))
        size = max(1, int(min(span / task_time, _GROWTH * self._largest_done, _LARGEST)))
        return size - size % GROUP if size > GROUP else size

    def _cut(self, size: int) -> Ranges:
        """Take the next tasks, up to a size; where a batch ends within a range, it ends with a point, if it has one."""
        batch: Ranges = []
        while size > 0 and self._waiting:
            head = self._heads.popleft() if self._heads else next(self._source)
            end = min(head.stop, head.start + size)
            if end < head.stop:
                whole = self._points.first_at_point(end)
                end = whole if whole > head.start else end
                self._heads.appendleft(range(end, head.stop))
                size = 0
            part = range(head.start, end)
            batch.append(part)
            self._waiting -= len(part)
            size -= len(part)
        return batch


def longest_batch(threads: int) -> float:
    """Return the time after which a worker should leave the rest of a batch to others [s]: twice of what is meant."""
    return 2.0 * max(_SPAN, threads / _RATE)


def list_undone(ranges: Sequence[range], done: set[int]) -> Ranges:
    """Return what remains of ranges, as ranges."""
    found: Ranges = []
    for part in ranges:
        for index in part:
            if index in done:
                continue
            if found and found[-1].stop == index:
                found[-1] = range(found[-1].start, index + 1)
            else:
                found.append(range(index, index + 1))
    return found
