"""Solution families of the benchmark bicycle as data: what `velodrome families` gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from reference.bicycle import Bicycle
from reference.contact import observe
from reference.critical import CriticalPoint, last_stable, reconnections
from reference.families import FAMILIES, Family, trace
from reference.sections import SectionEnd, modes, stable_sections
from reference.special import special_points
from reference.stability import growth_rate
from reference.surface import Paraboloid

from .error import ScenarioError
from .runner import write_json

LONGEST_STEP = 0.05  # of the arc: some 100 to 300 points a family, no stable section known is shorter than three


def families_document(alpha: float) -> dict[str, Any]:
    """Follow all four families at alpha, with special points and stable sections.

    Parameters
    ----------
    alpha : float
        Shape of the paraboloid [1/m].

    Returns
    -------
    dict
        The JSON document of `velodrome families`; ``absent`` says why a family has no curve there.

    Raises
    ------
    ScenarioError
        If alpha is no shape.
    """
    bicycle, families, absent = Bicycle(), [], {}
    try:
        surface = Paraboloid(alpha)
    except ValueError as error:
        raise ScenarioError(str(error)) from error
    for number in FAMILIES:
        try:
            families.append(_family(trace(bicycle, surface, number, LONGEST_STEP)))
        except ValueError as error:
            absent[str(number)] = str(error)
    return {"alpha": alpha, "families": families, "absent": absent}


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
        stable[str(number)] = None if point is None else _critical(point)
    collision = next(point for point in merging if point.families == (2, 4))
    return {
        "cusp_collision": _critical(collision),
        "last_stable": stable,
        "merging": [{"families": list(point.families)} | _critical(point) for point in merging],
    }


def _critical(point: CriticalPoint) -> dict[str, Any]:
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
    from reports.figures import family_figure

    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ScenarioError(f"--out {out}: the folder cannot be made: {error.strerror}") from error
    write_json(out / "families.json", document)
    family_figure(out / "families.png", document, Bicycle().front_wheel_radius)


def _family(family: Family) -> dict[str, Any]:
    return {
        "family": family.number,
        "ends": list(family.ends),
        "points": _points(family),
        "stable_sections": [_section(*ends) for ends in stable_sections(family)],
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
    equations = family.equations
    motions = [equations.motion(point.unknowns) for point in family.points]
    states = [motion.state() for motion in motions]
    seen = observe(
        equations.bicycle, equations.surface, np.array([q for q, _ in states]), np.array([qd for _, qd in states])
    )
    normal = np.einsum("nwi,nwi->nw", np.array([motion.force for motion in motions]), seen.normal)
    values = modes(family)
    growth = [float(growth_rate(equations.surface, row, m.yaw_rate)) for row, m in zip(values, motions, strict=True)]
    names = ("rear_rate", "front_rate", "yaw_rate", "lean", "steer", "pitch")
    return {
        **{name: [getattr(motion, name) for motion in motions] for name in names},
        "radius": [float(np.hypot(*motion.position[:2])) for motion in motions],
        "energy": (seen.kinetic_energy + seen.potential_energy).tolist(),
        "lyapunov_stable": [bool(rate < 0) for rate in growth],
        "growth_rate": growth,
        "normal_force_rear": normal[:, 0].tolist(),
        "normal_force_front": normal[:, 1].tolist(),
        "eigenvalues": [[[value.real, value.imag] for value in row] for row in values],
    }


def _section(start: SectionEnd, end: SectionEnd) -> dict[str, Any]:
    both = (start, end)
    names = ("rear_rate", "lean", "steer")
    return {name: [getattr(one.motion, name) for one in both] for name in names} | {
        "cause": [one.cause for one in both],
        "eigenvalue": [[one.eigenvalue.real, one.eigenvalue.imag] for one in both],
    }
