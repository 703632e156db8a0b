"""Hopf points of a family of circular motions: criticality and the amplitude of the oscillation born there.

The energy is conserved, so that the Hopf point is that of the flow on a level set of energy, with the energy E as its
parameter (`energy_level`). With the normal form of `normal_form`, periodic orbits have the amplitude

    Re k (E - E0) + Re c1 |z|^2 = 0 + O(|z|^4)

and a lean whose peak-to-peak is 2 A = 4 |q_lean| |z| + O(|z|^3), so that

    d(A^2) / dE = -4 |q_lean|^2 Re k / Re c1
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ..circular import CircularMotion, Steady
from ..continuation import Point, roots_along
from ..families import Family
from ..inputs import NO_INPUTS
from ..sections import SectionEnd, linearise_point, stable_sections
from ..stability import are_zero, free_eigenvalues
from ..surface import is_level
from .energy_level import CHART, EnergyLevel, energy_level
from .normal_form import NormalForm, expand_hopf, linearise_field

SUPERCRITICAL, SUBCRITICAL = "supercritical", "subcritical"

LEAN_INDEX = CHART.index("lean")

# Roots of two functions at one Hopf point differ by round-off of the eigenvalues, 1e-13 to 1e-11, over their slopes
# along the family; different Hopf points of one family have been seen no nearer than 1e-3.
_SAME = 1e-7


@dataclass(frozen=True, eq=False)
class HopfPoint:
    """A circular motion at which a pair of eigenvalues crosses the imaginary axis.

    Attributes
    ----------
    numbers : tuple of int
        Of the families on the curve.
    motion : CircularMotion
    energy : float
        Kinetic and potential, the latter zero at z = 0 [J].
    frequency : float
        Imaginary part of the crossing eigenvalue [rad/s].
    ends_section : bool
        Whether a stable section of the family ends there. Elsewhere a further eigenvalue has a positive real part, and
        what `criticality` says of stability is true on the centre manifold only.
    level : EnergyLevel
        The flow on the level sets of energy, where the oscillation's amplitude is defined.
    form : NormalForm or None
        Its normal form, where the Hopf point on a level set is generic enough to have one.
    criticality : str or None
        `SUBCRITICAL`: the periodic orbits live at energies at which the circle is stable, and are unstable;
        `SUPERCRITICAL`: at those at which it is unstable, and are stable on the centre manifold.
    amplitude_slope : float or None
        d(A^2) / dE at the Hopf point, with A half of the peak-to-peak of the lean [rad^2/J].
    amplitude_slope_error : float or None
        Estimate of its absolute error.
    why_undefined : str or None
        Why criticality or amplitude are not defined.
    """

    numbers: tuple[int, ...]
    motion: CircularMotion
    energy: float
    frequency: float
    ends_section: bool
    level: EnergyLevel
    form: NormalForm | None = None
    criticality: str | None = None
    amplitude_slope: float | None = None
    amplitude_slope_error: float | None = None
    why_undefined: str | None = None

    @property
    def first_lyapunov_coefficient(self) -> float | None:
        """Re c1 / omega for a lean amplitude A = |z|, which sets the scale of the eigenvector [1/rad^2]."""
        if self.form is None:
            return None
        return float(self.form.cubic.value.real / self.frequency / (2 * abs(self.form.vector[LEAN_INDEX])) ** 2)

    @property
    def growth_in_period(self) -> float:
        """Factor by which the other disturbances of the circle grow at most while the critical ones turn once.

        It is inf where it overflows.
        """
        assert self.form is not None, "there is no normal form"
        values = np.linalg.eigvals(self.form.jacobian)
        others = np.abs(np.abs(values.imag) - self.frequency) + np.abs(values.real) > _SAME
        with np.errstate(over="ignore"):
            return float(np.exp(2 * np.pi / self.frequency * values[others].real.max()))


def find_hopf_points(family: Family) -> list[HopfPoint]:
    """Find the Hopf points of a family: those at ends of stable sections first, then others in the order along it.

    At the others a further eigenvalue has a positive real part. Two of them between neighbouring points of the family
    are missed.
    """
    ends = section_hopf_points(family)
    return ends + [point for point in _crossing_points(family) if not any(_is_same(point, end) for end in ends)]


def section_hopf_points(family: Family) -> list[HopfPoint]:
    """Return the Hopf points at the ends of a family's stable sections, in the order along the family."""
    ends = [end for section in stable_sections(family) for end in section]
    return [examine_end(family, end) for end in ends if end.cause == "hopf"]


def examine_end(family: Family, end: SectionEnd) -> HopfPoint:
    """Compute criticality and amplitude at a Hopf point that ends a stable section."""
    return examine_hopf(family, end.motion, end.eigenvalue.imag, True)


