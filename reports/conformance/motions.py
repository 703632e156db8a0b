"""The motions that an engine is examined on: nothing in them is zero or at rest, so that no sign hides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...engines.engine import REFERENCE, Problem, Trajectory
from ...reference.bicycle import Bicycle
from ...reference.contact import observe
from ...reference.dae import consistent_state
from ...reference.height_field import HeightField
from ...reference.kinematics import FRONT_ANGLE, REAR_ANGLE, body_positions, body_quaternions
from ...reference.simulate import simulate
from ...reference.stability import growth_rate, linearise
from ...reference.surface import Paraboloid, Plane, Surface
from ..measure import Scale

_INTERVAL, _SAMPLES = 0.01, 24
STEPS_AN_INTERVAL = 4  # divide every output interval, so that steps up to four times as long fit too
_REAR_RATE = 14.0  # some 4.5 m/s, where a benchmark bicycle upright is stable
_KNOTS = np.arange(-8.0, 8.1, 2.0)
# One unit in the last place.
_ABOVE = 1 + 2.0**-52


def waves() -> HeightField:
    """Ground without any symmetry, waves of some 10 cm."""
    heights = 0.1 * np.sin(0.5 * _KNOTS[:, None] + 0.3) * np.cos(0.45 * _KNOTS - 0.4)
    return HeightField(heights.tolist(), 2.0, (-8.0, -8.0))


GROUNDS: dict[str, Callable[[], Surface]] = {"plane": Plane, "bowl": lambda: Paraboloid(0.02), "waves": waves}
OTHER_BICYCLE = replace(
    Bicycle(),
    wheelbase=1.1,
    trail=0.06,
    steer_axis_tilt=0.35,
    rear_wheel_radius=0.33,
    rear_wheel_Ixx=0.1,
    rear_wheel_Iyy=0.2,
    rear_frame_z=0.95,
    rear_frame_mass=70.0,
)


@dataclass(frozen=True)
class Motion:
    """A problem and the reference's ride of it.

    Attributes
    ----------
    name : str
        Of the ground.
    problem : Problem
    exact : Trajectory
        The reference's ride.
    round_off : Trajectory
        The reference's ride from a start in which every number is one unit in the last place larger.
    scale : Scale
        Sizes of the motion, its growth rate included.
    """

    name: str
    problem: Problem
    exact: Trajectory
    round_off: Trajectory
    scale: Scale

    @property
    def size(self) -> float:
        """Of the motion: the wheelbase [m]."""
        return self.problem.bicycle.wheelbase


def output_times(step: float | None) -> np.ndarray:
    """Times of the samples [s]: a grid that a step divides, also a four times longer one."""
    interval = _INTERVAL
    if step is not None:
        coarse = STEPS_AN_INTERVAL * step
        interval = coarse * max(1, round(np.ceil(_INTERVAL / coarse - 1e-9)))
    return interval * np.arange(_SAMPLES + 1)


def awkward_times(times: np.ndarray) -> np.ndarray:
    """Half as many times whose interval no step divides that divides the interval of ``times``."""
    return float(np.sqrt(2)) * times[: len(times) // 2]


def make_problem(surface: Surface, bicycle: Bicycle, times: np.ndarray) -> Problem:
    """The start of a transient: everything leans, steers, turns and changes."""
    rates = (0.4, -0.5, _REAR_RATE)
    q, qd = consistent_state(bicycle, surface, (1.3, -0.7), 0.15, -0.12, rates, yaw=2.2)
    # A wheel is symmetric about its axle: it may stand at any angle.
    q[[REAR_ANGLE, FRONT_ANGLE]] = 0.7, -0.4
    return Problem(bicycle, surface, q, qd, times)


def make_motion(name: str, problem: Problem) -> Motion:
    """Let the reference ride a problem.

    Raises
    ------
    RuntimeError
        If the reference does not ride to the end.
    """
    exact = _ride(problem)
    shifted = _ride(replace(problem, q=_ABOVE * problem.q, qd=_ABOVE * problem.qd))
    bicycle, qd = problem.bicycle, problem.qd
    upright = consistent_state(bicycle, Plane(), (0.0, 0.0), 0.0, 0.0, (0.0, 0.0, _REAR_RATE))
    growth = growth_rate(Plane(), linearise(bicycle, Plane(), *upright).eigenvalues, 0.0)
    scale = Scale.of(bicycle, qd, bicycle.wheelbase, growth, float(problem.times[-1]))
    return Motion(name, problem, exact, shifted, scale)


def _ride(problem: Problem) -> Trajectory:
    bicycle, surface = problem.bicycle, problem.surface
    found = simulate(bicycle, surface, problem.q, problem.qd, problem.times)
    if found.ended is not None:
        raise RuntimeError(f"the reference ends at {found.time[-1]:.6g} s: {found.ended}")
    seen = observe(bicycle, surface, found.q, found.qd, found.contact)
    return Trajectory(
        engine=REFERENCE,
        version="",
        settings={},
        time=problem.times.copy(),
        q=found.q,
        qd=found.qd,
        body_position=body_positions(bicycle, found.q),
        body_quaternion=body_quaternions(bicycle, found.q),
        contact_point=seen.point,
        contact_force=found.force,
        gap=seen.gap,
        slip=seen.slip,
        kinetic_energy=seen.kinetic_energy,
        potential_energy=seen.potential_energy,
        steps=found.steps,
        cpu_time=0.0,
    )
