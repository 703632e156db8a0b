"""The atlas of the benchmark bicycle as files: what `velodrome atlas` writes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ...reference.atlas import ATLAS_SIZE, Atlas, Boundary, compute_atlas, spacing
from ...reference.bicycle import Bicycle
from ...reference.stability import VARIABLES
from ..error import ScenarioError
from ..files import make_folder, write_json
from .families import critical_entry

SMALLEST, LARGEST = 1000, 20_000_000  # motions; the largest takes 3 GB
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
}
_SEEN = ("rear_rate", "front_rate", "yaw_rate", "lean", "steer", "pitch", "radius", "energy", "growth_rate")


def make_atlas(
    out: Path, size: int = ATLAS_SIZE, largest: float = 1.0, progress: Callable[[float], None] = lambda _: None
) -> dict[str, Any]:
    """Compute the atlas and write ``atlas.parquet``, ``boundaries.json`` and the figures into a folder.

    Parameters
    ----------
    out : Path
        Made if need be.
    size : int
        Number of motions, roughly.
    largest : float
        Largest alpha [1/m].
    progress : callable
        Called with the fraction done.

    Returns
    -------
    dict
        The document in ``boundaries.json``.

    Raises
    ------
    ScenarioError
        If the size or the largest alpha is out of range, or the folder cannot be made.
    """
    from ...reports.figures import growth_figure, stable_figure

    if not SMALLEST <= size <= LARGEST:
        raise ScenarioError(f"--size {size}: an atlas has from {SMALLEST} to {LARGEST} motions")
    if not 0 < largest <= 1:
        raise ScenarioError(f"--largest {largest!r}: it must lie above 0 and not above 1, in 1/m")
    make_folder(out)
    alphas, longest = spacing(size, largest)
    found = compute_atlas(Bicycle(), alphas, longest, lambda fraction: progress(0.9 * fraction))
    columns, document = atlas_columns(found), atlas_document(found)
    write_atlas(columns, out / "atlas.parquet", {"longest_step": longest, "bicycle": asdict(found.bicycle)})
    write_json(out / "boundaries.json", document)
    growth_figure(out / "growth.png", columns, document)
    stable_figure(out / "stable.png", columns, document)
    progress(1.0)
    return document


def atlas_columns(found: Atlas) -> dict[str, np.ndarray]:
    """All motions as columns of one length, by rising alpha, then family, then along the curve."""
    counts = [len(curve.samples.lean) for curve in found.curves]
    columns = {
        "alpha": np.repeat([curve.alpha for curve in found.curves], counts),
        "family": np.repeat(np.array([curve.family for curve in found.curves], np.int8), counts),
        "index": np.concatenate([np.arange(count, dtype=np.int32) for count in counts]),
    }
    seen = [curve.samples for curve in found.curves]
    columns |= {name: np.concatenate([getattr(one, name) for one in seen]) for name in _SEEN}
    normal = np.concatenate([one.normal_force for one in seen])
    columns |= {"normal_force_rear": normal[:, 0], "normal_force_front": normal[:, 1]}
    columns |= {name: np.concatenate([getattr(one, name) for one in seen]) for name in ("stable", "physical")}
    eigenvalues = np.concatenate([one.eigenvalues for one in seen])
    for k in range(len(VARIABLES)):
        columns[f"eigenvalue_{k + 1}_re"] = np.real(eigenvalues[:, k])
        columns[f"eigenvalue_{k + 1}_im"] = np.imag(eigenvalues[:, k])
    return columns


def write_atlas(columns: dict[str, np.ndarray], path: Path, facts: dict[str, Any]) -> None:
    """Write columns with their units as Parquet, whole or not at all."""
    # pyarrow, which a circular motion does not need.
    from ...engines.storage import write_columns

    units = {name: "1/s" if name.startswith("eigenvalue") else UNITS.get(name) for name in columns}
    # Neighbours differ in their last bytes only: split, they compress to three quarters.
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


def atlas_document(found: Atlas) -> dict[str, Any]:
    """Boundaries of the stable sections, critical points and what is absent."""
    return {
        "alphas": found.alphas.tolist(),
        "motions": found.size,
        "stable": [_boundary(boundary) for boundary in found.boundaries],
        "touching": [{"families": list(point.families)} | critical_entry(point) for point in found.reconnections],
        "absent": [asdict(absence) for absence in found.absent],
    }


def _boundary(boundary: Boundary) -> dict[str, Any]:
    sides = zip(("start", "end"), zip(*boundary.ends, strict=True), strict=True)
    return {
        "family": boundary.family,
        "alpha": boundary.alpha,
        **{name: dict(_side(list(ends))) for name, ends in sides},
        "vanishing": None if boundary.vanishing is None else critical_entry(boundary.vanishing),
    }


def _side(ends: list[Any]) -> Iterator[tuple[str, list[Any]]]:
    for name in ("rear_rate", "front_rate", "lean", "steer"):
        yield name, [getattr(end.motion, name) for end in ends]
    yield "cause", [end.cause for end in ends]
    yield "eigenvalue", [[end.eigenvalue.real, end.eigenvalue.imag] for end in ends]
