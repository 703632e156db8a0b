"""Hopf points of a family of circular motions: criticality and the amplitude of the oscillation born there.

The energy is conserved, so that the Hopf point is that of the flow on a level set of energy, with the energy E as its
parameter (`energy_level`). With the normal form of `normal_form`, periodic orbits have the amplitude

    Re k (E - E0) + Re c1 |z|^2 = 0 + O(|z|^4)

and a lean whose peak-to-peak is 2 A = 4 |q_lean| |z| + O(|z|^3), so that

    d(A^2) / dE = -4 |q_lean|^2 Re k / Re c1
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..circular import CircularMotion
from ..families import Family
from ..inputs import NO_INPUTS
from ..sections import SectionEnd, stable_sections
from ..stability import are_zero
from ..surface import is_level
from .energy_level import CHART, EnergyLevel, energy_level
from .normal_form import NormalForm, expand_hopf, linearise_field

SUPERCRITICAL, SUBCRITICAL = "supercritical", "subcritical"

LEAN_INDEX = CHART.index("lean")


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


def section_hopf_points(family: Family) -> list[HopfPoint]:
    """Return the Hopf points at the ends of a family's stable sections, in the order along the family."""
    ends = [end for section in stable_sections(family) for end in section]
    return [examine_hopf(family, end) for end in ends if end.cause == "hopf"]


def examine_hopf(family: Family, end: SectionEnd) -> HopfPoint:
    """Compute criticality and amplitude at a Hopf point of a family."""
    equations, motion = family.equations, end.motion
    level = energy_level(equations, motion)
    point = HopfPoint(family.numbers, motion, level.energy, end.eigenvalue.imag, level)
    if equations.inputs != NO_INPUTS:
        return replace(point, why_undefined=f"the energy is not conserved with {equations.inputs.describe()}")
    if is_level(equations.surface):
        why = "on the level plane the circle's centre is free, and a second pair of eigenvalues is imaginary"
        return replace(point, why_undefined=why)

    def field(variables: np.ndarray, energy: np.ndarray) -> np.ndarray:
        return level.field(variables, energy)[0]

    jacobian, _ = linearise_field(field, level.centre, level.energy)
    if are_zero(np.linalg.eigvals(jacobian)).any():
        return replace(point, why_undefined="the energy is extreme along the family")
    # Oscillations are measured by their angles, and by the position in units of the circle's radius, since nearly level
    # ground hardly holds the circle's centre.
    units = {"lean": 1.0, "steer": 1.0, "x": float(np.hypot(*level.centre[:2])), "y": float(np.hypot(*level.centre[:2]))}
    scale = np.array([units.get(name, np.inf) for name in CHART])
    return _measure(point, expand_hopf(field, level.centre, level.energy, point.frequency, scale))


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
