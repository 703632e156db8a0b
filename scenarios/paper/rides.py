"""Section 4.2, Figures 8 and 9: Q1 leaves its circle, a disturbed Q2 tends to a neighbouring circle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.circular import CircularMotion
from ...reference.contact import observe
from ...reference.dae import consistent_state
from ...reference.kinematics import REAR_ANGLE
from ...reference.simulate import PreciseMotion, simulate, simulate_modified_euler
from ...reference.stability import independent, linearise
from ...reference.surface import Paraboloid
from .configurations import named_motion
from .energy import motion_of_energy
from .evidence import Evidence
from .ledger import LedgerLine, SelfCheck, above, below, claim_line, source

_OUTPUT = 0.05  # [s]
_LEAVES = 0.01  # departure from the circle, relative to its radius
_WATCHED = {"paper": 50.0, "exact": 100.0}  # [s] the paper's integrator leaves after 36 s, the precise one after 76 s
_GROWING = {"paper": (10.0, 25.0), "exact": (40.0, 65.0)}  # [s] decaying modes are gone, the growing one is still small
_LONG, _LATE = 1200.0, 100.0  # [s] exp(-0.0111 x 1200) = 2e-6
_LONG_OUTPUT = 0.25  # [s]
_CLOSE = 0.1  # departure, relative to the circle's radius
_TOLERANCE = 1e-12
_SLIGHT, _SETTLES = 1e-3, 400.0  # [rad/s], [s]


def ride_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the lines on the simulations of section 4.2, and on energy."""
    yield from _unstable_lines(evidence)
    rides = {sign: _ride_disturbed(evidence, sign) for sign in (1, -1)}
    yield _energy_line(evidence, rides)
    yield from _stable_lines(evidence, rides)


@dataclass(frozen=True)
class Leaving:
    """Departure of an integration started on Q1 from its circle.

    Attributes
    ----------
    at : float
        Time at which the distance from the axis is off by a hundredth; nan if never [s].
    rate : float
        Growth rate of the unstable mode [1/s].
    """

    at: float
    rate: float


def radius(ride: PreciseMotion) -> np.ndarray:
    """Return the distance of D from the axis [m]."""
    return np.hypot(ride.q[:, 0], ride.q[:, 1])


def leaving_time(ride: PreciseMotion, circle: float) -> float:
    """Return the time at which the radius is first off by a hundredth, interpolated exponentially [s]."""
    off = np.abs(radius(ride) - circle) / circle
    beyond = np.flatnonzero(off > _LEAVES)
    if len(beyond) == 0:
        return float("nan")
    i = int(beyond[0])
    if i == 0:
        return 0.0
    share = np.log(_LEAVES / off[i - 1]) / np.log(off[i] / off[i - 1])
    return float(ride.time[i - 1] + share * (ride.time[i] - ride.time[i - 1]))


def _measure_leaving(
    evidence: Evidence, ride: PreciseMotion, motion: CircularMotion, window: tuple[float, float]
) -> Leaving:
    reduced = linearise(evidence.bicycle, Paraboloid(evidence.figures["Q1"]["alpha"]), *motion.state())
    values, right = np.linalg.eig(reduced.jacobian)
    unstable = np.real(np.linalg.inv(right)[int(np.real(values).argmax())])
    share = np.abs((independent(ride.q, ride.qd) - independent(*(part[None] for part in motion.state()))) @ unstable)
    chosen = (ride.time >= window[0]) & (ride.time <= window[1])
    rate = float(np.polyfit(ride.time[chosen], np.log(share[chosen]), 1)[0]) if chosen.sum() > 2 else float("nan")
    return Leaving(leaving_time(ride, float(np.hypot(*motion.position[:2]))), rate)


def _unstable_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    motion, surface = named_motion(evidence, "Q1"), Paraboloid(evidence.figures["Q1"]["alpha"])
    step = evidence.figures["simulation"]["step"]
    reduced = linearise(evidence.bicycle, surface, *motion.state())
    growth = float(np.real(reduced.eigenvalues).max())

    def integrate(how: str, h: float) -> Leaving:
        times = np.arange(round(_WATCHED[how] / _OUTPUT) + 1) * _OUTPUT
        start = (evidence.bicycle, surface, *motion.state(), times)
        ride = simulate(*start) if how == "exact" else simulate_modified_euler(*start, h)
        return _measure_leaving(evidence, ride, motion, _GROWING[how])

    whole, half = integrate("paper", step), integrate("paper", step / 2)
    precise = integrate("exact", 0.0)
    # An error of order two is divided by four when the step is halved: the ride leaves ln 4 / growth later.
    delay, expected = half.at - whole.at, np.log(4) / growth
    grown = SelfCheck(
        "growth rate of the precise ride, relative to the eigenvalue", abs(precise.rate / growth - 1), 1e-2
    )
    yield claim_line(
        section="4.2",
        claim="even with just numerical errors Q1 does not keep its circle",
        thresholds=[
            below(f"time until the radius is off by {_LEAVES:.0%}", _finite_or_inf(whole.at), _WATCHED["paper"], "s")
        ],
        measured=f"started on Q1 to round-off, modified Euler at {step:g} s is off by 1 % of the radius at "
        f"{whole.at:.2f} s, at half the step {delay:.3f} s later (ln 4 / {growth:.5f} = {expected:.3f}: an error of "
        f"order two that grows with the eigenvalue); the precise integrator at {precise.at:.2f} s, growing at "
        f"{precise.rate:.5f} 1/s",
        source=source("rides from Q1 by two integrators", simulate_modified_euler, simulate, linearise),
        checks=[grown, SelfCheck("delay at half the step, less the expected", abs(delay - expected), 0.02)],
        kind="simulation",
    )
    yield _rounded_start_line(evidence, motion, surface, step)


