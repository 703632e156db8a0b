"""Import JAX and MJX without a trace in the process."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO

import numpy as np


@contextmanager
def process_kept() -> Iterator[None]:
    """Undo what imports inside the block do to the process.

    JAX sets environment variables for TPUs and for its own log, and draws from numpy's random numbers. MJX prints where
    its optional back end for NVIDIA GPUs is not installed.
    """
    variables, numbers = dict(os.environ), np.random.get_state()  # noqa: NPY002
    try:
        with redirect_stdout(StringIO()):
            yield
    finally:
        for name in os.environ.keys() - variables.keys():
            del os.environ[name]
        os.environ.update(variables)
        np.random.set_state(numbers)  # noqa: NPY002
