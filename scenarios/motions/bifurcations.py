"""Hopf points of the solution families and the periodic orbits born there, with their document."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from ...reference.bicycle import Bicycle
from ...reference.bifurcations.hopf import HopfPoint, find_hopf_points
from ...reference.bifurcations.orbit_branch import OrbitBranch
from ...reference.bifurcations.orbit_events import OrbitEvent, find_events
from ...reference.bifurcations.orbit_search import find_largest_orbit, orbits_of_amplitude
from ...reference.bifurcations.orbit_track import OrbitTrack, track_orbit
from ...reference.bifurcations.orbits import PeriodicOrbit
from ...reference.bifurcations.ridden import explain_orbit
from ...reference.bifurcations.small_orbits import flow_near
from ...reference.bifurcations.stable_within import follow_branch
from ...reference.families import Family, trace_all
from ...reference.rideability import explain_motion
from ...reference.sections import stable_sections
from ...reference.surface import SurfaceOfRevolution
from ..error import ScenarioError
from ..files import DEFAULT_FIGURES, FigureOutput, make_folder, write_json
from ..scenario import name_bicycle, name_surface
from .bounds import BoundedSection, bound_stable_section
from .families import check_inertia

# Lean amplitudes of the orbits that are listed [rad]; a smaller branch has its largest orbit listed too.
LISTED_AMPLITUDES = (0.001, 0.005, 0.02)


@dataclass(frozen=True, kw_only=True, eq=False)
class ListedOrbit:
    """A periodic orbit with the reasons why it cannot be ridden, none if it can, and its wheel tracks."""

    orbit: PeriodicOrbit
    unphysical_because: tuple[str, ...]
    track: OrbitTrack | None

    def as_json(self) -> dict[str, Any]:
        """Return this orbit's part of the document."""
        track = self.track
        return {
            **_describe_orbit(self.orbit),
            "state": self.orbit.state.tolist(),
            "physical": not self.unphysical_because,
            "unphysical_because": list(self.unphysical_because),
            "yaw_advance": None if track is None else track.yaw_advance,
            "track": None if track is None else {"rear": track.rear.tolist(), "front": track.front.tolist()},
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Bifurcation:
    """A Hopf point and the branch of periodic orbits born there.

    Attributes
    ----------
    point : HopfPoint
    unphysical_because : tuple of str
        Why the circular motion cannot be ridden, none if it can.
    orbits : tuple of ListedOrbit
        Those of the `LISTED_AMPLITUDES` along the branch and, if all are smaller than the last, its largest.
    events : tuple of OrbitEvent
        Bifurcations of the orbits along the branch.
    branch : OrbitBranch or None
        The followed part of the branch.
    why_no_orbits : str or None
        Why no orbits are known.
    """

    point: HopfPoint
    unphysical_because: tuple[str, ...]
    orbits: tuple[ListedOrbit, ...] = ()
    events: tuple[OrbitEvent, ...] = ()
    branch: OrbitBranch | None = None
    why_no_orbits: str | None = None

    def as_json(self) -> dict[str, Any]:
        """Return this Hopf point's part of the document."""
        point, motion = self.point, self.point.motion
        return {
            "family": point.numbers[0] if point.numbers else None,
            **{name: getattr(motion, name) for name in ("rear_rate", "front_rate", "lean", "steer")},
            "energy": point.energy,
            "frequency": point.frequency,
            "ends_stable_section": point.ends_section,
            "physical": not self.unphysical_because,
            "unphysical_because": list(self.unphysical_because),
            "criticality": point.criticality,
            "first_lyapunov_coefficient": point.first_lyapunov_coefficient,
            "amplitude_slope": point.amplitude_slope,
            "amplitude_slope_error": point.amplitude_slope_error,
            "undefined_because": point.why_undefined,
            "orbits": [orbit.as_json() for orbit in self.orbits],
            "orbit_bifurcations": [{"kind": event.kind, **_describe_orbit(event.orbit)} for event in self.events],
            "branch": None if self.branch is None else _list_branch(self.branch, self.events),
            "branch_end": None if self.branch is None else self.branch.end,
            "no_orbits_because": self.why_no_orbits,
        }


def _list_branch(branch: OrbitBranch, events: Sequence[OrbitEvent]) -> dict[str, list[float]]:
    """Return the quantities along a branch as lists of equal length, its bifurcations in their places."""
    places = [*enumerate(branch.orbits), *((event.place + 0.5, event.orbit) for event in events)]
    orbits = [orbit for _, orbit in sorted(places, key=lambda pair: pair[0])]
    return {
        "lean_amplitude": [orbit.lean_amplitude for orbit in orbits],
        "energy": [orbit.energy for orbit in orbits],
        "period": [orbit.period for orbit in orbits],
        "largest_multiplier": [orbit.growth for orbit in orbits],
    }


def _describe_orbit(orbit: PeriodicOrbit) -> dict[str, Any]:
    return {
        "lean_amplitude": orbit.lean_amplitude,
        "energy": orbit.energy,
        "period": orbit.period,
        "multipliers": [[value.real, value.imag] for value in orbit.multipliers.tolist()],
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class Bifurcations:
    """The Hopf points of one bicycle on one ground.

    Attributes
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    found : tuple of Bifurcation
        Those at ends of stable sections first, then by family.
    sections : tuple of BoundedSection
        The stable sections.
    absent : dict
        By number of a family that has no curve on this ground: the reason.
    """

    bicycle: Bicycle
    surface: SurfaceOfRevolution
    found: tuple[Bifurcation, ...]
    sections: tuple[BoundedSection, ...] = ()
    absent: dict[int, str] = field(default_factory=dict)

    def as_json(self, bicycle_name: str | None = None) -> dict[str, Any]:
        """Return the JSON document of `velodrome bifurcations`; see `name_bicycle` for the name."""
        return {
            **name_surface(self.surface),
            **name_bicycle(self.bicycle, bicycle_name),
            "hopf": [one.as_json() for one in self.found],
            "stable_sections": [
                {"family": section.numbers[0] if section.numbers else None, **section.as_json()}
                for section in self.sections
            ],
            "absent": {str(number): reason for number, reason in self.absent.items()},
        }


def find_bifurcations(
    bicycle: Bicycle,
    surface: SurfaceOfRevolution,
    number: int | None = None,
    watch: Callable[[int, int], None] = lambda *_: None,
) -> Bifurcations:
    """Find the Hopf points of the circular motions on a ground, and follow the periodic orbits born there.

    Parameters
    ----------
    bicycle : Bicycle
    surface : SurfaceOfRevolution
    number : int, optional
        Of a family, 1 to 4: only curves with this number.
    watch : callable
        Called with the number of Hopf points that have been examined, and that of all.

    Returns
    -------
    Bifurcations

    Raises
    ------
    ScenarioError
        If the bicycle's equations of motion are singular, or the family has no curve on this ground.
    """
    check_inertia(bicycle)
    curves, absent = trace_all(bicycle, surface)
    if number is not None:
        curves = [curve for curve in curves if number in curve.numbers]
        if not curves:
            raise ScenarioError(f"family {number} has no curve there: {absent.get(number, 'it has joined none')}")
    points = [(curve, point) for curve in curves for point in find_hopf_points(curve)]
    points.sort(key=lambda pair: not pair[1].ends_section)  # stable: by family within both
    found: list[Bifurcation] = []
    branches: dict[int, list[OrbitBranch]] = {}
    for curve, point in points:
        watch(len(found), len(points))
        found.append(_examine(curve, point))
        if found[-1].branch is not None and point.ends_section:
            branches.setdefault(curves.index(curve), []).append(found[-1].branch)
    sections = [
        bound_stable_section(curve, section, branches.get(k, []), "no orbits are known at the ends of stable sections")
        for k, curve in enumerate(curves)
        for section in stable_sections(curve)
    ]
    return Bifurcations(bicycle=bicycle, surface=surface, found=tuple(found), sections=tuple(sections), absent=absent)


def _examine(curve: Family, point: HopfPoint) -> Bifurcation:
    """Follow the orbits born at a Hopf point."""
    why = explain_motion(curve.equations.bicycle, curve.equations.surface, point.motion)
    found = Bifurcation(point=point, unphysical_because=why)
    try:
        # Orbits that may bound stable circles are followed further than those of circles that are unstable anyway.
        branch = follow_branch(point) if point.ends_section else follow_branch(point, LISTED_AMPLITUDES[-1])
    except ValueError as error:
        return replace(found, why_no_orbits=str(error))
    flow = flow_near(point)
    orbits = [
        ListedOrbit(orbit=orbit, unphysical_because=explain_orbit(flow, orbit), track=track_orbit(flow, orbit))
        for orbit in _list_orbits(branch)
    ]
    return replace(found, orbits=tuple(orbits), events=tuple(find_events(branch)), branch=branch)


def _list_orbits(branch: OrbitBranch) -> Sequence[PeriodicOrbit]:
    """Return the orbits of a branch that are listed, in order of amplitude and then along the branch."""
    listed = [orbit for size in LISTED_AMPLITUDES for orbit in orbits_of_amplitude(branch, size)]
    largest = find_largest_orbit(branch)
    return listed if largest.lean_amplitude >= LISTED_AMPLITUDES[-1] else [*listed, largest]


def write_bifurcations(document: Mapping[str, Any], out: Path, output: FigureOutput = DEFAULT_FIGURES) -> list[Path]:
    """Write the document and its figures into a folder, which is made if it does not exist.

    Parameters
    ----------
    document : mapping
        As `Bifurcations.as_json` returns it.
    out : Path
    output : FigureOutput
        How the figures are written.

    Returns
    -------
    list of Path
        What is written; without stable circles there is no figure of branches, and without orbits none of tracks.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    from ...reports.figures import (
        bifurcation_figure,
        drawn_orbits,
        drawn_sections,
        orbit_track_figure,
        write_formats,
    )

    make_folder(out)
    path = out / "bifurcations.json"
    write_json(path, document)
    written = [path]
    for name, drawn, draw in (
        ("bifurcations", drawn_sections(document), bifurcation_figure),
        ("orbit-tracks", drawn_orbits(document), orbit_track_figure),
    ):
        if drawn:
            written += write_formats(out / name, partial(draw, document), output.formats, output.columns)
    return written
