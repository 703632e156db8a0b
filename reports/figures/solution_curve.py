"""A solution family as a curve in the plane of a figure: pieces, stable sections, named points, limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

_MARKED = ("static", "pivot", "cusp")  # kinds of points that are marked with and without a letter
SCALE = 4.0  # speed in the paper's abscissa, for the front wheel [m/s]


def scaled_speed(front_rate: float | np.ndarray, front_radius: float) -> Any:
    """Return the paper's abscissa, arctan(R |w| / 4).

    The paper plots families 1 and 3 over arctan(R w / 4). On family 2 the front wheel turns backward, and the paper
    says that it plots -arctan(R w / 4); it must do so on family 4 too, since its points G and H coincide in
    the figures. The sign at the pivoting motion is arbitrary.
    """
    return np.arctan(front_radius * np.abs(front_rate) / SCALE)


@dataclass(frozen=True)
class NamedPoint:
    """A point to mark: the paper's letter (or none), its kind, its position, and whether it is only a limit."""

    name: str
    kind: str
    speed: float
    lean: float
    steer: float
    limit: bool
    first: bool = False


@dataclass(frozen=True)
class SolutionCurve:
    """One curve of a figure.

    Attributes
    ----------
    families : tuple of int
        Families that it belongs to; two where families have joined, none for a curve without a number.
    speed, lean, steer : ndarray, shape (n,)
        Abscissa [1] and angles [rad].
    pulled : ndarray of bool, shape (n,)
        Whether the ground does not push a wheel.
    ridden : tuple of (float, float)
        Parts that can be ridden, as positions along the curve in samples, in rising order.
    stable : tuple of (float, float)
        Lyapunov-stable sections, or the parts of them that can be ridden.
    unridden_stable : tuple of (float, float)
        Lyapunov-stable sections that cannot be ridden, or not wholly.
    limits : tuple of NamedPoint
        Points that the curve tends to at its ends.
    """

    families: tuple[int, ...]
    speed: np.ndarray
    lean: np.ndarray
    steer: np.ndarray
    pulled: np.ndarray
    ridden: tuple[tuple[float, float], ...]
    stable: tuple[tuple[float, float], ...]
    unridden_stable: tuple[tuple[float, float], ...]
    limits: tuple[NamedPoint, ...]

    def line(self, angle: str, low: float = 0.0, high: float | None = None) -> np.ndarray:
        """Return points (speed, angle) between two positions along the curve, shape (k, 2)."""
        samples = np.arange(len(self.speed))
        high = float(samples[-1]) if high is None else high
        inside = samples[(samples > low) & (samples < high)]
        places = np.concatenate([[low], inside, [high]])
        return np.column_stack([np.interp(places, samples, row) for row in (self.speed, getattr(self, angle))])

    def pieces(self) -> list[tuple[float, float, str]]:
        """Split the curve by whether and why it cannot be ridden.

        Returns
        -------
        list of (float, float, str)
            Start and end of each piece in samples; ``ridden``, ``pulled`` where the ground does not push a wheel, or
            ``touching`` where a rim is inside the ground or the wheels overlap. Between the latter two a piece ends
            half-way between samples.
        """
        bounds = [0.0, *(place for part in self.ridden for place in part), float(len(self.speed) - 1)]
        found: list[tuple[float, float, str]] = []
        for k, (low, high) in enumerate(pairwise(bounds)):
            if k % 2:
                found.append((low, high, "ridden"))
            elif low < high:
                found += self._split_unridden(low, high)
        return found

    def _split_unridden(self, low: float, high: float) -> list[tuple[float, float, str]]:
        samples = [k for k in range(len(self.speed)) if low <= k <= high]
        pulled = [bool(self.pulled[k]) for k in samples] or [bool(self.pulled[round((low + high) / 2)])]
        turns = [i for i in range(1, len(pulled)) if pulled[i] != pulled[i - 1]]
        bounds = [low, *(samples[i] - 0.5 for i in turns), high]
        kinds = ["pulled" if pulled[i] else "touching" for i in (0, *turns)]
        return [(*ends, kind) for ends, kind in zip(pairwise(bounds), kinds, strict=True)]


def make_curves(families: Sequence[Mapping[str, Any]], front_radius: float) -> list[SolutionCurve]:
    """Make the curves of a document's families."""
    return [_make_curve(family, front_radius) for family in families]


def _make_curve(family: Mapping[str, Any], front_radius: float) -> SolutionCurve:
    points = family["points"]
    rate, lean, steer = (np.array(points[name]) for name in ("front_rate", "lean", "steer"))
    pulled = np.array([any("pushed" in why for why in reasons) for reasons in points["unphysical_because"]], bool)
    sections = family["stable_sections"]
    speed = scaled_speed(rate, front_radius)
    return SolutionCurve(
        families=_owning_families(family),
        speed=speed,
        lean=lean,
        steer=steer,
        pulled=pulled,
        ridden=tuple(_place_section(lean, steer, part) for part in family["rideable_parts"]),
        stable=tuple(_place_section(lean, steer, part) for section in sections for part in section["rideable_parts"]),
        unridden_stable=tuple(
            _place_section(lean, steer, section) for section in sections if section["rideable"] != "wholly"
        ),
        limits=_find_curve_limits(family, speed),
    )


