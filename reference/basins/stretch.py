"""What a stretch of a ride shows: whether it has lost contact, has returned, or has come to a stable orbit.

With S the mean size of the deviation from the circle of the ride's energy (`modal_size`), gamma the decay rate of its
slowest mode and T the time between the middles of the stretch's halves, a ride has **returned** if in the second half

    S <= S_first exp(-3/4 gamma T),    both for the slowest mode and for all modes together, and
    S <= 1/2 S_orbit                   where the orbit that bounds the circle is known.

At a subcritical end the slowest mode follows r' = -gamma r (1 - r^2 / R^2), with R of the orbit: the first condition
then says r <= R / 2, too. Where the deviation is less than `SETTLED` of the orbit's, it need not be seen to decay.

A ride has come to a stable **orbit** if its lean amplitude and the middle of its lean are nearer to the orbit's than
`_NEAR` of its amplitude, and the amplitude comes nearer or is within what the samples resolve.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..kinematics import LEAN, WHEELS
from ..normal_force import normal_forces
from ..simulate import PreciseMotion
from ..stability import independent
from ..surface import Surface
from .modal_size import deviation_sizes
from .neighbours import StableNeighbours
from .outcome import ORBIT, RETURNED

# Samples in a period of the fastest mode. Normal forces have twice its frequency at least; a parabola through the three
# samples about a minimum is then off by a thousandth of what they vary.
SAMPLES = 16
SETTLED = 1e-3  # of the bounding orbit: what is not linear is a millionth of what is
SETTLED_ALONE = 1e-6  # the same where no orbit is known [rad]
_DECAY, _INSIDE = 0.75, 0.5
_NEAR = 0.25
# Relative difference below which two solutions are one circle: one is interpolated, with an error of some 1e-7.
_SAME_CIRCLE = 1e-4
# The greatest lean of a period is missed by 1 - cos(pi / 16) at most.
_RESOLVED = 0.02


def find_lost_contact(surface: Surface, motion: PreciseMotion) -> tuple[float, str] | None:
    """Return when the ground would first have to pull a wheel [s], and which; None if it never does.

    Between samples a minimum is that of a parabola through three of them.
    """
    found = []
    for wheel, pushing in zip(WHEELS, normal_forces(surface, motion.contact, motion.force).T, strict=True):
        time = _find_first_zero(motion.time, pushing)
        if time is not None:
            found.append((time, wheel))
    return min(found, default=None)


def _find_first_zero(times: np.ndarray, values: np.ndarray) -> float | None:
    """Return the first time at which values (n,) pass zero; None if they stay positive."""
    low = np.flatnonzero(~(values > 0))
    first = int(low[0]) if len(low) else len(values)
    a, b, c = values[:-2], values[1:-1], values[2:]
    bend = a - 2 * b + c
    with np.errstate(divide="ignore", invalid="ignore"):
        dips = (bend > 0) & (b <= np.minimum(a, c)) & (b - (c - a) ** 2 / (8 * bend) <= 0)
    dip = np.flatnonzero(dips[: max(first - 1, 0)])
    if len(dip) and dip[0] + 1 < first:
        k = int(dip[0])
        shift = 0.5 * (a[k] - c[k]) / bend[k]
        return float(times[k + 1] + shift * (times[k + 1] - times[k]))
    if not len(low):
        return None
    if first == 0:
        return float(times[0])
    before, after = values[first - 1], values[first]
    return float(times[first - 1] + before / (before - after) * (times[first] - times[first - 1]))


def judge_stretch(
    neighbours: StableNeighbours, motions: Sequence[PreciseMotion], energies: np.ndarray
) -> tuple[list[str | None], np.ndarray]:
    """Judge rides that have gone on through a stretch.

    Parameters
    ----------
    neighbours : StableNeighbours
    motions : sequence of PreciseMotion, length n
        With equal numbers of samples.
    energies : ndarray, shape (n,)
        [J].

    Returns
    -------
    kinds : list of str or None
        `RETURNED`, `ORBIT`, or None where it is neither yet.
    lean_amplitudes : ndarray, shape (n,)
        Of the second half [rad].
    """
    variables = np.array([independent(motion.q, motion.qd) for motion in motions])
    time = motions[0].time
    half = len(time) // 2
    leans = np.array([motion.q[:, LEAN] for motion in motions])
    amplitudes = np.stack([np.ptp(part, axis=1) / 2 for part in (leans[:, :half], leans[:, half:])])
    kinds: list[str | None] = [None] * len(motions)
    inside = neighbours.are_inside(energies)
    for k in np.flatnonzero(inside)[_have_returned(neighbours, variables[inside], energies[inside], time)]:
        kinds[k] = RETURNED
    middles = (leans[:, half:].max(axis=1) + leans[:, half:].min(axis=1)) / 2
    for orbits in neighbours.beyond:
        near = (energies > orbits.energy[0]) & (energies < orbits.energy[-1])
        size = np.sqrt(np.interp(energies, orbits.energy, orbits.amplitude**2))
        off = np.abs(amplitudes - size)
        centre = np.interp(energies, orbits.energy, orbits.centre)
        close = (off[1] <= _NEAR * size) & (np.abs(middles - centre) <= _NEAR * size)
        for k in np.flatnonzero(near & close & ((off[1] <= off[0]) | (off[1] <= _RESOLVED * size))):
            kinds[k] = ORBIT
    return kinds, amplitudes[1]


def _have_returned(
    neighbours: StableNeighbours, variables: np.ndarray, energies: np.ndarray, time: np.ndarray
) -> np.ndarray:
    """Return which rides, variables (n, m, 7) of energies (n,) of stable circles, have returned to them, shape (n,)."""
    nearest = np.abs(neighbours.energies - energies[:, None]).argmin(axis=1)
    forms = np.array([neighbours.modes[k].forms for k in nearest]).reshape(-1, 2, 7, 7)
    decay = np.array([-neighbours.modes[k].slowest.real for k in nearest])
    deviations = variables - neighbours.interpolate_circles(energies)[:, None, :]
    first, second = _mean_sizes(forms, deviations)
    bounds = neighbours.bounds_at(energies)
    small = np.isnan(bounds) | (second[:, 1] <= _INSIDE * bounds)
    settled = second[:, 1] <= np.where(np.isnan(bounds), SETTLED_ALONE, SETTLED * bounds)
    return (_have_decayed(first, second, decay, time) & small) | settled


def _mean_sizes(forms: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the root mean squares (n, 2) of the sizes of deviations (n, m, 7) over both halves."""
    sizes, half = deviation_sizes(forms, deviations), deviations.shape[1] // 2
    first, second = (np.sqrt(np.mean(part**2, axis=2)) for part in (sizes[:, :, :half], sizes[:, :, half:]))
    return first, second


