"""Solution families of circular motions and critical shapes of the bowl, with their documents."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.critical import CriticalPoint, describe_gaps, last_stable, reconnections
from ...reference.curve import Samples
from ...reference.families import FAMILIES, Family, trace, trace_all
from ...reference.inputs import NO_INPUTS, Inputs
from ...reference.missing_motion import NoSuchMotion
from ...reference.modes import MODES, follow_modes
from ...reference.regularity import require_inertia_in_turns
from ...reference.rideability import Rideability
from ...reference.rideable_parts import PartEnd, assess_family, find_rideable_parts, find_rideable_parts_of_section
from ...reference.sections import SectionEnd, sample_family, stable_sections
from ...reference.special import SpecialPoint, special_points
from ...reference.surface import Paraboloid, Surface, SurfaceOfRevolution
from ...reports.measure import to_number
from ..error import ScenarioError
from ..files import DEFAULT_FIGURES, FigureOutput, make_folder, write_json, write_text
from ..scenario import describe_missing_motion, find_unit, make_bowl, name_bicycle, name_surface

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .bounds import BoundedSection

# Longest step along the arc: 100 to 300 points per family. No known stable section is shorter than three steps.
LONGEST_DRAWN_STEP = 0.05
MERGING = "merging"  # stage of the search for critical shapes whose progress is an alpha [1/m]


@dataclass(frozen=True, kw_only=True)
class FamilyCurve:
    """A curve of circular motions that contains a solution family or a part of one.

    Attributes
    ----------
    numbers : tuple of int
        Numbers of the families on the curve, 1 to 4: several if families have joined, none if the curve is not
        connected with the benchmark bicycle's families.
    ends : tuple of str
        Kinds of the curve's two ends, see `velodrome.reference.families.Family`.
    samples : Samples
        Rates, angles, energy, normal forces and growth rates of the n motions along the curve.
    modes : ndarray, shape (n, 7), complex
        Eigenvalues along the curve, each column following one mode [1/s].
    rideability : Rideability
        Whether the motions can be ridden, and what friction they need.
    rideable_parts : tuple of pairs of PartEnd
        Ends of the parts of the curve that can be ridden.
    stable_sections : tuple of pairs of SectionEnd
        Ends of the sections in which the motions are Lyapunov stable.
    stable_parts : tuple of tuples of pairs of PartEnd
        For each of these sections, the ends of its parts that can be ridden.
    special_points : tuple of SpecialPoint
        Points with a letter in the paper, folds, cusps and extremes of the energy.
    bounds : tuple of BoundedSection, or None
        For each stable section, how far from its circles a bicycle may weave and come back; None where that was not
        searched for.
    """

    numbers: tuple[int, ...]
    ends: tuple[str, str]
    samples: Samples = field(repr=False)
    modes: np.ndarray = field(repr=False)
    rideability: Rideability = field(repr=False)
    rideable_parts: tuple[tuple[PartEnd, PartEnd], ...] = field(repr=False)
    stable_sections: tuple[tuple[SectionEnd, SectionEnd], ...] = field(repr=False)
    stable_parts: tuple[tuple[tuple[PartEnd, PartEnd], ...], ...] = field(repr=False)
    special_points: tuple[SpecialPoint, ...] = field(repr=False)
    bounds: tuple[BoundedSection, ...] | None = field(default=None, repr=False)

    @property
    def number(self) -> int | None:
        """Smallest number of the families on the curve; None if it has no number."""
        return self.numbers[0] if self.numbers else None

    @property
    def rims_clear(self) -> np.ndarray:
        """Whether the wheels touch the ground only at their contact points, boolean of shape (n,)."""
        return self.rideability.rims_clear

    @property
    def physical(self) -> np.ndarray:
        """Whether the motions can be ridden, boolean of shape (n,)."""
        return self.rideability.physical

    def as_json(self) -> dict[str, Any]:
        """Return this curve's part of the document of `velodrome families`."""
        return {
            "family": self.number,
            "joined_families": list(self.numbers[1:]),
            "ends": list(self.ends),
            "points": self._list_points(),
            "rideable_parts": [_describe_ends(*ends) for ends in self.rideable_parts],
            "stable_sections": [
                _describe_section(*ends, parts=parts) | {"within": None if bound is None else bound.as_json()}
                for ends, parts, bound in zip(
                    self.stable_sections,
                    self.stable_parts,
                    self.bounds or [None] * len(self.stable_sections),
                    strict=True,
                )
            ],
            "special_points": {
                point.name: {
                    "rear_rate": point.rear_rate,
                    "front_rate": point.front_rate,
                    "lean": point.lean,
                    "steer": point.steer,
                    "kind": point.kind,
                    "physical": not point.unphysical_because,
                    "unphysical_because": list(point.unphysical_because),
                }
                for point in self.special_points
            },
        }

    def _list_points(self) -> dict[str, list[Any]]:
        """Return the quantities along the curve as lists of equal length."""
        samples = self.samples
        names = ("rear_rate", "front_rate", "yaw_rate", "lean", "steer", "pitch", "radius", "energy")
        return {
            **{name: getattr(samples, name).tolist() for name in names},
            "lyapunov_stable": samples.stable.tolist(),
            "physical": self.physical.tolist(),
            "unphysical_because": self.rideability.list_obstacles(),
            "rims_clear": self.rims_clear.tolist(),
            "required_friction": [to_number(value) for value in self.rideability.friction.max(axis=1)],
            "growth_rate": samples.growth_rate.tolist(),
            "normal_force_rear": samples.normal_force[:, 0].tolist(),
            "normal_force_front": samples.normal_force[:, 1].tolist(),
            "eigenvalues": np.stack([np.real(self.modes), np.imag(self.modes)], axis=-1).tolist(),
        }