def _place_section(lean: np.ndarray, steer: np.ndarray, section: Mapping[str, Any]) -> tuple[float, float]:
    """Return the positions of both ends of a section along a curve, in samples."""
    ends = zip(section["lean"], section["steer"], strict=True)
    low, high = sorted(_position_along(lean, steer, *end) for end in ends)
    return low, high


def _position_along(lean: np.ndarray, steer: np.ndarray, at_lean: float, at_steer: float) -> float:
    """Return the position of a point along a polyline, in samples."""
    path = np.column_stack([lean, steer])
    step, arm = np.diff(path, axis=0), np.array([at_lean, at_steer]) - path[:-1]
    share = np.clip(np.einsum("ij,ij->i", arm, step) / np.einsum("ij,ij->i", step, step), 0, 1)
    nearest = int(np.argmin(np.hypot(*(arm - share[:, None] * step).T)))
    return nearest + float(share[nearest])


def _index_ends(family: Mapping[str, Any]) -> list[tuple[int, str]]:
    """Return the index of the end sample and the kind of end, for both ends."""
    return list(zip((0, -1), family["ends"], strict=True))


def _owning_families(family: Mapping[str, Any]) -> tuple[int, ...]:
    """Return the families of a curve by its ends: A belongs to family 1, E to 2, F and G to 3, H to 4."""
    if family["family"] is None:
        return ()
    lean, steer = family["points"]["lean"], family["points"]["steer"]
    owners = {family["family"], *family["joined_families"]}
    for index, end in _index_ends(family):
        if end == "static":
            owners.add(1)
        elif end == "flat":
            owners.add(2 if lean[index] > 0 else 3)
        elif end == "pivot":
            neighbour = steer[1 if index == 0 else -2]
            owners.add(4 if neighbour > steer[index] else 3)
    return tuple(sorted(owners))


def _find_curve_limits(family: Mapping[str, Any], speed: np.ndarray) -> tuple[NamedPoint, ...]:
    """Return limits: E and F at the frame's corners; B and C where circles grow without bound, until solved for.

    The letters are those of the paper's families; limits of curves without a number have none.
    Where the front wheel turns ever faster, and where the ground ends, the limit has no letter and stands at the
    curve's end.
    """
    points, special, numbered = family["points"], family["special_points"], family["family"] is not None
    solved = {name for name, point in special.items() if point["kind"] == "straight"}
    large = [index for index, end in _index_ends(family) if end == "large circle"]
    fastest = max(large, key=lambda index: speed[index]) if large else None
    found = []
    for index, end in _index_ends(family):
        lean, steer = points["lean"][index], points["steer"][index]
        if end == "flat":
            name, angles = ("E", (np.pi / 2, np.pi)) if lean > 0 else ("F", (-np.pi / 2, 0.0))
            if steer < 0:  # left and right exchanged, as a steer torque has it
                angles = (np.pi / 2, 0.0) if lean > 0 else (-np.pi / 2, -np.pi)
            name = name if numbered else ""
            found.append(NamedPoint(name, end, np.pi / 2, *angles, True, index == 0))
        elif end == "large circle" and not solved:
            letter = "B" if abs(steer) < np.pi / 2 else "C"
            name = letter if numbered and index == fastest else ""
            found.append(NamedPoint(name, end, float(speed[index]), lean, steer, True, index == 0))
        elif end in ("fast front wheel", "edge"):
            found.append(NamedPoint("", end, float(speed[index]), lean, steer, True, index == 0))
    return tuple(found)


def find_limits(drawn: Sequence[SolutionCurve]) -> list[NamedPoint]:
    """Return the limits of all curves, each once; of large circles with equal angles only the fastest is lettered."""
    found: dict[tuple, NamedPoint] = {}
    for point in (limit for curve in drawn for limit in curve.limits):
        found.setdefault((point.name, *(round(value, 6) for value in (point.speed, point.lean, point.steer))), point)
    fastest = {point.name: point for point in sorted(found.values(), key=lambda point: point.speed)}
    return [point if fastest[point.name] is point else replace(point, name="") for point in found.values()]


def find_named_points(families: Sequence[Mapping[str, Any]], front_radius: float) -> list[NamedPoint]:
    """Return the special points to mark, with the paper's letters where it gives one.

    Points that coincide share a label, as G and H do. Without a letter are static equilibria, pivoting motions and
    cusps of curves that the paper does not have, on other grounds and with inputs.
    """
    found: dict[tuple, NamedPoint] = {}
    for family in families:
        for name, point in family["special_points"].items():
            letters = set(name) - set(" ()")
            if not all(letter.isupper() for letter in letters):
                if point["kind"] not in _MARKED:
                    continue
                letters = set()
            speed = float(scaled_speed(point["front_rate"], front_radius))
            key = (point["kind"], round(point["lean"], 6), round(point["steer"], 6))
            both = sorted(letters | set(found[key].name if key in found else "") - set(" ()"))
            label = "".join([*both[:1], *(f" ({other})" for other in both[1:])])
            found[key] = NamedPoint(label, point["kind"], speed, point["lean"], point["steer"], False)
    return list(found.values())
