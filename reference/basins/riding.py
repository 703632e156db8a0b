"""Many disturbed rides until it is decided what becomes of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..kinematics import WHEELS
from ..rim import second_touch
from ..simulate import PreciseMotion, RideStart, simulate_many
from .disturbance import start_energies
from .neighbours import StableNeighbours
from .outcome import BROKE_OFF, ELSEWHERE, FELL, LOST_CONTACT, NO_START, TOUCHED, UNDECIDED, RideOutcome
from .stretch import SAMPLES, find_lost_contact, judge_stretch, settles_elsewhere

_BATCH = 256  # rides in a call of compiled code; some 500 samples of each are held at once, 30 MB
_PERIODS = 10  # of the slowest mode in a stretch, so that means over its halves hardly depend on the phase
# Least decay of the slowest mode between the halves of a stretch, as an exponent, if it is to be told from none: means
# over five periods vary by a hundredth.
_LEAST_DECAY = 0.08
_LAST_LOOK, _FINE = 1.0, 0.005  # the last second before a ride ends is looked at in steps of 5 ms


@dataclass(frozen=True)
class Patience:
    """How long rides are watched, and how precisely.

    Attributes
    ----------
    stretch : float
        After which a ride is judged, again and again [s].
    interval : float
        Between samples [s].
    longest : float
        After which a ride is left undecided [s].
    tolerance : float
        Of the integration, see `velodrome.reference.simulate.simulate`.
    """

    stretch: float
    interval: float
    longest: float
    tolerance: float

    @property
    def times(self) -> np.ndarray:
        """Times of the samples of a stretch, shape (n,) [s]."""
        return np.arange(round(self.stretch / self.interval) + 1) * self.interval


def choose_patience(neighbours: StableNeighbours, relative: float, tolerance: float = 1e-10) -> Patience:
    """Choose how long rides are watched that start within a relative distance of the edge of the basin.

    Next to the edge, a ride lingers near the orbit that bounds the circle, and leaves it as exp(t log(mu) / period),
    with mu its multiplier outside the unit circle. It then returns with the decay of the slowest mode.

    Parameters
    ----------
    neighbours : StableNeighbours
    relative : float
        The distance from the edge, relative to that of the edge.
    tolerance : float
        Of the integration. What a step may change of the slowest decay is far below it: some steps a second.
    """
    modes, orbit = neighbours.own_modes, neighbours.orbit
    decay, turn = -modes.slowest.real, modes.slowest.imag
    stretch = max(_PERIODS * 2 * np.pi / turn if turn else 0.0, 2 * _LEAST_DECAY / decay)
    interval = min(2 * np.pi / modes.fastest_turn / SAMPLES if modes.fastest_turn else np.inf, stretch / 64)
    leave = decay if orbit is None else float(np.log(orbit.growth)) / orbit.period
    longest = np.log(1 / relative) / leave + 3 / decay + 2 * stretch
    return Patience(float(stretch), float(interval), float(longest), tolerance)


@dataclass(frozen=True, eq=False)
class _Riding:
    """A ride that goes on: its index among the starts, where it is, and the time it has gone on [s]."""

    index: int
    start: RideStart
    elapsed: float
    energy: float


def ride_out(
    neighbours: StableNeighbours,
    starts: Sequence[RideStart | None],
    patience: Patience,
    threads: int = 1,
    watch: Callable[[int], None] = lambda _: None,
) -> list[RideOutcome]:
    """Ride until it is decided what becomes of each start.

    What happens first counts: a wheel that would have to be pulled ends a ride, whatever the equations, which hold it
    on the ground, would do later.

    Parameters
    ----------
    neighbours : StableNeighbours
    starts : sequence of RideStart or None
        Their rides end where the bicycle falls; None becomes `NO_START`.
    patience : Patience
    threads : int
        Number of threads that share the rides.
    watch : callable
        Called with the number of rides that are decided.

    Returns
    -------
    list of RideOutcome
        In the order of the starts.
    """
    outcomes: dict[int, RideOutcome] = {}
    energies = start_energies(starts)
    riding: list[_Riding] = []
    for i, (start, energy) in enumerate(zip(starts, energies.tolist(), strict=True)):
        if start is None:
            outcomes[i] = RideOutcome(NO_START, 0.0, float("nan"))
        else:
            riding.append(_Riding(i, start, 0.0, energy))
    while riding:
        left: list[_Riding] = []
        for first in range(0, len(riding), _BATCH):
            batch = riding[first : first + _BATCH]
            left += _ride_stretch(neighbours, batch, patience, threads, outcomes)
            watch(len(outcomes))
        riding = left
    return [outcomes[i] for i in range(len(starts))]


def _ride_stretch(
    neighbours: StableNeighbours,
    batch: Sequence[_Riding],
    patience: Patience,
    threads: int,
    outcomes: dict[int, RideOutcome],
) -> list[_Riding]:
    """Ride a stretch; add the outcomes of rides that are decided, and return the others where they are now."""
    times = patience.times
    surface = neighbours.equations.surface
    whole: list[tuple[_Riding, PreciseMotion]] = []
    ended: list[tuple[_Riding, PreciseMotion]] = []
    motions = simulate_many([ride.start for ride in batch], times, patience.tolerance, threads)
    for ride, motion in zip(batch, motions, strict=True):
        if isinstance(motion, ValueError):  # a rim has come into the ground within round-off of the last sample
            outcomes[ride.index] = RideOutcome(TOUCHED, ride.elapsed, ride.energy, detail=str(motion))
            continue
        lost = find_lost_contact(surface, motion)
        if lost is not None:
            when, wheel = lost
            outcomes[ride.index] = RideOutcome(LOST_CONTACT, ride.elapsed + when, ride.energy, detail=wheel)
        elif motion.ended is not None:
            ended.append((ride, motion))
        else:
            whole.append((ride, motion))
    _look_at_ends(neighbours, ended, patience, threads, outcomes)
    if not whole:
        return []
    energies = np.array([ride.energy for ride, _ in whole])
    kinds, amplitudes = judge_stretch(neighbours, [motion for _, motion in whole], energies)
    left = []
    for (ride, motion), kind, amplitude in zip(whole, kinds, amplitudes.tolist(), strict=True):
        elapsed = ride.elapsed + float(times[-1])
        if kind is not None:
            outcomes[ride.index] = RideOutcome(kind, elapsed, ride.energy, amplitude)
            continue
        if elapsed >= patience.longest:
            kind = ELSEWHERE if settles_elsewhere(neighbours, motion, ride.energy) else UNDECIDED
            outcomes[ride.index] = RideOutcome(kind, elapsed, ride.energy, amplitude)
            continue
        start = replace(ride.start, q=motion.q[-1], qd=motion.qd[-1])
        left.append(_Riding(ride.index, start, elapsed, ride.energy))
    return left


def _look_at_ends(
    neighbours: StableNeighbours,
    ended: Sequence[tuple[_Riding, PreciseMotion]],
    patience: Patience,
    threads: int,
    outcomes: dict[int, RideOutcome],
) -> None:
    """Add the outcomes of rides that end: they change so fast before it that they are looked at more closely."""
    back = int(np.ceil(_LAST_LOOK / patience.interval))
    starts, offsets = [], []
    for ride, motion in ended:
        k = max(len(motion.time) - back, 0)
        starts.append(replace(ride.start, q=motion.q[k], qd=motion.qd[k]))
        offsets.append(ride.elapsed + float(motion.time[k]))
    # Beyond the end of every one of them.
    times = np.arange(round((_LAST_LOOK + 2 * patience.interval) / _FINE) + 1) * _FINE
    closer = simulate_many(starts, times, patience.tolerance, threads) if starts else []
    for (ride, _), start, offset, seen in zip(ended, starts, offsets, closer, strict=True):
        if isinstance(seen, ValueError):
            outcomes[ride.index] = RideOutcome(TOUCHED, offset, ride.energy, detail=str(seen))
            continue
        lost = find_lost_contact(start.surface, seen)
        if lost is not None:
            when, wheel = lost
            outcomes[ride.index] = RideOutcome(LOST_CONTACT, offset + when, ride.energy, detail=wheel)
        else:
            kind = FELL if seen.fall is not None else TOUCHED if _find_wheel(seen) else BROKE_OFF
            when = offset + float(seen.fall.time[0] if seen.fall is not None else seen.time[-1])
            outcomes[ride.index] = RideOutcome(kind, when, ride.energy, detail=_find_wheel(seen))


def _find_wheel(motion: PreciseMotion) -> str:
    """Return the wheel whose rim has touched a second place; empty if none has."""
    ended = motion.ended or ""
    return next((wheel for wheel in WHEELS if ended.startswith(second_touch(wheel, 0.0).partition(" at t =")[0])), "")
