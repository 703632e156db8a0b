"""The motions that an engine is examined on: no coordinate or rate in them is zero, so that every wrong sign shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ...engines.engine import REFERENCE, Problem, Trajectory
from ...reference.bicycle import Bicycle
from ...reference.contact import observe
from ...reference.dae import consistent_state
from ...reference.height_field import HeightField
from ...reference.inputs import NO_INPUTS, Inputs
from ...reference.kinematics import FRONT_ANGLE, REAR_ANGLE, body_positions, body_quaternions
from ...reference.simulate import simulate
from ...reference.stability import growth_rate, linearise
from ...reference.surface import Paraboloid, Plane, Surface
from ..measure import Scale

_INTERVAL = 0.01  # approximate output interval [s]
SAMPLES = 24
STEPS_AN_INTERVAL = 4  # steps per output interval, a multiple of which keeps steps up to four times as long possible
_REAR_RATE = 14.0  # [rad/s], about 4.5 m/s, where the upright benchmark bicycle is stable
_KNOTS = np.arange(-8.0, 8.1, 2.0)
# Factor that adds one unit in the last place.
_ABOVE = 1 + 2.0**-52


def waves() -> HeightField:
    """Make a ground without any symmetry, with waves of about 10 cm."""
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


# Each changes the ride by at least some percent, so that no mistake in one is hidden by the error of a step.
EXAMINED_INPUTS = Inputs(steer_torque=4.0, rear_wheel_torque=10.0, steer_damping=5.0)


@dataclass(frozen=True, eq=False)
class TransientMotion:
    """A problem and the reference's ride for it.

    Attributes
    ----------
    ground : str
        One of `GROUNDS`.
    problem : Problem
    exact : Trajectory
        The reference's ride.
    round_off : Trajectory
        The reference's ride from a start in which every number is one unit in the last place larger.
    scale : Scale
        Characteristic sizes of the motion, including its growth rate.
    """

    ground: str
    problem: Problem
    exact: Trajectory
    round_off: Trajectory
    scale: Scale

    @property
    def name(self) -> str:
        """Name of the ground, with notes if the bicycle is not the benchmark's and if there are inputs."""
        bicycle = "" if self.problem.bicycle == Bicycle() else ", another bicycle"
        return f"{self.ground}{bicycle}" + ("" if self.problem.inputs == NO_INPUTS else ", with inputs")

    @property
    def size(self) -> float:
        """Size of the motion: the wheelbase [m]."""
        return self.problem.bicycle.wheelbase

    @property
    def sizes(self) -> np.ndarray:
        """Sizes of the nine coordinates, shape (9,) [m, rad]."""
        return np.array([*3 * [self.size], *6 * [1.0]])


def output_interval(step: float | None) -> float:
    """Return an output interval of about 10 ms that the step, and a four times longer step, divides [s]."""
    if step is None:
        return _INTERVAL
    coarse = STEPS_AN_INTERVAL * step
    return coarse * max(1, round(np.ceil(_INTERVAL / coarse - 1e-9)))


def awkward_interval(interval: float) -> float:
    """Return an output interval that no step which divides ``interval`` divides [s]."""
    return float(np.sqrt(2)) * interval


@lru_cache(maxsize=16)
def make_problem(ground: str, bicycle: Bicycle, interval: float, samples: int, inputs: Inputs = NO_INPUTS) -> Problem:
    """Make a problem of a transient on one of the `GROUNDS`, in which the bicycle leans, steers and turns.

    Parameters
    ----------
    ground : str
    bicycle : Bicycle
    interval : float
        Time between outputs [s].
    samples : int
        Number of outputs after the start.
    inputs : Inputs
    """
    surface = GROUNDS[ground]()
    rates = (0.4, -0.5, _REAR_RATE)
    q, qd = consistent_state(bicycle, surface, (1.3, -0.7), 0.15, -0.12, rates, yaw=2.2)
    # A wheel is symmetric about its axle, so that its angle is free.
    q[[REAR_ANGLE, FRONT_ANGLE]] = 0.7, -0.4
    return Problem(bicycle, surface, q, qd, interval * np.arange(samples + 1), inputs)


@lru_cache(maxsize=16)
def make_motion(
    ground: str, bicycle: Bicycle, interval: float, samples: int = SAMPLES, inputs: Inputs = NO_INPUTS
) -> TransientMotion:
    """Make a problem with `make_problem` and simulate it with the reference.

    Raises
    ------
    RuntimeError
        If the reference does not ride to the end.
    """
    problem = make_problem(ground, bicycle, interval, samples, inputs)
    exact = _simulate_reference(problem)
    shifted = _simulate_reference(replace(problem, q=_ABOVE * problem.q, qd=_ABOVE * problem.qd))
    upright = consistent_state(bicycle, Plane(), (0.0, 0.0), 0.0, 0.0, (0.0, 0.0, _REAR_RATE))
    growth = growth_rate(Plane(), linearise(bicycle, Plane(), *upright).eigenvalues, 0.0)
    scale = Scale.of(bicycle, problem.qd, bicycle.wheelbase, growth, float(problem.times[-1]))
    return TransientMotion(ground, problem, exact, shifted, scale)


def _simulate_reference(problem: Problem) -> Trajectory:
    bicycle, surface = problem.bicycle, problem.surface
    found = simulate(bicycle, surface, problem.q, problem.qd, problem.times, inputs=problem.inputs)
    if found.ended is not None:
        raise RuntimeError(f"the reference ends at {found.time[-1]:.6g} s: {found.ended}")
    contact = observe(bicycle, surface, found.q, found.qd, found.contact)
    return Trajectory(
        engine=REFERENCE,
        version="",
        settings={},
        time=problem.times.copy(),
        q=found.q,
        qd=found.qd,
        body_position=body_positions(bicycle, found.q),
        body_quaternion=body_quaternions(bicycle, found.q),
        contact_point=contact.point,
        contact_force=found.force,
        gap=contact.gap,
        slip=contact.slip,
        kinetic_energy=contact.kinetic_energy,
        potential_energy=contact.potential_energy,
        steps=found.steps,
        cpu_time=0.0,
    )
