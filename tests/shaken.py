"""Shake linear algebra by round-off: a pytest plugin, ``-p tests.shaken --shaken SEED``.

Another machine's LAPACK rounds otherwise. What it would give is had by changing each entry of the matrices whose
eigenvalues are asked for, and of the results of decompositions and solves, by some units in the last place; so are the
motions that the compiled Newton's method finds, whose bits depend on the compiler. The same matrix is always changed
alike, as one machine would do it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from zlib import crc32

import numpy as np
import pytest

from velodrome.reference.kernels import newton

_ULPS = 4 * np.finfo(float).eps


def shake(seed: int, replace: Callable[[Any, str, Any], None] = setattr) -> None:
    """Let numpy's linear algebra round otherwise.

    Parameters
    ----------
    seed : int
        Of the changes.
    replace : callable
        Sets an attribute, as `setattr` or a monkeypatch does.
    """

    def moved(array: np.ndarray, key: int) -> np.ndarray:
        return array * (1 + _ULPS * np.random.default_rng([seed, key]).uniform(-1, 1, np.shape(array)))

    def key_of(matrix: Any) -> int:
        return crc32(np.ascontiguousarray(matrix).tobytes())

    def with_moved_input(function: Callable) -> Callable:
        def moved_each(matrices: Any) -> np.ndarray:
            # A stack is changed as its matrices would be alone.
            stack = np.asarray(matrices)
            flat = [moved(one, key_of(one)) for one in stack.reshape(-1, *stack.shape[-2:])]
            return np.reshape(flat, stack.shape)

        return lambda matrices: function(moved_each(matrices))

    def with_moved_result(function: Callable) -> Callable:
        def moved_result(matrix: Any, *rest: Any, **options: Any) -> Any:
            found, key = function(matrix, *rest, **options), key_of(matrix)
            if isinstance(found, np.ndarray):
                return moved(found, key)
            parts = [moved(part, key + k) if np.ndim(part) else part for k, part in enumerate(found)]
            return type(found)(*parts) if hasattr(found, "_fields") else tuple(parts)

        return moved_result

    for name in ("eig", "eigvals"):
        replace(np.linalg, name, with_moved_input(getattr(np.linalg, name)))
    for name in ("svd", "lstsq", "solve", "inv"):
        replace(np.linalg, name, with_moved_result(getattr(np.linalg, name)))
    solve = newton.solve_motion

    def solve_moved(*arguments: Any) -> Any:
        outcome, unknowns = solve(*arguments), arguments[-1]
        unknowns[:] = moved(unknowns, key_of(unknowns))
        return outcome

    replace(newton, "solve_motion", solve_moved)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--shaken", type=int, metavar="SEED", help="let numpy's linear algebra round otherwise")


def pytest_configure(config: pytest.Config) -> None:
    seed = config.getoption("--shaken")
    if seed is not None:
        shake(seed)


def pytest_report_header(config: pytest.Config) -> str | None:
    seed = config.getoption("--shaken")
    return None if seed is None else f"linear algebra is shaken, seed {seed}"
