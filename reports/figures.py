"""Figures of solution families, drawn as in Xiong et al. (2020), Figures 2 to 5 and 7."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import numpy as np

COLOURS = {1: "#1f77b4", 2: "#d62728", 3: "#2ca02c", 4: "#9467bd"}
MARKS = {"static": "s", "pivot": "o", "straight": "D", "cusp": "^"}


def family_figure(path: Path, document: Mapping[str, Any], front_radius: float) -> None:
    """Draw lean and steer of all families over the scaled front speed.

    Parameters
    ----------
    path : Path
        File to write, whole or not at all; its ending gives the format.
    document : mapping
        As `velodrome families` gives it.
    front_radius : float
        Radius of the front wheel [m].
    """
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
    for family in document["families"]:
        number, points = family["family"], family["points"]
        speed = _scaled(np.array(points["front_rate"]), front_radius)
        stable = np.array(points["lyapunov_stable"])
        for ax, name in zip(axes, ("lean", "steer"), strict=True):
            values = np.array(points[name])
            ax.plot(speed, values, color=COLOURS[number], lw=1.2, label=f"family {number}")
            ax.plot(speed, np.where(stable, values, np.nan), color=COLOURS[number], lw=4.5, solid_capstyle="round")
            for letter, point in family["special_points"].items():
                if point["kind"] in MARKS and len(letter) == 1:
                    place = (_scaled(np.array(point["front_rate"]), front_radius), point[name])
                    ax.plot(*place, MARKS[point["kind"]], color=COLOURS[number], ms=5)
                    ax.annotate(letter, place, xytext=(4, 4), textcoords="offset points", fontsize=9)
    for ax, label in zip(axes, ("lean θ₀ [rad]", "steer δ₀ [rad]"), strict=True):
        ax.set_xlabel("arctan(|R_f ω_f| / 4 m/s) [rad]")
        ax.set_ylabel(label)
        ax.grid(alpha=0.25)
    axes[0].legend(frameon=False, fontsize=9)
    figure.suptitle(f"circular motions at α = {document['alpha']:g} 1/m; thick: Lyapunov stable")
    partial = path.with_name(f".partial-{path.name}")
    try:
        figure.savefig(partial, dpi=130)
        os.replace(partial, path)
    finally:
        plt.close(figure)
        partial.unlink(missing_ok=True)


def _scaled(front_rate: np.ndarray, radius: float) -> np.ndarray:
    """Front speed as the paper's abscissa: arctan(R |w| / 4)."""
    return np.arctan(radius * np.abs(front_rate) / 4)
