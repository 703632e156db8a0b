"""The files of the atlas of a bicycle, which `velodrome atlas` writes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...reference.atlas import ATLAS_SIZE, SIDES, Atlas, Boundary, compute_atlas, spacing
from ...reference.bicycle import Bicycle
from ...reference.bifurcations.bautin import BautinPoint
from ...reference.bifurcations.hopf import HopfPoint
from ...reference.families import trace
from ...reference.rideability import OBSTACLES
from ...reference.sections import SectionEnd, stable_sections
from ...reference.stability import VARIABLES
from ...reference.surface import Paraboloid
from ..error import MissingMotionError, ScenarioError
from ..files import DEFAULT_FIGURES, FigureOutput, make_folder, write_json, write_text
from ..scenario import BicycleFile, name_bicycle
from .bounds import BoundedSection, bound_stable_sections
from .families import check_inertia, critical_entry

BoundedShape = tuple[float, BoundedSection]  # alpha [1/m], and the stable section of a boundary there

SMALLEST, LARGEST = 1000, 20_000_000  # number of motions; the largest atlas takes 3 GB
UNITS = {
    "alpha": "1/m",
    "rear_rate": "rad/s",
    "front_rate": "rad/s",
    "yaw_rate": "rad/s",
    "lean": "rad",
    "steer": "rad",
    "pitch": "rad",
    "radius": "m",
    "energy": "J",
    "normal_force_rear": "N",
    "normal_force_front": "N",
    "growth_rate": "1/s",
    "required_friction": "1",
}
_SHAPES = 16  # bowls of a stable region in which orbits are searched for, five seconds each
_PLACE = ("rear_rate", "front_rate", "lean", "steer")
_NO_HOPF = {
    "energy": "a real eigenvalue is zero, as the energy is extreme along the family",
    "end": "the family ends there, and no eigenvalue is zero or imaginary",
}
_SAMPLED = ("rear_rate", "front_rate", "yaw_rate", "lean", "steer", "pitch", "radius", "energy", "growth_rate")


def make_atlas(
    source: BicycleFile,
    out: Path,
    libraries: Mapping[str, str],
    size: int = ATLAS_SIZE,
    largest: float = 1.0,
    progress: Callable[[float], None] = lambda _: None,
    figures: FigureOutput = DEFAULT_FIGURES,
    within: bool = False,
) -> dict[str, Any]:
    """Compute the atlas and write ``atlas.parquet``, ``boundaries.json``, the page and the figures into a folder.

    Parameters
    ----------
    source : BicycleFile
        The bicycle.
    out : Path
        The folder, which is made if it does not exist.
    libraries : mapping of str to str
        Versions by name, which the page states.
    size : int
        Approximate number of motions.
    largest : float
        Largest alpha [1/m].
    progress : callable
        Called with the fraction done.
    figures : FigureOutput
        How the figures are written.
    within : bool
        Search for the orbits that bound stable circles, in some bowls, and draw them too; this takes minutes.

    Returns
    -------
    dict
        The document in ``boundaries.json``.

    Raises
    ------
    MissingMotionError
        If the bicycle has none of the families.
    ScenarioError
        If the size or the largest alpha is out of range, the bicycle's equations are singular, or the folder cannot be
        made.
    """
    from ...reports.figures import growth_figure, list_bounded_regions, stable_figure, within_figure, write_formats
    from ...reports.page import make_atlas_page

    if not SMALLEST <= size <= LARGEST:
        raise ScenarioError(f"--size {size}: an atlas has from {SMALLEST} to {LARGEST} motions")
    if not 0 < largest <= 1:
        raise ScenarioError(f"--largest {largest!r}: it must lie above 0 and not above 1, in 1/m")
    check_inertia(source.bicycle)
    make_folder(out)
    alphas, longest = spacing(size, largest)
    try:
        share = 0.2 if within else 0.9
        found = compute_atlas(source.bicycle, alphas, longest, lambda fraction: progress(share * fraction))
    except ValueError as error:
        raise MissingMotionError(f"no atlas of {source.name}: {error}", "no-such-motion") from error
    bounds = bound_regions(found, lambda fraction: progress(0.2 + 0.7 * fraction)) if within else None
    columns, document = atlas_columns(found), atlas_document(found, source.name, bounds)
    # Bit k of the column `obstacles` says whether a motion meets obstacle k.
    facts = {"longest_step": longest, "bicycle": asdict(found.bicycle), "obstacles": list(OBSTACLES)}
    write_atlas(columns, out / "atlas.parquet", facts)
    write_json(out / "boundaries.json", document)
    write_text(out / "atlas.html", make_atlas_page(document, libraries))
    for name, draw in (("growth", growth_figure), ("stable", stable_figure)):
        write_formats(out / name, partial(draw, columns, document), figures.formats, figures.columns)
    if list_bounded_regions(document):
        write_formats(out / "within", partial(within_figure, document), figures.formats, figures.columns)
    progress(1.0)
    return document


def atlas_columns(found: Atlas) -> dict[str, np.ndarray]:
    """Return all motions as columns of one length, sorted by alpha, family and position along the curve."""
    counts = [len(curve.samples.lean) for curve in found.curves]
    columns = {
        "alpha": np.repeat([curve.alpha for curve in found.curves], counts),
        "family": np.repeat(np.array([curve.family for curve in found.curves], np.int8), counts),
        "index": np.concatenate([np.arange(count, dtype=np.int32) for count in counts]),
    }
    samples = [curve.samples for curve in found.curves]
    columns |= {name: np.concatenate([getattr(curve, name) for curve in samples]) for name in _SAMPLED}
    normal = np.concatenate([curve.normal_force for curve in samples])
    columns |= {"normal_force_rear": normal[:, 0], "normal_force_front": normal[:, 1]}
    columns["stable"] = np.concatenate([curve.stable for curve in samples])
    rideability = [curve.rideability for curve in found.curves]
    columns["physical"] = np.concatenate([motions.physical for motions in rideability])
    columns["obstacles"] = np.concatenate([motions.codes for motions in rideability])
    columns["required_friction"] = np.concatenate([motions.friction.max(axis=1) for motions in rideability])
    eigenvalues = np.concatenate([curve.eigenvalues for curve in samples])
    for k in range(len(VARIABLES)):
        columns[f"eigenvalue_{k + 1}_re"] = np.real(eigenvalues[:, k])
        columns[f"eigenvalue_{k + 1}_im"] = np.imag(eigenvalues[:, k])
    return columns


def write_atlas(columns: dict[str, np.ndarray], path: Path, facts: dict[str, Any]) -> None:
    """Write columns with their units as Parquet, whole or not at all."""
    # Imported here, since other functions about circular motions do not need pyarrow.
    from ...engines.storage import write_columns

    units = {name: "1/s" if name.startswith("eigenvalue") else UNITS.get(name) for name in columns}
    # Neighbouring values differ in their last bytes only; split by bytes, the columns compress to three quarters.
    repeated = ["alpha", "family"]
    split = [name for name, values in columns.items() if values.dtype == float and name not in repeated]
    write_columns(
        ((name, values, units[name]) for name, values in columns.items()),
        path,
        facts,
        use_dictionary=repeated,
        use_byte_stream_split=split,
        compression="zstd",
    )


def bound_regions(found: Atlas, progress: Callable[[float], None] = lambda _: None) -> list[list[BoundedShape]]:
    """Find the orbits that bound the stable circles of an atlas, in some bowls of each of its stable regions.

    Parameters
    ----------
    found : Atlas
    progress : callable
        Called with the fraction done.

    Returns
    -------
    list of list of BoundedShape
        For each of its boundaries, by rising alpha; the plane, on which no orbits are known, is left out.
    """
    chosen = [_choose_shapes(boundary, found.alphas) for boundary in found.boundaries]
    count, done = sum(map(len, chosen)), 0
    bounds: list[list[BoundedShape]] = []
    for boundary, places in zip(found.boundaries, chosen, strict=True):
        bounds.append([])
        for place in places:
            bounds[-1].append((boundary.alpha[place], _bound_shape(found.bicycle, boundary, place)))
            done += 1
            progress(done / count)
    return bounds


def _choose_shapes(boundary: Boundary, alphas: np.ndarray) -> list[int]:
    """Choose the indices of some bowls of a boundary, evenly, of those that have all the motions of an atlas."""
    whole = [k for k, alpha in enumerate(boundary.alpha) if alpha > 0 and alpha in alphas]
    count = min(_SHAPES, len(whole))
    return [whole[k] for k in np.linspace(0, len(whole) - 1, count).round().astype(int)] if count else []


def _bound_shape(bicycle: Bicycle, boundary: Boundary, place: int) -> BoundedSection:
    """Find the orbits that bound the circles of a boundary's stable section at one of its shapes."""
    family = trace(bicycle, Paraboloid(boundary.alpha[place]), boundary.family)
    start = boundary.ends[place][0].motion
    section = min(stable_sections(family), key=lambda ends: abs(ends[0].motion.lean - start.lean))
    return bound_stable_sections(family, [section])[0]


