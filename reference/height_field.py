"""Ground through a grid of heights: z = f(x, y) without any symmetry, for simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import comb

import numpy as np

from .kernels.spline import DEGREE, tensor, uniform_cell
from .surface import SurfaceFunction, is_number, surface_function

_FEWEST = DEGREE + 1


@surface_function
def _tensor_spline(x, y, parameters):
    spacing, nx, ny = parameters[2], int(parameters[3]), int(parameters[4])
    u, v = (x - parameters[0]) / spacing, (y - parameters[1]) / spacing
    i, j = uniform_cell(u, nx), uniform_cell(v, ny)
    if i < 0 or j < 0:
        hole = np.nan + 0 * x
        return hole, hole, hole, hole, hole, hole
    coefficients = parameters[5:].reshape((nx + 4, ny + 4))
    f, fu, fv, fuu, fuv, fvv = tensor(coefficients, i, j, u - i, v - j)
    square = spacing * spacing
    return f, fu / spacing, fv / spacing, fuu / square, fuv / square, fvv / square


def _spline_coefficients(samples: np.ndarray) -> np.ndarray:
    """Compute coefficients (n + 4, m) of uniform quintic B-splines through samples (n, m) along the first axis.

    The fifth derivative jumps by the sixth difference of the coefficients. Two such jumps next to either end are set
    to zero ("not a knot"), which keeps the order 6 up to the edge.
    """
    n = len(samples)
    matrix, right = np.zeros((n + 4, n + 4)), np.zeros((n + 4, samples.shape[1]))
    for k in range(n):
        matrix[k, k : k + 5] = np.array([1, 26, 66, 26, 1]) / 120
    right[:n] = samples
    jump = [(-1) ** k * comb(6, k) for k in range(7)]
    for row, first in enumerate((0, 1, n - 4, n - 3)):
        matrix[n + row, first : first + 7] = jump
    return np.linalg.solve(matrix, right)


@dataclass(frozen=True)
class HeightField:
    """Ground through a regular grid of heights, by tensor-product quintic splines.

    The height has four continuous derivatives and an error of order 6 in the spacing. There is no ground
    outside the grid: a ride ends there.

    Parameters
    ----------
    heights : array_like, shape (nx, ny)
        Row i, column j is the height at (x0 + i spacing, y0 + j spacing) [m]; at least six each way, not
        all equal.
    spacing : float
        Distance of neighbouring samples, the same both ways [m].
    origin : tuple of float
        Position (x0, y0) of the first sample [m].

    Raises
    ------
    ValueError
        If the grid is too small, not rectangular or level, or a number is not finite or not in its range.
    """

    heights: Sequence[Sequence[float]] = field(repr=False)
    spacing: float
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        rows = _height_rows(self.heights)
        object.__setattr__(self, "heights", rows)
        if not (is_number(self.spacing) and self.spacing > 0):
            raise ValueError(f"spacing is {self.spacing!r}; it must be a finite number > 0")
        if len(self.origin) != 2 or not all(is_number(value) for value in self.origin):
            raise ValueError(f"origin is {self.origin!r}; it must be two finite numbers")
        object.__setattr__(self, "origin", tuple(float(value) for value in self.origin))
        if len({height for row in rows for height in row}) == 1:
            raise ValueError("heights are all equal; level ground is the plane")

    @property
    def function(self) -> SurfaceFunction:
        """The height function."""
        return _tensor_spline

    @property
    def parameters(self) -> np.ndarray:
        """Origin, spacing and numbers of samples, then the spline's coefficients row by row."""
        return self._parameters

    @cached_property
    def _parameters(self) -> np.ndarray:
        samples = np.array(self.heights)
        along_x = _spline_coefficients(samples)
        coefficients = _spline_coefficients(along_x.T).T
        return np.concatenate([self.origin, [self.spacing], samples.shape, coefficients.ravel()])

    @cached_property
    def bend(self) -> float:
        """Upper bound of the largest eigenvalue of the Hessian [1/m].

        The spline's second derivatives are means of differences of its coefficients with positive weights.
        """
        nx, ny = len(self.heights), len(self.heights[0])
        c = self._parameters[5:].reshape(nx + 4, ny + 4) / self.spacing**2
        along, across = np.diff(c, 2, axis=0).max(), np.diff(c, 2, axis=1).max()
        mixed = np.abs(np.diff(np.diff(c, axis=0), axis=1)).max()
        return float((along + across) / 2 + np.hypot((along - across) / 2, mixed))

    @property
    def detail(self) -> float:
        """The spacing [m]."""
        return float(self.spacing)


def _height_rows(heights: Sequence[Sequence[float]]) -> tuple[tuple[float, ...], ...]:
    """Return the heights as tuples; raise ValueError if they are not a grid of numbers."""
    grid = heights.tolist() if isinstance(heights, np.ndarray) else heights
    if len(grid) < _FEWEST or any(len(row) != len(grid[0]) for row in grid) or len(grid[0]) < _FEWEST:
        raise ValueError(f"heights must be a grid of {_FEWEST} x {_FEWEST} or more, its rows of one length")
    for i, row in enumerate(grid):
        for j, value in enumerate(row):
            if not is_number(value):
                raise ValueError(f"heights[{i}][{j}] is {value!r}; it must be a finite number")
    return tuple(tuple(float(value) for value in row) for row in grid)
