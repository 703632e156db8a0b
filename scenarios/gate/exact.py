"""What a gated ride is measured against: the exact motion, or the reference's precise ride with its known error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import REFERENCE, Problem, Settings, Trajectory, load_engine
from ...reference.height_field import HeightField
from ...reference.profile import SplineProfile
from ...reference.surface import Surface
from ...reports.measure import Scale, relative_differences, state_error, steady_trajectory
from ..error import ScenarioError
from ..scenario import Start

# Of the reference's step: an eighth-order method's error is a tenth at 3/4 of it.
_FINER = 0.75
# Of the reference's ride, some milliseconds each: the least CPU time of so many is its cost.
_CPU_REPEATS = 5
# Equal to the last bit in a few samples may be chance where hardly anything changes.
_MANY_SAMPLES = 10


@dataclass(frozen=True)
class Exact:
    """What is known of a gated ride.

    Attributes
    ----------
    trajectory : Trajectory
        The ride that engines are measured against.
    error : float
        Its own largest error, relative to the motion's sizes as in
        `velodrome.reports.measure.inspection.relative_differences`; 0 for a motion in closed form, whose start alone
        has an error.
    computed : tuple of Trajectory
        The reference's rides, at its own settings and at finer ones.
    round_off : Trajectory
        The reference's ride from a start in which every number is one unit in the last place larger.
    cpu_time : float
        Of the reference's ride [s].
    borders : int
        Borders between the pieces of a ground of splines that the wheels cross.
    """

    trajectory: Trajectory
    error: float
    computed: tuple[Trajectory, Trajectory]
    round_off: Trajectory
    cpu_time: float
    borders: int

    def is_copied_by(self, trajectory: Trajectory, scale: Scale) -> bool:
        """Whether a ride is one of the reference's, to the bit or but for noise.

        An engine that integrates by itself rounds its start to its own coordinates and every step after it. So its ride
        differs from the reference's by more than what one unit in the last place of the start alone, rounded only once,
        makes of the reference's own ride: what is closer was not integrated.
        """
        n = len(trajectory.time)
        if n < _MANY_SAMPLES:
            return False
        least = state_error(self.round_off.first(n), self.computed[0], scale)
        return any(state_error(trajectory, one, scale) <= least for one in self.computed)


def find_exact(start: Start) -> Exact:
    """Find what the engines' rides from a start are measured against.

    An undisturbed circular motion is known in closed form. Of any other ride the reference's at a tenth of its
    tolerance is taken; its error is at most what the tenfold tolerance or one unit in the last place of the start
    changes, whichever is more.

    Raises
    ------
    ScenarioError
        If the reference does not ride to the end.
    """
    engine, problem = load_engine(REFERENCE), start.problem
    own = engine.settings()
    rides = [_precise(problem, own) for _ in range(_CPU_REPEATS)]
    finer = _precise(problem, own.refined(_FINER))
    above = 1 + 2.0**-52
    shifted = _precise(replace(problem, q=above * problem.q, qd=above * problem.qd), own)
    cpu_time = min(one.cpu_time for one in rides)
    if start.motion is not None and all(map(np.array_equal, (problem.q, problem.qd), start.undisturbed)):
        trajectory, error = steady_trajectory(problem.bicycle, start.motion, problem.times), 0.0
    else:
        scale = scale_of(start)
        changes = [relative_differences(one, rides[0], scale) for one in (finer, shifted)]
        trajectory, error = finer, max(float(np.abs(change).max()) for change in changes)
    borders = _borders_crossed(problem.surface, rides[0])
    return Exact(trajectory, error, (rides[0], finer), shifted, cpu_time, borders)


def _borders_crossed(surface: Surface, trajectory: Trajectory) -> int:
    """Borders between pieces of the ground that the wheels' contacts cross from sample to sample."""
    assert trajectory.contact_point is not None
    across = trajectory.contact_point[..., :2]
    if isinstance(surface, HeightField):
        piece = np.floor((across - surface.origin) / surface.spacing)
    elif isinstance(surface, SplineProfile):
        piece = np.searchsorted(surface.radii, np.hypot(across[..., 0], across[..., 1]))
    else:
        return 0
    return int(np.abs(np.diff(piece, axis=0)).sum())


def scale_of(start: Start) -> Scale:
    """Sizes of the motion that a ride starts with."""
    problem = start.problem
    return Scale.of(problem.bicycle, problem.qd, start.size, start.growth_rate, float(problem.times[-1]))


def _precise(problem: Problem, settings: Settings) -> Trajectory:
    trajectory = ride_engine(load_engine(REFERENCE), problem, settings, lambda _: None)
    if trajectory.ended is not None:
        raise ScenarioError(f"the reference ends at {trajectory.time[-1]:.6g} s: {trajectory.ended}")
    return trajectory