def _finite_or_inf(time: float) -> float:
    return time if np.isfinite(time) else float("inf")


def _rounded_start_line(evidence: Evidence, motion: CircularMotion, surface: Paraboloid, step: float) -> LedgerLine:
    """Make the line on a start at v* as printed, where rounding to two decimals outweighs the integrator's errors."""
    v = [float(text) for text in evidence.figures["Q1"]["v"]]
    guess = (float(motion.position[2]), motion.pitch)
    start = consistent_state(evidence.bicycle, surface, (v[0], v[1]), v[2], v[3], (v[4], v[5], v[6]), guess=guess)
    times = np.arange(401) * _OUTPUT
    circle = float(np.hypot(*motion.position[:2]))
    rides = [
        simulate_modified_euler(evidence.bicycle, surface, *start, times, step),
        simulate(evidence.bicycle, surface, *start, times),
    ]
    leaves = [leaving_time(ride, circle) for ride in rides]
    return claim_line(
        section="4.2",
        claim="Q1, started from v* as printed, leaves its circle",
        thresholds=[
            below(f"time until the radius is off by {_LEAVES:.0%}", _finite_or_inf(max(leaves)), times[-1], "s")
        ],
        measured=f"off by 1 % at {leaves[0]:.3f} s, by the precise integrator at {leaves[1]:.3f} s: here it is the two "
        "printed decimals that matter, not the integrator",
        source=source("rides from v* as printed by two integrators", simulate_modified_euler, simulate),
        checks=[SelfCheck("integrators' difference", abs(leaves[0] - leaves[1]), 0.01)],
        kind="simulation",
    )


def _ride_disturbed(evidence: Evidence, sign: int) -> PreciseMotion:
    def compute() -> PreciseMotion:
        motion, surface = named_motion(evidence, "Q2"), Paraboloid(evidence.figures["Q2"]["alpha"])
        x, y, z = (float(value) for value in motion.position)
        rates = (sign * evidence.figures["simulation"]["lean_rate"], 0.0, motion.rear_rate)
        start = consistent_state(
            evidence.bicycle, surface, (x, y), motion.lean, motion.steer, rates, guess=(z, motion.pitch)
        )
        times = np.arange(round(_LONG / _LONG_OUTPUT) + 1) * _LONG_OUTPUT
        return simulate(evidence.bicycle, surface, *start, times, _TOLERANCE)

    return evidence.once(("ride of Q2", sign), compute)


def _total_energy(evidence: Evidence, ride: PreciseMotion) -> np.ndarray:
    seen = observe(evidence.bicycle, Paraboloid(evidence.figures["Q2"]["alpha"]), ride.q, ride.qd)
    return seen.kinetic_energy + seen.potential_energy


def _energy_line(evidence: Evidence, rides: dict[int, PreciseMotion]) -> LedgerLine:
    drift = max(float(np.ptp(e) / e[0]) for e in (_total_energy(evidence, ride) for ride in rides.values()))
    evaluations = sum(ride.evaluations for ride in rides.values())
    return claim_line(
        section="2.3",
        claim="the uncontrolled bicycle conserves energy",
        thresholds=[below("change of the energy, relative,", drift, 1e-8)],
        measured=f"over {_LONG:g} s of the two disturbed rides of Q2 by {drift:.0e} of itself, what the tolerance of "
        f"{_TOLERANCE:.0e} leaves",
        source=source("energy along two disturbed rides of Q2", simulate, observe),
        checks=[SelfCheck("evaluations of the right-hand side (must be many)", -evaluations, -1000)],
        kind="simulation",
    )


@dataclass(frozen=True)
class Settling:
    """Settling of a disturbed ride of Q2.

    Attributes
    ----------
    limit : float
        Mean of the rear rate at the end [rad/s].
    left : float
        Span of the rear rate at the end [rad/s].
    predicted : float
        Rear rate of the circle of the same family that has the ride's energy [rad/s].
    decay : float
        Decay rate of the oscillation [1/s], negative.
    """

    limit: float
    left: float
    predicted: float
    decay: float


