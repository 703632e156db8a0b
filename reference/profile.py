"""Bowls of any profile z = g(r): an even polynomial, a spline through points or a user's function."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numba as nb
import numpy as np

from .kernels.revolution import of_radius, of_square
from .kernels.spline import DEGREE, piecewise, polynomial
from .surface import Plane, SurfaceFunction, SurfaceOfRevolution, is_number, surface_function


@surface_function
def _polynomial(x, y, parameters):
    return of_square(x, y, *polynomial(parameters, x * x + y * y))


@surface_function
def _spline(x, y, parameters):
    return of_square(x, y, *piecewise(parameters, x * x + y * y))


def _as_floats(name: str, values: Sequence[float]) -> tuple[float, ...]:
    """Return finite numbers as floats; raise ValueError with the first that is not one."""
    for i, value in enumerate(values):
        if not is_number(value):
            raise ValueError(f"{name}[{i}] is {value!r}; it must be a finite number")
    return tuple(float(value) for value in values)


@dataclass(frozen=True)
class PolynomialProfile:
    """The bowl z = c1 r^2 + c2 r^4 + c3 r^6 + ...

    Parameters
    ----------
    coefficients : sequence of float
        c1 [1/m], c2 [1/m^3], c3 [1/m^5], ...; c1 alone is the paraboloid of that alpha.

    Raises
    ------
    ValueError
        If one is not finite, or none differs from zero.
    """

    coefficients: Sequence[float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", _as_floats("coefficients", self.coefficients))
        if not any(self.coefficients):
            raise ValueError("coefficients are all zero; level ground is the plane")

    def __repr__(self) -> str:
        # There may be a thousand coefficients; the surface is named in messages of one line.
        return f"{type(self).__name__}(coefficients={reprlib.repr(self.coefficients)})"

    @property
    def function(self) -> SurfaceFunction:
        """The height function."""
        return _polynomial

    @property
    def parameters(self) -> np.ndarray:
        """Coefficients of the powers of r^2, from the zeroth, shape (n + 1,)."""
        return np.array([0.0, *self.coefficients])

    @property
    def extent(self) -> tuple[float, float]:
        """Radii of the ground [m]; it has no edge."""
        return 0.0, math.inf

    def flattened(self, fraction: float) -> SurfaceOfRevolution:
        """Return the bowl with all heights times the fraction."""
        return PolynomialProfile(tuple(fraction * c for c in self.coefficients)) if fraction > 0 else Plane()


@dataclass(frozen=True)
class SplineProfile:
    """The bowl through points (r, z) of its profile.

    A quintic spline in r^2: smooth on the axis, with four continuous derivatives elsewhere. With fewer than seven
    points it is a single polynomial. There is no ground outside the points.

    Parameters
    ----------
    radii : sequence of float
        In rising order, the first >= 0 [m]; two or more. The axis has ground if the first is 0.
    heights : sequence of float
        One for each radius, not all equal [m].

    Raises
    ------
    ValueError
        If the radii do not rise, the numbers of radii and heights differ, or the heights are all equal.
    """

    radii: Sequence[float]
    heights: Sequence[float] = field(repr=False)

    def __post_init__(self) -> None:
        for name in ("radii", "heights"):
            object.__setattr__(self, name, _as_floats(name, getattr(self, name)))
        if len(self.radii) != len(self.heights) or len(self.radii) < 2:
            counts = f"{len(self.radii)} radii and {len(self.heights)} heights"
            raise ValueError(f"there are {counts}; there must be as many of each, two or more")
        if self.radii[0] < 0:
            raise ValueError(f"radii[0] is {self.radii[0]!r}; it must be >= 0")
        for i, (inner, outer) in enumerate(pairwise(self.radii)):
            if not outer > inner:
                raise ValueError(f"radii[{i + 1}] is {outer!r}; it must be greater than {inner!r} before it")
            if not outer**2 > inner**2:  # the spline's own variable
                raise ValueError(
                    f"radii[{i + 1}] is {outer!r}; its square cannot be told from that of {inner!r} before it"
                )
        if len(set(self.heights)) == 1:
            raise ValueError("heights are all equal; level ground is the plane")

    def __repr__(self) -> str:
        return f"{type(self).__name__}(radii={reprlib.repr(self.radii)})"

    @property
    def function(self) -> SurfaceFunction:
        """The height function."""
        return _spline

    @property
    def parameters(self) -> np.ndarray:
        """Parameters of `velodrome.reference.kernels.spline.piecewise`: breaks in r^2, then coefficients."""
        return self._parameters

    @cached_property
    def _parameters(self) -> np.ndarray:
        # Imported here: the import takes a quarter of a second, and only this surface needs it.
        from scipy.interpolate import PPoly, make_interp_spline

        squares = np.array(self.radii) ** 2
        spline = make_interp_spline(squares, np.array(self.heights), k=min(DEGREE, len(squares) - 1))
        pieces = PPoly.from_spline(spline)
        solid = np.diff(pieces.x) > 0  # the knots at both ends are repeated
        powers = np.zeros((int(solid.sum()), DEGREE + 1))
        powers[:, : len(pieces.c)] = pieces.c[::-1, solid].T
        return np.concatenate([np.unique(pieces.x), powers.ravel()])

    @property
    def extent(self) -> tuple[float, float]:
        """Radii of the ground, from the first point to the last [m]."""
        return self.radii[0], self.radii[-1]

    @property
    def detail(self) -> float:
        """Smallest distance between two neighbouring points [m]."""
        return min(outer - inner for inner, outer in pairwise(self.radii))

    def flattened(self, fraction: float) -> SurfaceOfRevolution:
        """Return the bowl with all heights times the fraction."""
        return SplineProfile(self.radii, tuple(fraction * z for z in self.heights)) if fraction > 0 else Plane()


def profile_function(profile: Callable[..., tuple]) -> SurfaceFunction:
    """Make ``profile(r, constants) -> (g, g', g'')`` the function of a `Profile`.

    All three results must have the type of ``r``, which is real or complex, and the function must be analytic: no
    `abs`, no comparison other than of real parts. It returns nan where there is no ground.

    Parameters
    ----------
    profile : callable
        Height [m] and its first [-] and second derivative [1/m] at r [m], in numba's subset of Python.
        ``constants`` is the array of the `Profile`'s constants.

    Returns
    -------
    SurfaceFunction
    """
    compiled = nb.njit(error_model="numpy")(profile)

    def height(x, y, parameters):
        r = np.sqrt(x * x + y * y)
        g, first, second = compiled(r, parameters[1:])
        scale = parameters[0]
        return of_radius(x, y, r, scale * g, scale * first, scale * second)

    return SurfaceFunction(height, cached=False)


@dataclass(frozen=True)
class Profile:
    """The bowl z = g(r) of a user's profile.

    Parameters
    ----------
    function : SurfaceFunction
        Result of `profile_function` for g.
    constants : sequence of float
        Passed to g.
    extent : tuple of float
        Smallest and largest radius where g has ground [m].
    scale : float
        Factor of all heights, positive.

    Raises
    ------
    ValueError
        If a constant is not finite, the extent is not 0 <= inner < outer, or the scale is not positive and finite.
    """

    function: SurfaceFunction
    constants: Sequence[float] = ()
    extent: tuple[float, float] = (0.0, math.inf)
    scale: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "constants", _as_floats("constants", self.constants))
        inner, outer = self.extent
        if not 0 <= inner < outer:
            raise ValueError(f"extent is {self.extent!r}; it must be two radii, 0 <= inner < outer")
        if not (is_number(self.scale) and self.scale > 0):
            raise ValueError(f"scale is {self.scale!r}; it must be a finite number > 0")

    @property
    def parameters(self) -> np.ndarray:
        """The scale, then the constants."""
        return np.array([float(self.scale), *self.constants])

    def flattened(self, fraction: float) -> SurfaceOfRevolution:
        """Return the bowl with all heights times the fraction."""
        return replace(self, scale=fraction * self.scale) if fraction > 0 else Plane()
