"""Study of a bicycle: its parameters, canonical matrices, and eigenvalues of upright motion over speed."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from ...reference.regularity import require_inertia_upright
from ...reference.upright import (
    CanonicalMatrices,
    StabilityChange,
    canonical_matrices,
    capsize_speed,
    name_modes,
    speed_deviations,
    stability_changes,
    stable_speeds,
    weave_speed,
)
from ..error import ScenarioError
from ..files import DEFAULT_FIGURES, FigureOutput, make_folder, write_json, write_text
from ..run import library_versions
from ..scenario import PARAMETERS, BicycleFile


@dataclass(frozen=True)
class BicycleStudy:
    """Results of the linearised equations of upright straight motion for a bicycle.

    Attributes
    ----------
    source : BicycleFile
        The bicycle, with the standard deviations of its parameters.
    matrices : CanonicalMatrices
    speeds : ndarray, shape (n,)
        Forward speeds [m/s].
    eigenvalues : ndarray, shape (n, 4), complex
        Eigenvalues, sorted by real part, then imaginary part [1/s].
    followed : ndarray, shape (n, 4), complex
        The same eigenvalues, with one column for each mode in ``modes`` [1/s].
    modes : tuple of str
    weave_speed, capsize_speed : float or None
        [m/s].
    deviations : dict
        Standard deviations of both speeds from those of the parameters [m/s]; empty if the parameters have none.
    changes : list of StabilityChange
        Every speed at which a mode becomes stable or unstable.
    stable_speeds : list of (float, float)
        Ranges of speed with all real parts negative [m/s]; the last may end at infinity.
    """

    source: BicycleFile
    matrices: CanonicalMatrices
    speeds: np.ndarray
    eigenvalues: np.ndarray
    followed: np.ndarray
    modes: tuple[str, ...]
    weave_speed: float | None
    capsize_speed: float | None
    deviations: dict[str, float | None]
    changes: list[StabilityChange]
    stable_speeds: list[tuple[float, float]]

    def as_json(self) -> dict[str, Any]:
        """Return the JSON document of `velodrome bicycle`; the end of an unlimited range is null."""
        m = self.matrices
        return {
            "name": self.source.name,
            "convention": self.source.convention,
            "parameters": asdict(self.source.bicycle),
            "uncertainties": self.source.uncertainties,
            "ignored": list(self.source.ignored),
            "warnings": list(self.source.bicycle.warnings()),
            "canonical": {name: getattr(m, name).tolist() for name in ("M", "C1", "K0", "K2")},
            "steer_damping": m.steer_damping,
            "speeds": self.speeds.tolist(),
            "eigenvalues": _split_complex(self.eigenvalues),
            "modes": {"names": list(self.modes), "eigenvalues": _split_complex(self.followed)},
            "weave_speed": self.weave_speed,
            "capsize_speed": self.capsize_speed,
            "speed_deviations": self.deviations,
            "stability_changes": [asdict(change) for change in self.changes],
            "stable_speeds": [[start, None if end == inf else end] for start, end in self.stable_speeds],
        }


def _split_complex(values: np.ndarray) -> list[list[list[float]]]:
    return [[[value.real, value.imag] for value in row] for row in values.tolist()]


def study_bicycle(source: BicycleFile, speeds: np.ndarray, steer_damping: float = 0.0) -> BicycleStudy:
    """Compute a bicycle's canonical matrices, its eigenvalues over speed, and where its stability changes.

    Parameters
    ----------
    source : BicycleFile
    speeds : ndarray, shape (n,)
        Not negative [m/s].
    steer_damping : float
        Not negative [N m s/rad].

    Returns
    -------
    BicycleStudy

    Raises
    ------
    ScenarioError
        If the equations of lean and steer are singular; it names the motion without inertia.
    """
    matrices = canonical_matrices(source.bicycle, steer_damping)
    try:
        require_inertia_upright(source.bicycle)
        eigenvalues = matrices.eigenvalues(speeds)
        followed, modes = name_modes(matrices, speeds)
    except ValueError as error:
        raise ScenarioError(f"bicycle {source.name}: {error}") from error
    return BicycleStudy(
        source=source,
        matrices=matrices,
        speeds=speeds,
        eigenvalues=eigenvalues,
        followed=followed,
        modes=tuple(str(mode) for mode in modes),
        weave_speed=weave_speed(matrices),
        capsize_speed=capsize_speed(matrices),
        deviations=speed_deviations(source.bicycle, source.uncertainties, steer_damping)
        if source.uncertainties
        else {},
        changes=stability_changes(matrices),
        stable_speeds=stable_speeds(matrices),
    )


def write_bicycle(study: BicycleStudy, out: Path, output: FigureOutput = DEFAULT_FIGURES) -> list[Path]:
    """Write the document, the page and the figure of a study into a folder, and return their paths."""
    # Imported here, since the document needs neither matplotlib nor jinja.
    from ...reports.figures import eigenvalue_figure, write_formats
    from ...reports.page import make_bicycle_page

    make_folder(out)
    document, page = out / "bicycle.json", out / "bicycle.html"
    write_json(document, study.as_json())
    units = {name: parameter.unit for name, parameter in PARAMETERS.items()}
    write_text(page, make_bicycle_page(study.as_json(), units, library_versions()))
    shown = study.source.name, study.speeds, study.followed, study.modes, study.stable_speeds
    draw = partial(eigenvalue_figure, *shown)
    return [document, page, *write_formats(out / "eigenvalues", draw, output.formats, output.columns)]
