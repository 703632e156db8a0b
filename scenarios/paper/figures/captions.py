"""Captions of the figures, made from the data that they show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....reference.circular import CircularMotion
from ....reference.kinematics import REAR_ANGLE
from ....reports.figures import make_curves
from .trajectories import FigureRide, leaves_at

LEFT_CIRCLE_AT = 0.01  # distance, relative to the radius, from which on D has left its circle
SETTLED_PART = 10.0  # last part of a ride, over which the mean rate is taken [s]

_AXES = (
    "Circular motions: (a) lean and (b) steer over the scaled speed of the front wheel; on families 2 and 4, whose "
    "front wheel turns backward, over its negative, as in the paper."
)


def families_caption(document: Mapping[str, Any], front_radius: float) -> str:
    """Write the caption of a figure of solution families: the meaning of its lines, and its stable sections."""
    drawn = make_curves(document["families"], front_radius)
    sentences = [_AXES]
    shared = [curve.families for curve in drawn if len(curve.families) > 1]
    if shared:
        pairs = " and ".join(f"{first} with {second}" for first, second in shared)
        sentences.append(f"Families have joined: {pairs}, each pair on one curve, striped where a bicycle can ride it.")
    kinds = {kind for curve in drawn for *_, kind in curve.pieces()}
    if "pulled" in kinds:
        sentences.append("Dashed: the ground would have to pull a wheel, so no bicycle can ride there.")
    if "touching" in kinds:
        sentences.append("Dotted: a rim would lie inside the ground, so no bicycle can ride there.")
    sentences.append(
        "Open marks are limits: circles lying flat at infinite speed (E and F), diamonds ever larger circles, "
        "triangles a front wheel that turns ever faster. Small filled triangles are cusps that have no letter in the "
        "paper."
    )
    sections = []
    for family in document["families"]:
        for section in family["stable_sections"]:
            low, high = sorted(section["rear_rate"])
            sections.append(f"family {family['family']} at rear rates from {low:.4f} to {high:.4f} rad/s")
    stable = (
        f"Thick and magnified: Lyapunov stable, {' and '.join(sections)}."
        if sections
        else "No section is Lyapunov stable."
    )
    return " ".join([*sentences, stable])


def configurations_caption(alpha: float) -> str:
    """Write the caption of the bicycles in the bowl."""
    return (
        f"Four circular motions in the bowl α = {alpha:g} m⁻¹, one of each family, as marked in Figure 5; wheels, axes "
        "and poses are computed, the tubes are schematic. Grey: the steered part. Seen from outside; parts of the wall "
        "that would show their outer side are left out."
    )


def departure_caption(ride: FigureRide, circle: CircularMotion, growth_rate: float) -> str:
    """Write the caption of the ride that leaves Q1."""
    times = [leaves_at(motion, circle, LEFT_CIRCLE_AT) for motion in (ride.paper, ride.precise)]
    paper, precise = ("never" if time is None else f"after {time:.1f} s" for time in times)
    ends = [f"{motion.time[-1]:.1f} s" for motion in (ride.paper, ride.precise)]
    return (
        f"A ride from {ride.name}: (a) path of D, (b) wheel rates, (c) distance of D from its circle. By modified "
        f"Euler D is {100 * LEFT_CIRCLE_AT:g} % off its circle {paper}, by the precise integrator {precise}: that one "
        f"starts from round-off alone, and in both errors grow at the rate of linear theory, {growth_rate:.4f} 1/s. "
        f"They leave along like paths at different times. Curves end where a wheel leaves the ground, after {ends[0]} "
        f"and {ends[1]}."
    )


def disturbed_caption(
    rides: Sequence[FigureRide], circle: CircularMotion, neighbours: Mapping[str, CircularMotion]
) -> str:
    """Write the caption of the disturbed rides about Q2."""
    sentences = []
    for ride in rides:
        level = neighbours[ride.name].rear_rate
        sentences.append(
            f"with {ride.name} its mean over the last {SETTLED_PART:g} s is {settled_rate(ride):.4f} rad/s, and "
            f"{level:.4f} on the circle of equal energy (integrators apart after {ride.both[0][-1]:g} s: "
            f"{ride.apart[-1]:.2g} m)"
        )
    return (
        "Rides from Q2, disturbed in the lean rate: (a) path of D in the first 20 s, (b) rate of the rear wheel, (c) "
        "distance of D between the two integrators. The rate does not return to "
        f"{circle.rear_rate:g} rad/s: {'; '.join(sentences)}. "
        "The slowest disturbance, a drift of the circle's centre, still fades."
    )


def settled_rate(ride: FigureRide) -> float:
    """Return the mean rear-wheel rate at the end of a ride [rad/s]."""
    late = ride.precise.time > ride.precise.time[-1] - SETTLED_PART
    return float(np.mean(ride.precise.qd[late, REAR_ANGLE]))


def captions_text(captions: Mapping[str, str]) -> str:
    """Write all captions as Markdown, by the names of the figures' files."""
    return "\n".join(f"## {name.replace('-', ' ').capitalize()}\n\n{text}\n" for name, text in captions.items())
