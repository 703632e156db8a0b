"""What a reader must know before trusting the figures of a run, in one line for each kind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ..measure import describe_mismatch
from .summary import is_whole_ride


@dataclass(frozen=True)
class Remark:
    """A remark on an engine's row.

    Attributes
    ----------
    about : str
        What it is, in the same words for every engine.
    detail : str
        How much or when, for this engine; may be empty.
    """

    about: str
    detail: str = ""


def make_remarks(name: str, metrics: Mapping[str, Any], duration: float) -> list[str]:
    """List the remarks on one engine's row, one line each.

    Parameters
    ----------
    name : str
    metrics : mapping
    duration : float
        Duration of the run [s].

    Returns
    -------
    list of str
    """
    return group_remarks({name: metrics}, duration)


def group_remarks(measured: Mapping[str, Mapping[str, Any]], duration: float) -> list[str]:
    """List the remarks on a run, in one line those that say the same of several engines.

    Parameters
    ----------
    measured : mapping
        Metrics by engine, in the order in which engines are named.
    duration : float
        Duration of the run [s].

    Returns
    -------
    list of str
        The falls first.
    """
    found: dict[str, list[str]] = {}
    for name, metrics in measured.items():
        for remark in find_remarks(metrics, duration):
            found.setdefault(remark.about, []).append(f"{name} {remark.detail}".rstrip())
    lines = [f"{about}: {', '.join(engines)}" for about, engines in found.items()]
    return sorted(lines, key=lambda line: not line.startswith(_FELL))


_FELL = "fell, figures are those up to there"


def find_remarks(metrics: Mapping[str, Any], duration: float) -> Iterator[Remark]:
    """Yield what a reader must know before trusting an engine's row."""
    if metrics["fell_at"] is not None:
        yield Remark(_FELL, f"at {metrics['fell_at']:.2f} s")
    if metrics["friction_left_at"] is not None:
        needed = metrics["required_friction"]
        need = "no coefficient is enough" if needed is None else f"needs up to {needed:.3g}"
        yield Remark(
            "contacts with too little friction to roll",
            f"from {metrics['friction_left_at']:.2f} s on ({need}, has {metrics['friction']:.3g})",
        )
    if metrics["min_normal_force"] is not None and metrics["min_normal_force"] < 0:
        yield Remark(
            "contact would be lost, since the ground would have to pull a wheel",
            f"by up to {-metrics['min_normal_force']:.3g} N",
        )
    if metrics["ended"] is not None:
        yield Remark("ended early", f"({metrics['ended']})")
    if _equals_reference(metrics):
        yield Remark("rides equal to the reference's to the last bit, so that nothing was compared")
    # Folders of earlier versions do not have this metric.
    if metrics.get("unconverged_steps"):
        residual = metrics.get("largest_residual")
        left = "" if residual is None else f", relative residual up to {residual:.2g}"
        yield Remark(
            "iterations that did not converge, so that figures are not those of the engine's equations",
            f"in {metrics['unconverged_steps']} of {metrics['steps']} steps{left}",
        )
    # Of a whole ride the rate is absent only where the drift is lost in the error of the damping's work.
    lost = metrics.get("energy_drift") is not None and metrics["energy_drift_rate"] is None
    if lost and metrics["ended"] is None:
        yield Remark(
            "energy drift below the error of the damping's work between samples, a higher output rate shows more",
            f"{metrics['energy_drift']:.2g}",
        )
    # Before the errors that may come of it. Folders of earlier versions do not have this metric.
    for text in metrics.get("adaptations") or ():
        yield Remark(f"for this release, {text}")
    if metrics["contact_force_error_at"] == 0:
        later = metrics["settled_force_error"]
        if later is None:
            yield Remark("force error largest in the first sample")
        else:
            yield Remark("force error largest in the first sample; once settled", f"{later:.1e}")
    # Folders of earlier versions do not have this metric.
    if metrics.get("inconsistent_reports"):
        reports = "; ".join(map(describe_mismatch, metrics["inconsistent_reports"]))
        yield Remark("reports that contradict the coordinates", f"({reports})")
    if metrics["not_finite"]:
        yield Remark("not finite in some samples", f"({', '.join(metrics['not_finite'])})")
    if metrics["horizon"] is not None and metrics["horizon"] < duration:
        yield Remark(
            "error without meaning beyond the horizon, by the motion's own instability", f"{metrics['horizon']:.2f} s"
        )


def _equals_reference(metrics: Mapping[str, Any]) -> bool:
    """Return whether path, orientation of the frame and rate of the wheel have no error over the whole ride."""
    errors = [metrics.get("position_error"), metrics.get("orientation_error"), {"max": metrics.get("rear_rate_error")}]
    return is_whole_ride(metrics) and all(error is not None and error["max"] == 0 for error in errors)
