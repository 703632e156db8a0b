"""The linearised system at Q1 and Q2 (Xiong et al. 2020, section 4.2), compared with the printed eigenvalues."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....reference.stability import VARIABLES, Linearisation
from ..printed import read_printed as printed_figures

SYMBOLS = ("x̃", "ỹ", "θ", "δ", "θ̇", "δ̇", "φ̇r")

# As printed in section 4.2, where both signs of a conjugate pair are printed.
PRINTED = {
    name: tuple(real + (f"±{imaginary}i" if float(imaginary) else "") for real, imaginary in point["eigenvalues"])
    for name, point in printed_figures().items()
    if name in ("Q1", "Q2")
}


@dataclass(frozen=True)
class LinearisedPoint:
    """A named circular motion, the seven variables of its reduced system, and the system.

    Attributes
    ----------
    name : str
        A key of `PRINTED`.
    variables : ndarray, shape (7,)
        In the order of `velodrome.reference.stability.VARIABLES` [m, rad, rad/s].
    system : Linearisation
    """

    name: str
    variables: np.ndarray
    system: Linearisation


def linearisation_document(points: Sequence[LinearisedPoint]) -> dict[str, Any]:
    """Return all points in full precision, as JSON values."""
    return {
        point.name: {
            "variables": list(VARIABLES),
            "point": point.variables.tolist(),
            "jacobian": point.system.jacobian.tolist(),
            "eigenvalues": [[value.real, value.imag] for value in point.system.eigenvalues.tolist()],
            "printed_eigenvalues": list(PRINTED[point.name]),
        }
        for point in points
    }


def linearisation_tables(points: Sequence[LinearisedPoint]) -> str:
    """Write the tables as Markdown: eigenvalues beside the printed ones, then the 7 x 7 matrix to six digits."""
    return "\n".join(line for point in points for line in (*_eigenvalue_table(point), *_jacobian_table(point)))


def _eigenvalue_table(point: LinearisedPoint) -> list[str]:
    place = ", ".join(f"{value:.6g}" for value in point.variables)
    lines = [f"## {point.name}", "", f"v = ({', '.join(SYMBOLS)}) = [{place}]", ""]
    lines += ["| eigenvalue [1/s] | computed | printed | rounds to the print |", "| --- | ---: | ---: | --- |"]
    for k, (value, printed) in enumerate(_pair_eigenvalues(point), start=1):
        verdict = "yes" if _rounds_to(value, printed) else "no"
        lines.append(f"| λ{k} | {_format_eigenvalue(value)} | {printed.replace('-', '−')} | {verdict} |")
    return [*lines, ""]


def _jacobian_table(point: LinearisedPoint) -> list[str]:
    lines = [f"J at {point.name}, row by row the derivatives of d/dt of the variable on the left:", ""]
    lines += ["| | " + " | ".join(SYMBOLS) + " |", "| --- |" + " ---: |" * len(SYMBOLS)]
    largest = np.abs(point.system.jacobian).max()
    for symbol, row in zip(SYMBOLS, point.system.jacobian, strict=True):
        # Round-off of the largest entry counts as zero.
        cells = ("0" if abs(value) < 1e-13 * largest else f"{value:.6g}".replace("-", "−") for value in row)
        lines.append(f"| {symbol} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def _parse_printed(printed: str) -> complex:
    return complex(printed.replace("±", "+").replace("i", "j"))


def _pair_eigenvalues(point: LinearisedPoint) -> list[tuple[complex, str]]:
    """Pair each printed eigenvalue with the nearest computed one; of a conjugate pair, the one above the real axis."""
    rest = [complex(value) for value in point.system.eigenvalues if value.imag >= 0]
    pairs = []
    for printed in PRINTED[point.name]:
        nearest = min(rest, key=lambda value: abs(value - _parse_printed(printed)))
        rest.remove(nearest)
        pairs.append((nearest, printed))
    return pairs


def _format_eigenvalue(value: complex) -> str:
    # The family's zero eigenvalue is computed as round-off of the fastest one.
    real = "0" if abs(value) < 1e-9 else f"{value.real:.8f}"
    return (real + (f" ± {value.imag:.8f}i" if value.imag > 0 else "")).replace("-", "−")


def _rounds_to(value: complex, printed: str) -> bool:
    """Return whether both parts are within half a unit of the last printed digit."""
    digits = len(printed.replace("i", "").partition("±")[0].partition(".")[2])
    off = value - _parse_printed(printed)
    return max(abs(off.real), abs(off.imag)) <= 0.5 * 10**-digits * (1 + 1e-9) or (printed == "0" and abs(value) < 1e-9)
