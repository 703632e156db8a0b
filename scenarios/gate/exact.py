"""The rides against which gated rides are measured: the exact motion, or the reference's ride with its known error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...engines.admission import ride_engine
from ...engines.engine import REFERENCE, Problem, Settings, Trajectory
from ...engines.registry import load_engine
from ...reference.height_field import HeightField
from ...reference.profile import SplineProfile
from ...reference.surface import Surface
from ...reports.measure import Scale, coordinate_differences, relative_differences, steady_trajectory
from ..error import ScenarioError
from ..scenario import Start

# Factor on the reference's step for the finer ride: the error of a method of order 8 is a tenth at 3/4 of the step.
_FINER_STEP = 0.75
# Number of the reference's rides, some milliseconds each, of which the least CPU time counts.
_CPU_REPEATS = 5
# Least number of samples: in fewer, where hardly anything changes, equality to the last bit may be chance.
_LEAST_SAMPLES = 10
# Units in the last place by which a ride that was integrated differs at least from another one, as a root mean square:
# conversions of its start alone round every number once or twice, and each of its steps does again.
_LEAST_UNITS = 4.0
_MOST_UNITS = 1e9  # that are told apart: a number near zero may differ by any number of its units


@dataclass(frozen=True)
class Exact:
    """Exact ride of a gated scenario, and what is known about it.

    Attributes
    ----------
    trajectory : Trajectory
        The ride against which engines are measured.
    error : float
        Its own largest error, relative to the motion's sizes as in
        `velodrome.reports.measure.inspection.relative_differences`; 0 for a motion in closed form, where only the
        start has an error.
    computed : tuple of Trajectory
        The reference's rides at its own settings and at finer ones.
    cpu_time : float
        CPU time of the reference's ride [s].
    borders : int
        Number of borders between the pieces of a ground of splines that the wheels cross.
    """

    trajectory: Trajectory
    error: float
    computed: tuple[Trajectory, Trajectory]
    cpu_time: float
    borders: int

    def is_copied_by(self, trajectory: Trajectory) -> bool:
        """Return whether a ride is one of the reference's, up to the last places of its numbers.

        An engine that integrates by itself rounds its start to its own coordinates and rounds in every step after it. A
        ride all of whose numbers agree with the reference's to a few units in the last place was not integrated. How
        much the motion amplifies round-off does not matter: by chance an engine's own may end closer to the reference
        than a ride of the reference from a start that is one unit off.
        """
        if len(trajectory.time) < _LEAST_SAMPLES:
            return False
        return any(_count_units(trajectory, ride) < _LEAST_UNITS for ride in self.computed)


def find_exact(start: Start) -> Exact:
    """Return the ride against which the engines' rides from a start are measured.

    An undisturbed circular motion is known in closed form. For any other ride, the exact ride is the reference's at a
    tenth of its tolerance. Its error is at most the change by the tenfold tolerance or by one unit in the last place of
    the start, whichever is larger.

    Raises
    ------
    ScenarioError
        If the reference does not ride to the end.
    """
    engine, problem = load_engine(REFERENCE), start.problem
    own = engine.settings()
    rides = [_ride_reference(problem, own) for _ in range(_CPU_REPEATS)]
    finer = _ride_reference(problem, own.refined(_FINER_STEP))
    rounded_up = 1 + 2.0**-52
    shifted = _ride_reference(replace(problem, q=rounded_up * problem.q, qd=rounded_up * problem.qd), own)
    cpu_time = min(ride.cpu_time for ride in rides)
    if start.motion is not None and all(map(np.array_equal, (problem.q, problem.qd), start.undisturbed)):
        trajectory, error = steady_trajectory(problem.bicycle, start.motion, problem.times), 0.0
    else:
        scale = scale_of(start)
        changes = [relative_differences(ride, rides[0], scale) for ride in (finer, shifted)]
        trajectory, error = finer, max(float(np.abs(change).max()) for change in changes)
    borders = _borders_crossed(problem.surface, rides[0])
    return Exact(
        trajectory=trajectory,
        error=error,
        computed=(rides[0], finer),
        cpu_time=cpu_time,
        borders=borders,
    )


def _count_units(trajectory: Trajectory, other: Trajectory) -> float:
    """Return the root mean square difference of two rides in units in the last place; zeros of both are left out."""
    n = len(trajectory.time)
    differences = np.array([coordinate_differences(trajectory, other), trajectory.qd - other.qd[:n]])
    numbers = np.array([other.q[:n], other.qd[:n]])
    units = np.minimum(np.abs(differences) / np.spacing(np.abs(numbers)), _MOST_UNITS)
    return float(np.sqrt(np.mean(units[(numbers != 0) | (differences != 0)] ** 2)))


def _borders_crossed(surface: Surface, trajectory: Trajectory) -> int:
    """Return the number of borders between pieces of the ground that the wheels' contacts cross between samples."""
    assert trajectory.contact_point is not None
    points = trajectory.contact_point[..., :2]
    if isinstance(surface, HeightField):
        piece = np.floor((points - surface.origin) / surface.spacing)
    elif isinstance(surface, SplineProfile):
        piece = np.searchsorted(surface.radii, np.hypot(points[..., 0], points[..., 1]))
    else:
        return 0
    return int(np.abs(np.diff(piece, axis=0)).sum())


def scale_of(start: Start) -> Scale:
    """Return the sizes of the motion on which a ride starts."""
    problem = start.problem
    return Scale.of(problem.bicycle, problem.qd, start.size, start.growth_rate, float(problem.times[-1]))


def _ride_reference(problem: Problem, settings: Settings) -> Trajectory:
    trajectory = ride_engine(load_engine(REFERENCE), problem, settings, lambda _: None)
    if trajectory.ended is not None:
        raise ScenarioError(f"the reference ends at {trajectory.time[-1]:.6g} s: {trajectory.ended}")
    return trajectory