def _crossing_points(family: Family) -> Iterator[HopfPoint]:
    """Yield all Hopf points between neighbouring points of a family, as if none ended a stable section."""
    equations = family.equations
    for _, point in roots_along(equations, family.points, lambda point: _pair_sums(equations, point)):
        motion, reduced = linearise_point(equations, point)
        free = free_eigenvalues(equations.surface, reduced.eigenvalues, motion.yaw_rate)
        first, second = min(combinations(free, 2), key=lambda pair: abs(sum(pair)))
        # Two real eigenvalues of opposite signs have a zero sum without a bifurcation.
        if motion.rear_rate != 0 and first.imag == -second.imag != 0:
            yield examine_hopf(family, motion, abs(first.imag))


def _pair_sums(equations: Steady, point: Point) -> float:
    """Return the product of all sums of two free eigenvalues, which changes its sign where a pair crosses the axis."""
    motion, reduced = linearise_point(equations, point)
    free = free_eigenvalues(equations.surface, reduced.eigenvalues, motion.yaw_rate)
    return float(np.prod([sum(pair) for pair in combinations(free / np.abs(free).max(), 2)]).real)


def _is_same(point: HopfPoint, other: HopfPoint) -> bool:
    """Return whether two Hopf points of a family are one: both are solved to round-off, times the curve's slope."""
    return abs(point.motion.lean - other.motion.lean) + abs(point.frequency - other.frequency) < _SAME


def examine_hopf(family: Family, motion: CircularMotion, frequency: float, ends_section: bool = False) -> HopfPoint:
    """Compute criticality and amplitude at a Hopf point.

    Parameters
    ----------
    family : Family
    motion : CircularMotion
        A motion of the family with a pair of imaginary eigenvalues.
    frequency : float
        Their size [rad/s].
    ends_section : bool
        Whether a stable section ends there.

    Returns
    -------
    HopfPoint
    """
    equations = family.equations
    level = energy_level(equations, motion)
    point = HopfPoint(family.numbers, motion, level.energy, frequency, ends_section, level)
    why = explain_undefined(equations)
    if why is not None:
        return replace(point, why_undefined=why)

    def field(variables: np.ndarray, energy: np.ndarray) -> np.ndarray:
        return level.field(variables, energy)[0]

    jacobian, _ = linearise_field(field, level.centre, level.energy)
    if not np.all(np.isfinite(jacobian)):
        why = "the mass matrix of all coordinates is singular, since a part of the bicycle has no inertia"
        return replace(point, why_undefined=why)
    if are_zero(np.linalg.eigvals(jacobian)).any():
        return replace(point, why_undefined="the energy is extreme along the family")
    # Oscillations are measured by their angles, and by the position in units of the circle's radius, since nearly level
    # ground hardly holds the circle's centre.
    units = {
        "lean": 1.0,
        "steer": 1.0,
        "x": float(np.hypot(*level.centre[:2])),
        "y": float(np.hypot(*level.centre[:2])),
    }
    scale = np.array([units.get(name, np.inf) for name in CHART])
    try:
        form = expand_hopf(field, level.centre, level.energy, point.frequency, scale)
    except ValueError as error:  # next to a singularity of the equations
        return replace(point, why_undefined=f"the normal form cannot be computed: {error}")
    return _measure(point, form)


def explain_undefined(equations: Steady) -> str | None:
    """Explain why no circle of a bicycle on its ground has oscillations whose amplitude follows from the energy."""
    if equations.inputs != NO_INPUTS:
        return f"the energy is not conserved with {equations.inputs.describe()}"
    if is_level(equations.surface):
        return "on the level plane the circle's centre is free, and a second pair of eigenvalues is imaginary"
    return None


def _measure(point: HopfPoint, form: NormalForm) -> HopfPoint:
    """Return a point with the criticality and the amplitude that follow from its normal form."""
    point, cubic, growth = replace(point, form=form), form.cubic.value.real, form.growth.value.real
    if abs(cubic) <= form.cubic.error:
        return replace(point, why_undefined="the first Lyapunov coefficient is zero")
    if abs(growth) <= form.growth.error:
        return replace(point, why_undefined="the pair of eigenvalues touches the imaginary axis")
    slope = -4 * float(np.abs(form.vector[LEAN_INDEX])) ** 2 * growth / cubic
    return replace(
        point,
        criticality=SUBCRITICAL if cubic > 0 else SUPERCRITICAL,
        amplitude_slope=slope,
        amplitude_slope_error=abs(slope) * (form.cubic.error / abs(cubic) + form.growth.error / abs(growth)),
    )