def _measure_settling(evidence: Evidence, ride: PreciseMotion, motion: CircularMotion) -> Settling:
    late, rear = ride.time >= _LONG - _LATE, ride.qd[:, REAR_ANGLE]
    family = evidence.family(evidence.figures["Q2"]["alpha"], evidence.figures["Q2"]["family"])
    neighbour = motion_of_energy(family, float(_total_energy(evidence, ride)[0]), motion)
    return Settling(
        float(rear[late].mean()), float(np.ptp(rear[late])), neighbour.rear_rate, _measure_decay(ride, rear)
    )


def _stable_lines(evidence: Evidence, rides: dict[int, PreciseMotion]) -> Iterator[LedgerLine]:
    motion, surface = named_motion(evidence, "Q2"), Paraboloid(evidence.figures["Q2"]["alpha"])
    whole = [SelfCheck("rides that ended early", float(sum(ride.ended is not None for ride in rides.values())), 0.0)]
    circle = float(np.hypot(*motion.position[:2]))
    off = [float(np.abs(radius(ride) - circle).max()) for ride in rides.values()]
    ridden = source("rides from Q2, disturbed, over 1200 s", simulate)
    yield claim_line(
        section="4.2",
        claim="disturbed by a lean rate of +-0.1 rad/s Q2 stays close to its circle",
        thresholds=[below("largest departure of the radius, relative,", max(off) / circle, _CLOSE)],
        measured=f"over {_LONG:g} s D's distance from the axis departs from {circle:.4f} m by at most {off[0]:.3f} (+) "
        f"and {off[1]:.3f} m (-), within {_CLOSE:.0%}",
        source=ridden,
        checks=whole,
        kind="simulation",
    )
    plus, minus = (_measure_settling(evidence, ride, motion) for ride in rides.values())
    error = max(abs(ride.limit - ride.predicted) for ride in (plus, minus))
    apart = [abs(ride.limit - motion.rear_rate) for ride in (plus, minus)]
    left = max(plus.left, minus.left)
    yield claim_line(
        section="4.2",
        claim="the disturbed Q2's rear rate converges to a constant near, but not equal to, its own",
        thresholds=[
            above("lesser distance of the constant from Q2's rear rate", min(apart), 1e-3, "rad/s"),
            below("larger distance", max(apart), 1.0, "rad/s"),
            below("span of the rear rate in the last 100 s", left, 1e-6, "rad/s"),
        ],
        measured=f"to {plus.limit:.7f} (+) and {minus.limit:.7f} rad/s (-), constant to {left:.0e}; the circles of "
        f"family 2 that have the disturbed energies have {plus.predicted:.7f} and {minus.predicted:.7f}",
        source=source("rides from Q2, disturbed, and the circles of their energies", simulate, motion_of_energy),
        checks=[*whole, SelfCheck("limits against the prediction from energy", error, 1e-6)],
        kind="simulation",
    )
    slowest = float(np.sort(np.real(linearise(evidence.bicycle, surface, *motion.state()).eigenvalues))[-2])
    departs = abs((plus.decay + minus.decay) / 2 / slowest - 1)
    yield claim_line(
        section="4.2",
        claim="Q2 is stable but not asymptotically: a disturbance does not die out",
        thresholds=[
            above("lesser distance that stays of the rear rate from Q2's", min(apart), 1e-3, "rad/s"),
            below("slowest eigenvalue's real part", slowest, 0.0, "1/s"),
        ],
        measured=f"what oscillates decays at {-plus.decay:.4f} and {-minus.decay:.4f} 1/s, the slowest eigenvalue's "
        f"{-slowest:.4f}; the change of energy stays",
        source=source("rides from Q2, disturbed, and the eigenvalues at Q2", simulate, linearise),
        checks=[*whole, SelfCheck("decay over the slowest eigenvalue's, less one", departs, 0.1)],
        kind="simulation",
    )


def _measure_decay(ride: PreciseMotion, rear: np.ndarray, end: float = 500.0) -> float:
    """Return the slope of the logarithm of the rear rate's span over windows of 20 s, from 100 s on [1/s]."""
    starts = np.arange(100.0, end, 50.0)
    spans = [np.ptp(rear[(ride.time >= start) & (ride.time < start + 20)]) for start in starts]
    return float(np.polyfit(starts, np.log(spans), 1)[0])


def disturbed_decay(bicycle: Bicycle, surface: Paraboloid, motion: CircularMotion) -> float:
    """Return the rate at which a slightly disturbed ride on a circle settles [1/s]."""
    x, y, z = (float(value) for value in motion.position)
    rates = (_SLIGHT, 0.0, motion.rear_rate)
    start = consistent_state(bicycle, surface, (x, y), motion.lean, motion.steer, rates, guess=(z, motion.pitch))
    # Long enough for the slowest mode to dominate, short enough that the integrator's error does not.
    times = np.arange(round(_SETTLES / _LONG_OUTPUT) + 1) * _LONG_OUTPUT
    ride = simulate(bicycle, surface, *start, times, _TOLERANCE)
    return _measure_decay(ride, ride.qd[:, REAR_ANGLE], _SETTLES - 50.0) if ride.ended is None else float("nan")