def _have_decayed(first: np.ndarray, second: np.ndarray, decay: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return which rides (n,) decay at three quarters of the slowest mode's rate ``decay`` (n,) [1/s] at least."""
    half = len(time) // 2
    span = float(time[half:].mean() - time[:half].mean())
    return np.all(second <= first * np.exp(-_DECAY * decay * span)[:, None], axis=1)


def _is_predicted(neighbours: StableNeighbours, circle: np.ndarray, energy: float) -> bool:
    """Return whether a circle (7,) of an energy [J] is the section's, to which a ride may be about to return."""
    level = np.array([energy])
    if not neighbours.are_inside(level)[0]:
        return False
    apart = np.abs(circle - neighbours.interpolate_circles(level)[0])
    return bool(np.all(apart <= _SAME_CIRCLE * (1 + np.abs(circle))))


def settles_elsewhere(neighbours: StableNeighbours, motion: PreciseMotion, energy: float) -> bool:
    """Return whether a ride returns to a stable circle of its energy [J] that is none of the section's.

    The circle is solved for from the ride's last state.
    """
    variables = independent(motion.q, motion.qd)
    try:
        circle = neighbours.solve_circle(variables[-1], energy)
        modes = neighbours.linearise_circle(circle)
    except ValueError:
        return False
    if not modes.slowest.real < 0 or _is_predicted(neighbours, circle, energy):
        return False
    first, second = _mean_sizes(modes.forms[None], (variables - circle)[None])
    decay = np.array([-modes.slowest.real])
    return bool(_have_decayed(first, second, decay, motion.time)[0] or second[0, 1] <= SETTLED_ALONE)
