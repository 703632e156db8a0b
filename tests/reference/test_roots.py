"""Roots by Brent's method, against scipy, which does the same operations."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from scipy.optimize import brentq

from velodrome.reference.roots import find_root

FUNCTIONS: list[tuple[Callable[[float], float], float, float]] = [
    (lambda x: math.cos(x) - x, 0.0, 1.0),
    (lambda x: x**3 - 2 * x - 5, 2.0, 3.0),
    (lambda x: math.exp(x) - 1e6, -3.0, 40.0),
    (lambda x: x**3 + 1e-3 * x, -1.0, 1.5),  # almost a threefold root, which interpolation approaches slowly
    (lambda x: math.atan(1e8 * (x - 0.3)), -1.0, 1.0),  # almost a jump
    (lambda x: 1.0 if x > 1 / 3 else -1.0, 0.0, 1.0),
    (lambda x: (x - 1e-9) * 1e-300, -1.0, 1.0),  # values whose products underflow
    (lambda x: x, 0.0, 1.0),
    (lambda x: x - 1.0, 0.0, 1.0),
]


@pytest.mark.parametrize("tolerance", [2e-12, 1e-15, 1e-3])
@pytest.mark.parametrize("case", range(len(FUNCTIONS)))
def test_roots_and_evaluations_are_those_of_scipy(case: int, tolerance: float) -> None:
    """Bit for bit: results of stored families and gates hang on the last digits."""
    function, low, high = FUNCTIONS[case]
    asked: list[list[float]] = [[], []]

    def recorded(kept: list[float]) -> Callable[[float], float]:
        return lambda x: kept.append(x) or function(x)

    own = find_root(recorded(asked[0]), low, high, tolerance)
    assert own == brentq(recorded(asked[1]), low, high, xtol=tolerance)
    assert asked[0] == asked[1]


def test_what_has_no_root_is_refused() -> None:
    with pytest.raises(ValueError, match=r"same sign at 0\.0 and 1\.0"):
        find_root(lambda x: x + 1, 0.0, 1.0)
    with pytest.raises(ValueError, match=r"nan at 0\.5"):
        find_root(lambda x: math.nan if x == 0.5 else x - 0.5, 0.0, 1.0)
    with pytest.raises(RuntimeError, match="in 100 iterations"):
        find_root(lambda x: 1.0 if x > 0 else -1.0, -1e300, 1e300, tolerance=1e-320)
