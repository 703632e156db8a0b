"""What the edge of a basin leads to: rides that start on it, followed along it.

A ride that starts next to the edge soon leaves it. Two rides, one on each side, are followed until they are apart by
`_FAR`; between them the edge is searched for once more, by rides from states on the line that joins them, and so on
(edge tracking: Skufca, Yorke, Eckhardt 2006). What the rides tend to attracts all others of the edge near by, and has
one unstable direction. An unstable periodic orbit that is found so is solved for by shooting, from the ride alone.

References
----------
J. D. Skufca, J. A. Yorke, B. Eckhardt: Edge of chaos in a parallel shear flow. Physical Review Letters 96 (2006)
174101.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeGuard

import numpy as np

from ..bifurcations.orbits import PeriodicOrbit, energy_condition, solve_orbit
from ..bifurcations.shooting import Flow
from ..simulate import PreciseMotion, RideStart, simulate_many
from ..stability import VARIABLES, independent
from .edge import Shot, narrow
from .neighbours import StableNeighbours
from .riding import Patience, ride_out

_LEAN, _LEAN_RATE = VARIABLES.index("lean"), VARIABLES.index("lean_rate")
_FAR = 3e-4  # so near to each other, the line between two states crosses the edge once; in units of 1 m, 1 rad, 1 rad/s
_NARROW = 1e-2  # distance of the next two rides, relative to that
_LOOKS = 64  # samples in a period of the slowest mode: a parabola gives the greatest lean to 1e-5 of its amplitude
_TOLERANCE = 1e-12  # of rides that stay near the edge: 1e-9 of their distance
_SEGMENT = 60.0  # longest part between two searches [s]
_REPEATS = 1e-3  # relative change of the amplitude over two periods at which a ride counts as periodic
_STILL = 1e-5  # lean amplitude below which the edge's state is a circle [rad]


@dataclass(frozen=True, eq=False)
class PassedCircle:
    """An unstable circle of the edge's energy, by which rides that start near the edge pass.

    Attributes
    ----------
    variables : ndarray, shape (7,)
        Its independent variables.
    growth : complex
        The eigenvalue of the fastest growth, of imaginary part >= 0 [1/s].
    """

    variables: np.ndarray
    growth: complex


@dataclass(frozen=True, eq=False)
class EdgeState:
    """What rides on the edge tend to.

    Attributes
    ----------
    time : float
        For how long the edge was followed [s].
    energy : float
        Of the rides [J].
    lean_amplitude : float
        Half of the peak-to-peak of the lean in the last period [rad].
    period : float
        Time between the last two greatest leans [s].
    settled : bool
        Whether the ride repeats itself, or stands still in the heading frame.
    orbit : PeriodicOrbit or None
        The periodic orbit, solved for from the ride; None where it does not repeat itself or Newton's method fails.
    passed : PassedCircle or None
        The unstable circle next to the middle of the first part of the rides, before they separate.
    """

    time: float
    energy: float
    lean_amplitude: float
    period: float
    settled: bool
    orbit: PeriodicOrbit | None
    passed: PassedCircle | None


@dataclass(frozen=True, eq=False)
class _Swing:
    """A period of the lean: times and variables (7,) at its greatest and at the next least."""

    time: float
    variables: np.ndarray
    least_time: float
    least: np.ndarray

    @property
    def amplitude(self) -> float:
        return 0.5 * float(self.variables[_LEAN] - self.least[_LEAN])


def follow_edge(
    neighbours: StableNeighbours, inside: Shot, outside: Shot, patience: Patience, longest: float, threads: int = 1
) -> EdgeState | None:
    """Follow the edge from two rides on both sides of it until it repeats itself.

    Parameters
    ----------
    neighbours : StableNeighbours
    inside, outside : Shot
        Survived and lost, close to each other.
    patience : Patience
        Of the rides that decide on which side a state is.
    longest : float
        For how long the edge is followed at most [s].
    threads : int

    Returns
    -------
    EdgeState or None
        None where not even a period was followed, as where the edge is a loss of contact at the start.
    """
    if inside.start is None or outside.start is None:
        return None
    precise = replace(patience, tolerance=min(patience.tolerance, _TOLERANCE))
    turn = neighbours.own_modes.slowest.imag
    step = min(2 * np.pi / turn / _LOOKS if turn else np.inf, patience.interval)
    times = np.arange(round(_SEGMENT / step) + 1) * step
    flow, elapsed = neighbours.flow, 0.0
    swings: list[_Swing] = []
    passed = None
    starts: list[RideStart] | None = [inside.start, outside.start]
    while starts is not None and elapsed < longest and not _is_settled(swings):
        motions = [motion for motion in simulate_many(starts, times, precise.tolerance, threads) if _rides(motion)]
        if len(motions) < 2:
            break
        count = min(len(motion.time) for motion in motions)
        both = np.array([independent(motion.q[:count], motion.qd[:count]) for motion in motions])
        apart = np.flatnonzero(np.linalg.norm(both[0] - both[1], axis=1) > _FAR)
        last = int(apart[0]) if len(apart) else count - 1
        if last == 0:
            break
        if elapsed == 0:
            passed = _find_passed(neighbours, both[0, : last + 1], inside.outcome.energy)
        swings += _find_swings(both[0, : last + 1], elapsed, step)
        elapsed += last * step
        flow = flow.moved_to(both[0, last])
        starts = _search_between(neighbours, flow, both[0, last], both[1, last], precise, threads)
    if len(swings) < 2:
        return None
    first, final = swings[-2:]
    settled = _is_settled(swings)
    energy = inside.outcome.energy
    orbit = _solve(flow, energy, first, final) if settled and final.amplitude > _STILL else None
    return EdgeState(elapsed, energy, final.amplitude, final.time - first.time, settled, orbit, passed)


def _find_passed(neighbours: StableNeighbours, variables: np.ndarray, energy: float) -> PassedCircle | None:
    """Return the unstable circle next to the mean of the second half of variables (n, 7); None if there is none."""
    try:
        circle = neighbours.solve_circle(variables[len(variables) // 2 :].mean(axis=0), energy)
        growth = neighbours.linearise_circle(circle).slowest
    except ValueError:
        return None
    return PassedCircle(circle, growth) if growth.real > 0 else None


def _rides(motion: PreciseMotion | ValueError) -> TypeGuard[PreciseMotion]:
    return isinstance(motion, PreciseMotion)


def _is_settled(swings: Sequence[_Swing]) -> bool:
    """Return whether the last three amplitudes and greatest leans are equal, or the lean stands still."""
    if len(swings) < 3:
        return False
    sizes = np.array([swing.amplitude for swing in swings[-3:]])
    leans = np.array([swing.variables[_LEAN] for swing in swings[-3:]])
    return bool(sizes.max() < _STILL or max(np.ptp(sizes), np.ptp(leans)) < _REPEATS * sizes.max())


def _find_swings(variables: np.ndarray, offset: float, step: float) -> Iterator[_Swing]:
    """Yield the whole periods of the lean in samples (n, 7) that are equidistant in time."""
    rate = variables[:, _LEAN_RATE]
    greatest = np.flatnonzero((rate[1:-1] > 0) & (rate[2:] <= 0)) + 1
    least = np.flatnonzero((rate[1:-1] < 0) & (rate[2:] >= 0)) + 1
    for k in greatest:
        following = least[least > k]
        if len(following):
            at, there = _solve_extreme(variables, int(k))
            low, below = _solve_extreme(variables, int(following[0]))
            yield _Swing(offset + at * step, there, offset + low * step, below)


def _solve_extreme(variables: np.ndarray, k: int) -> tuple[float, np.ndarray]:
    """Return where, in samples, the lean rate vanishes between samples k and k + 1, and the variables (7,) there.

    The variables are those of the parabola through three samples, the rate's zero that of its own.
    """
    a, b, c = variables[k - 1 : k + 2]
    slope, bend = (c - a) / 2, (c + a) / 2 - b
    rate, s, h = (part[_LEAN_RATE] for part in (b, slope, bend))
    root = max(s * s - 4 * h * rate, 0.0) ** 0.5
    share = float(-2 * rate / (s + np.copysign(root, s)))
    return k + share, b + slope * share + bend * share**2


def _search_between(
    neighbours: StableNeighbours,
    flow: Flow,
    survived: np.ndarray,
    lost: np.ndarray,
    patience: Patience,
    threads: int,
) -> list[RideStart] | None:
    """Search for the edge on the line between the variables (7,) of two rides; return a start on each side of it."""
    bicycle, surface = neighbours.equations.bicycle, neighbours.equations.surface

    def shoot(shares: np.ndarray) -> list[Shot]:
        states = [flow.moved_to(survived + share * (lost - survived)).near for share in shares]
        starts = [RideStart(bicycle, surface, state[:9], state[9:18], until_fall=True) for state in states]
        outcomes = ride_out(neighbours, starts, patience, threads)
        return [Shot(*shot) for shot in zip(shares.tolist(), starts, outcomes, strict=True)]

    inside, outside = shoot(np.array([0.0, 1.0]))
    if not inside.outcome.survived or not outside.outcome.lost:
        return None
    ends = narrow(shoot, inside, outside, _NARROW)
    return [shot.start for shot in ends if shot.start is not None]


def _solve(flow: Flow, energy: float, first: _Swing, final: _Swing) -> PeriodicOrbit | None:
    """Solve for the periodic orbit next to a ride; None where Newton's method does not converge."""
    down, whole = first.least_time - first.time, final.time - first.time
    guess = np.concatenate([first.variables, first.least, [down, whole - down]])
    try:
        orbit = solve_orbit(flow, guess, energy_condition(energy))
    except ValueError:
        return None
    return orbit if orbit.lean_amplitude > 0.5 * final.amplitude else None  # or it has found a circle
