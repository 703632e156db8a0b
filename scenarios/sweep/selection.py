"""Some of a sweep's tasks, kept as ranges of their indices."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .plan import LazyTasks, Task, TaskSequence


class SelectedTasks(LazyTasks):
    """Some tasks of a sweep; memory grows with the number of gaps, not of tasks.

    Parameters
    ----------
    tasks : TaskSequence
    chosen : ndarray of bool, shape (n,)
        Which of the tasks.

    Attributes
    ----------
    sweep : TaskSequence
        All tasks of the sweep.
    """

    def __init__(self, tasks: TaskSequence, chosen: np.ndarray) -> None:
        self.sweep = tasks
        edges = np.flatnonzero(np.diff(chosen, prepend=False, append=False))
        self._starts = edges[::2]
        self._ends = np.cumsum(edges[1::2] - edges[::2])  # of each range, among the chosen tasks

    def __len__(self) -> int:
        return int(self._ends[-1]) if len(self._ends) else 0

    def make_task(self, place: int) -> Task:
        """Make the task at a place among those chosen."""
        k = int(np.searchsorted(self._ends, place, side="right"))
        before = int(self._ends[k - 1]) if k else 0
        return self.sweep[int(self._starts[k]) + place - before]

    def ranges(self) -> Iterator[range]:
        """Yield the indices of the chosen tasks in the sweep, as ranges between gaps."""
        before = 0
        for start, end in zip(self._starts, self._ends, strict=True):
            yield range(int(start), int(start + end - before))
            before = end