@dataclass(frozen=True, kw_only=True)
class SolutionFamilies:
    """The solution families of one bicycle on one ground.

    Attributes
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    curves : tuple of FamilyCurve
        The families by number, then further curves, each with the number of the family that it was a part of.
    absent : dict
        Reasons by number, for families that have no curve on this ground.
    inputs : Inputs
        Inputs that are held in all motions. With a steer torque no curve has a number.
    """

    bicycle: Bicycle
    surface: SurfaceOfRevolution
    curves: tuple[FamilyCurve, ...]
    absent: dict[int, str]
    inputs: Inputs = NO_INPUTS

    def as_json(self, bicycle_name: str | None = None) -> dict[str, Any]:
        """Return the JSON document of `velodrome families`; see `name_bicycle` for the name."""
        return {
            **name_surface(self.surface),
            **name_bicycle(self.bicycle, bicycle_name),
            "inputs": asdict(self.inputs),
            "modes": list(MODES),  # names of the columns of eigenvalues
            "families": [curve.as_json() for curve in self.curves],
            "absent": {str(number): reason for number, reason in self.absent.items()},
        }


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CriticalShapes:
    """Critical shapes of the paraboloid; they are compared by identity.

    Attributes
    ----------
    bicycle : Bicycle
    cusp_collision : CriticalPoint or None
        The point at which the cusps of families 2 and 4 meet; None if they do not meet.
    last_stable : dict
        By number of the family: the `CriticalPoint` at which its last Lyapunov-stable section vanishes, or None if it
        has no stable section.
    merging : tuple of CriticalPoint
        The points at which families exchange parts, sorted by alpha.
    not_found : dict
        By number of a family that could not be followed at every alpha, or of which a point could not be solved: the
        reason. Families are those of the benchmark; on another bicycle they may end, and what happens on curves
        without a number is not looked for.
    """

    bicycle: Bicycle
    cusp_collision: CriticalPoint | None
    last_stable: dict[int, CriticalPoint | None]
    merging: tuple[CriticalPoint, ...]
    not_found: dict[int, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        def show(point: CriticalPoint | None) -> str:
            if point is None:
                return "none"
            return f"{point.alpha:.6g}" + (" (cannot be ridden)" if point.unphysical_because else "")

        last = ", ".join(f"family {number} {show(point)}" for number, point in self.last_stable.items())
        merging = ", ".join(f"families {' and '.join(map(str, one.families))} {show(one)}" for one in self.merging)
        return "\n".join(
            [
                "CriticalShapes, alpha [1/m]:",
                f"  cusps of families 2 and 4 meet: {show(self.cusp_collision)}",
                f"  last stable section vanishes: {last}",
                f"  families exchange parts: {merging or 'none'}",
                *(f"  family {number} not followed: {reason}" for number, reason in self.not_found.items()),
            ]
        )

    def as_json(self, bicycle_name: str | None = None) -> dict[str, Any]:
        """Return the JSON document of `velodrome critical`; see `name_bicycle` for the name."""
        return {
            **name_bicycle(self.bicycle, bicycle_name),
            "cusp_collision": _entry_or_null(self.cusp_collision),
            "last_stable": {str(number): _entry_or_null(point) for number, point in self.last_stable.items()},
            "merging": [{"families": list(point.families)} | critical_entry(point) for point in self.merging],
            "not_found": {str(number): reason for number, reason in self.not_found.items()},
        }


def follow_families(
    bicycle: Bicycle,
    surface: SurfaceOfRevolution,
    inputs: Inputs = NO_INPUTS,
    watch: Callable[[int, int], None] = lambda *_: None,
    within: bool = False,
) -> SolutionFamilies:
    """Follow every curve of the four families on a ground, with special points and stable sections.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    inputs : Inputs
        Held constant.
    watch : callable
        Called with the number of curves that have been examined, and that of all.
    within : bool
        Search for the orbits that bound stable circles, too; this takes some seconds for each stable section.

    Returns
    -------
    SolutionFamilies

    Raises
    ------
    MissingMotionError
        If there is a torque on the rear wheel, with which there is no circular motion.
    ScenarioError
        If the bicycle's equations of motion are singular.
    """
    check_inertia(bicycle)
    try:
        curves, absent = trace_all(bicycle, surface, LONGEST_DRAWN_STEP, inputs)
    except NoSuchMotion as error:
        raise describe_missing_motion(error) from error
    examined: list[FamilyCurve] = []
    for curve in curves:
        watch(len(examined), len(curves))
        examined.append(examine_curve(curve, within))
    return SolutionFamilies(bicycle=bicycle, surface=surface, curves=tuple(examined), absent=absent, inputs=inputs)


def check_inertia(bicycle: Bicycle) -> None:
    """Raise a ScenarioError if a bicycle's equations of motion are singular in turns."""
    try:
        require_inertia_in_turns(bicycle)
    except ValueError as error:
        raise ScenarioError(f"bicycle: {error}") from error


def examine_curve(family: Family, within: bool = False) -> FamilyCurve:
    """Sample a curve and find its special points, its stable sections, what of them can be ridden, and their bounds."""
    sections = stable_sections(family)
    bounds: tuple[BoundedSection, ...] | None = None
    if within:
        from .bounds import bound_stable_sections  # without, families need no orbits

        bounds = bound_stable_sections(family, sections)
    return FamilyCurve(
        numbers=family.numbers,
        ends=family.ends,
        samples=sample_family(family),
        modes=follow_modes(family),
        rideability=assess_family(family),
        rideable_parts=tuple(find_rideable_parts(family)),
        stable_sections=tuple(sections),
        stable_parts=tuple(tuple(find_rideable_parts_of_section(family, ends)) for ends in sections),
        special_points=tuple(special_points(family)),
        bounds=bounds,
    )


def families_document(ground: Surface | float, inputs: Inputs = NO_INPUTS) -> dict[str, Any]:
    """Follow the four families of the benchmark bicycle on a ground.

    Parameters
    ----------
    ground : Surface or float
        A surface of revolution, or the alpha of a paraboloid [1/m].
    inputs : Inputs
        Held constant.

    Returns
    -------
    dict
        The JSON document of `velodrome families`: the families by number, then further curves, each with the number of
        the family that it was a part of; ``absent`` gives the reasons for families without a curve.

    Raises
    ------
    ScenarioError
        If the ground is not a surface of revolution, or there is a torque on the rear wheel.
    """
    return follow_families(Bicycle(), make_bowl(ground), inputs).as_json()


def find_critical_shapes(bicycle: Bicycle, watch: Callable[[str, float, float], None]) -> CriticalShapes:
    """Compute the critical values of alpha for a bicycle.

    Parameters
    ----------
    bicycle : Bicycle
    watch : callable
        Called with the name of the stage, the value reached and the largest value: an alpha [1/m], or a family.

    Returns
    -------
    CriticalShapes
    """
    check_inertia(bicycle)
    watch(MERGING, 0.0, 1.0)
    merging = reconnections(bicycle, lambda alpha: watch(MERGING, alpha, 1.0))
    stable: dict[int, CriticalPoint | None] = {}
    not_found: dict[int, str] = {}
    for number in FAMILIES:
        watch("last stable", float(number - 1), float(len(FAMILIES)))
        reasons = []
        try:
            stable[number] = last_stable(bicycle, number)
        except ValueError as error:
            stable[number] = None
            reasons.append(str(error))
        gaps = describe_gaps(bicycle, number)
        reasons += [] if gaps is None else [gaps]
        if reasons:
            not_found[number] = "; ".join(reasons)
    collision = next((point for point in merging if _do_cusps_meet(bicycle, point)), None)
    return CriticalShapes(
        bicycle=bicycle,
        cusp_collision=collision,
        last_stable=stable,
        merging=tuple(merging),
        not_found=not_found,
    )


def _do_cusps_meet(bicycle: Bicycle, point: CriticalPoint) -> bool:
    """Return whether the cusps D and I meet in a point where families 2 and 4 touch.

    Curves of another bicycle may touch in other points. Both cusps are there at a smaller alpha, if they are to meet.
    """
    if point.families != (2, 4):
        return False
    names = set()
    for number in point.families:
        try:
            names |= {one.name for one in special_points(trace(bicycle, Paraboloid(0.98 * point.alpha), number))}
        except ValueError:
            return False
    return {"D", "I"} <= names


def critical_entry(point: CriticalPoint) -> dict[str, Any]:
    """Return the entry of a critical point in documents."""
    motion = point.motion
    return {
        "alpha": point.alpha,
        "rear_rate": motion.rear_rate,
        "front_rate": motion.front_rate,
        "lean": motion.lean,
        "steer": motion.steer,
        "kind": point.kind,
        "residual": point.residual,
        "physical": not point.unphysical_because,
        "unphysical_because": list(point.unphysical_because),
    }


def _entry_or_null(point: CriticalPoint | None) -> dict[str, Any] | None:
    return None if point is None else critical_entry(point)


def write_families(
    document: Mapping[str, Any], out: Path, libraries: Mapping[str, str], output: FigureOutput = DEFAULT_FIGURES
) -> list[Path]:
    """Write the document, its page and its figure into a folder, which is made if it does not exist.

    Parameters
    ----------
    document : mapping
        As `SolutionFamilies.as_json` returns it.
    out : Path
    libraries : mapping of str to str
        Versions by name, which the page states.
    output : FigureOutput
        How the figure is written.

    Returns
    -------
    list of Path
        What is written.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    from ...reports.figures import family_figure, write_formats
    from ...reports.page import make_families_page

    make_folder(out)
    data, page = out / "families.json", out / "families.html"
    write_json(data, document)
    write_text(page, make_families_page(document, libraries))
    radius = document["bicycle"]["parameters"]["front_wheel_radius"]
    units = {name: find_unit(f"surface.{name}") or "" for name in document.get("surface", {})}

    def draw(columns: int) -> Figure:
        return family_figure(document, radius, columns=columns, units=units)

    return [data, page, *write_formats(out / "families", draw, output.formats, output.columns)]


def _describe_section(start: SectionEnd, end: SectionEnd, parts: Sequence[tuple[PartEnd, PartEnd]]) -> dict[str, Any]:
    """Return the entry of a stable section: its ends, and the parts of it that can be ridden."""
    whole = any(first.motion is start.motion and last.motion is end.motion for first, last in parts)
    return _describe_ends(start, end) | {
        "eigenvalue": [[side.eigenvalue.real, side.eigenvalue.imag] for side in (start, end)],
        "rideable": "wholly" if whole else "partly" if parts else "not",
        "rideable_parts": [_describe_ends(*ends) for ends in parts],
    }


def _describe_ends(*both: SectionEnd | PartEnd) -> dict[str, Any]:
    """Return rear rates, leans, steers and causes of two ends."""
    names = ("rear_rate", "lean", "steer")
    return {name: [getattr(end.motion, name) for end in both] for name in names} | {
        "cause": [end.cause for end in both]
    }
