"""Solution families of the benchmark bicycle as data: what `velodrome families` gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.critical import CriticalPoint, last_stable, reconnections
from ...reference.families import FAMILIES, Family, trace_all
from ...reference.modes import MODES, follow_modes
from ...reference.sections import SectionEnd, sample_family, stable_sections
from ...reference.special import special_points
from ...reference.standing import motion_stands, stands
from ...reference.surface import Surface
from ..files import make_folder, write_json
from ..scenario import make_bowl, name_surface

LONGEST_DRAWN_STEP = 0.05  # of the arc: some 100 to 300 points a family, no stable section known is shorter than three


def families_document(ground: Surface | float) -> dict[str, Any]:
    """Follow every curve of the four families on a ground, with special points and stable sections.

    Parameters
    ----------
    ground : Surface or float
        A surface of revolution, or the alpha of a paraboloid [1/m].

    Returns
    -------
    dict
        The JSON document of `velodrome families`: the families by number, then further curves under the number
        of the family that each was a part of; ``absent`` says why a family has no curve there.

    Raises
    ------
    ScenarioError
        If it is none.
    """
    surface = make_bowl(ground)
    curves, absent = trace_all(Bicycle(), surface, LONGEST_DRAWN_STEP)
    families = [family_document(curve) for curve in curves]
    return {
        **name_surface(surface),
        "modes": list(MODES),  # what the columns of eigenvalues are
        "families": families,
        "absent": {str(number): reason for number, reason in absent.items()},
    }


def critical_document(watch: Callable[[str, float, float], None]) -> dict[str, Any]:
    """Compute the critical alpha of the benchmark bicycle.

    Parameters
    ----------
    watch : callable
        Called with what is looked for, the alpha reached and the largest.

    Returns
    -------
    dict
        The JSON document of `velodrome critical`.
    """
    bicycle = Bicycle()
    merging = reconnections(bicycle, lambda alpha: watch("merging", alpha, 1.0))
    stable: dict[str, Any] = {}
    for number in FAMILIES:
        watch("last stable", float(number), float(len(FAMILIES)))
        point = last_stable(bicycle, number)
        stable[str(number)] = None if point is None else critical_entry(point)
    collision = next(point for point in merging if point.families == (2, 4))
    return {
        "cusp_collision": critical_entry(collision),
        "last_stable": stable,
        "merging": [{"families": list(point.families)} | critical_entry(point) for point in merging],
    }


def critical_entry(point: CriticalPoint) -> dict[str, Any]:
    """A critical point as it stands in documents."""
    motion = point.motion
    return {
        "alpha": point.alpha,
        "rear_rate": motion.rear_rate,
        "front_rate": motion.front_rate,
        "lean": motion.lean,
        "steer": motion.steer,
        "kind": point.kind,
        "residual": point.residual,
    }


def write_families(document: Mapping[str, Any], out: Path) -> None:
    """Write the document and its figure into a folder, which is made if need be.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    from ...reports.figures import family_figure

    make_folder(out)
    write_json(out / "families.json", document)
    family_figure(out / "families.png", document, Bicycle().front_wheel_radius)


def family_document(family: Family) -> dict[str, Any]:
    """One family's part of the document of `velodrome families`."""
    return {
        "family": family.number,
        "ends": list(family.ends),
        "points": _points(family),
        "stable_sections": [_section(*ends) for ends in stable_sections(family) if _standing(family, ends)],
        "special_points": {
            point.name: {
                "rear_rate": point.rear_rate,
                "front_rate": point.front_rate,
                "lean": point.lean,
                "steer": point.steer,
                "kind": point.kind,
            }
            for point in special_points(family)
        },
    }


def _points(family: Family) -> dict[str, list[Any]]:
    """Quantities along the curve, equal-length lists."""
    seen = sample_family(family)
    names = ("rear_rate", "front_rate", "yaw_rate", "lean", "steer", "pitch", "radius", "energy")
    values = follow_modes(family)
    return {
        **{name: getattr(seen, name).tolist() for name in names},
        "lyapunov_stable": seen.stable.tolist(),
        "rims_clear": [stands(family.equations, point.unknowns) for point in family.points],
        "growth_rate": seen.growth_rate.tolist(),
        "normal_force_rear": seen.normal_force[:, 0].tolist(),
        "normal_force_front": seen.normal_force[:, 1].tolist(),
        "eigenvalues": np.stack([np.real(values), np.imag(values)], axis=-1).tolist(),
    }


def _standing(family: Family, ends: tuple[SectionEnd, SectionEnd]) -> bool:
    """Whether wheels can stand somewhere at the ends of a section."""
    where = family.equations.bicycle, family.equations.surface
    return any(motion_stands(*where, end.motion) for end in ends)


def _section(start: SectionEnd, end: SectionEnd) -> dict[str, Any]:
    both = (start, end)
    names = ("rear_rate", "lean", "steer")
    return {name: [getattr(one.motion, name) for one in both] for name in names} | {
        "cause": [one.cause for one in both],
        "eigenvalue": [[one.eigenvalue.real, one.eigenvalue.imag] for one in both],
    }