def atlas_document(
    found: Atlas, bicycle_name: str | None = None, bounds: Sequence[Sequence[BoundedShape]] | None = None
) -> dict[str, Any]:
    """Return the document of the atlas: boundaries of the stable sections, critical points and absent families.

    Parameters
    ----------
    found : Atlas
    bicycle_name : str, optional
        See `name_bicycle`.
    bounds : sequence, optional
        As `bound_regions` returns it.

    Returns
    -------
    dict
    """
    rows: list[Any] = [None] * len(found.boundaries)
    if bounds is not None:
        rows = [[{"alpha": alpha} | section.as_json() for alpha, section in shapes] for shapes in bounds]
    return {
        **name_bicycle(found.bicycle, bicycle_name),
        "alphas": found.alphas.tolist(),
        "motions": found.size,
        "stable": [
            _describe_boundary(boundary) | {"within": row} for boundary, row in zip(found.boundaries, rows, strict=True)
        ],
        "touching": [{"families": list(point.families)} | critical_entry(point) for point in found.reconnections],
        "absent": [asdict(absence) for absence in found.absent],
    }


def _describe_boundary(boundary: Boundary) -> dict[str, Any]:
    ends, points = (zip(*both, strict=True) for both in (boundary.ends, boundary.hopf))
    return {
        "family": boundary.family,
        "alpha": boundary.alpha,
        **{name: _describe_side(*side) for name, *side in zip(SIDES, ends, points, strict=True)},
        "bautin": [{"side": side} | _describe_bautin(point) for side, point in boundary.bautin],
        "vanishing": None if boundary.vanishing is None else critical_entry(boundary.vanishing),
    }


def _describe_side(ends: Sequence[SectionEnd], points: Sequence[HopfPoint | None]) -> dict[str, list[Any]]:
    """Return one side of a stable region over alpha, as lists of equal length."""
    hopf = ("criticality", "first_lyapunov_coefficient", "amplitude_slope", "amplitude_slope_error")
    return {
        **{name: [getattr(end.motion, name) for end in ends] for name in _PLACE},
        "cause": [end.cause for end in ends],
        "eigenvalue": [[end.eigenvalue.real, end.eigenvalue.imag] for end in ends],
        **{name: [None if point is None else getattr(point, name) for point in points] for name in hopf},
        "undefined_because": [
            _NO_HOPF[end.cause] if point is None else point.why_undefined
            for end, point in zip(ends, points, strict=True)
        ],
    }


def _describe_bautin(found: BautinPoint) -> dict[str, Any]:
    """Return the entry of a degenerate Hopf point."""
    point = found.point
    return {
        "alpha": found.alpha,
        **{name: getattr(point.motion, name) for name in _PLACE},
        "energy": point.energy,
        "frequency": point.frequency,
    }
