"""What a complaint must be, whatever it is about."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from numba.core import event

from velodrome.scenarios.error import ScenarioError

PATIENCE = 5.0  # CPU time that an answer may take [s]
# Twenty complaints, each of a place, a value of 200 letters and some words, and the names of a bicycle's parameters.
LONGEST = 20 * 500


def is_one_line(text: str) -> bool:
    """Whether a terminal shows it as one line that moves no cursor."""
    return bool(text.strip()) and text.isprintable() and len(text) <= LONGEST


@contextmanager
def refusing() -> Iterator[list[str]]:
    """Take a `ScenarioError` as an answer, one line; any other exception, and a long wait, is a fault.

    Compiling kernels, once after installation, is not part of the wait.
    """
    said: list[str] = []
    compiling: list[float] = []
    start = time.process_time()
    with event.install_timer("numba:compile", compiling.append):
        try:
            yield said
        except ScenarioError as error:
            said.append(str(error))
            assert is_one_line(said[0]), said
    assert time.process_time() - start - sum(compiling) < PATIENCE
