"""The ride itself: MuJoCo's steps, and what is measured on the way."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import count
from time import process_time

import mujoco
import numpy as np
from numba import typeof

from ...reference.bicycle import BODIES
from ...reference.kinematics import WHEELS, constants
from ...reference.rim import Ending, RimWatch, bicycle_rim_search
from ..engine import EngineError, Problem, Progress
from .convergence import SolverConvergence, share
from .model import Touching, mjcf
from .settings import StepSettings
from .state import to_mujoco
from .tangent import wheel_poses

REPORT_INTERVAL = 0.05
# How often a bicycle is looked at whose ground needs no care: a wheel turns by far less than half a turn meanwhile.
LOOK_INTERVAL = 0.01
UNSTABLE = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


@dataclass(frozen=True)
class Recording:
    """Samples of a ride, n of them.

    Attributes
    ----------
    time : ndarray, shape (n,)
        By MuJoCo's clock [s].
    qpos, qvel : ndarray, shapes (n, 10), (n, 9)
        MuJoCo's state.
    position, quaternion : ndarray, shapes (n, 4, 3), (n, 4, 4)
        Centres of mass [m] and orientations of the four bodies.
    force : ndarray, shape (n, 2, 3)
        Contact forces on the wheels, inertial axes [N].
    energy : ndarray, shape (n, 2)
        Potential and kinetic energy [J].
    """

    time: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    force: np.ndarray
    energy: np.ndarray

    @classmethod
    def empty(cls, n: int) -> Recording:
        """Room for n samples."""
        shapes = ((n,), (n, 10), (n, 9), (n, 4, 3), (n, 4, 4), (n, 2, 3), (n, 2))
        return cls(*(np.zeros(shape) for shape in shapes))

    def first(self, n: int) -> Recording:
        """The first n samples."""
        return Recording(*(getattr(self, name)[:n] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Rig:
    """A model with its state, and how it touches the ground.

    Attributes
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
    bodies : list of int
        MuJoCo's numbers of the four bodies, in the order of `BODIES`.
    wheels : dict of int
        From MuJoCo's number of a wheel's geom to the wheel, 0 rear and 1 front.
    follow : callable
        To be called every ``stride`` steps and before the first; False if a wheel has no contact point.
    stride : int
        Counted from the start, so that a ride ends where it ends whatever the output times.
    look : callable
        To be called after ``follow``, with the time [s]; says why the ride ends there, or None.
    forces : callable
        Fills an array (2, 3) with the contact forces of the last evaluation, inertial axes [N].
    callbacks : callable
        Gives the context in which the model may be stepped, with what is seen of the solver's convergence.
    judged : bool
        Whether that is all there is to see: after MuJoCo's noslip pass nobody can tell.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    bodies: list[int]
    wheels: dict[int, int]
    follow: Callable[[], bool]
    stride: int
    look: Callable[[float], Ending | None]
    forces: Callable[[np.ndarray], None]
    callbacks: Callable[[], AbstractContextManager[SolverConvergence]]
    judged: bool = True


@dataclass(frozen=True)
class RideState:
    """What became of a ride.

    Attributes
    ----------
    recording : Recording
        As many samples as were reached.
    steps : int
    cpu_time : float
        Process CPU time of the steps [s].
    ended : str or None
        Why the ride ended early.
    unconverged_steps : int or None
        Steps in which MuJoCo's contact solver stopped before it had converged; None where nobody can tell.
    largest_residual : float or None
        The most that it left, relative to the forces; None also where there is no solver.
    """

    recording: Recording
    steps: int
    cpu_time: float
    ended: str | None
    unconverged_steps: int | None
    largest_residual: float | None


def set_start(problem: Problem, settings: StepSettings, touching: Touching) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The model, and its state at the start of a problem.

    Raises
    ------
    EngineError
        If MuJoCo refuses the model.
    """
    try:
        model = mujoco.MjModel.from_xml_string(mjcf(problem.bicycle, settings, touching))
    except ValueError as error:
        raise EngineError(f"MuJoCo refuses the bicycle: {error}") from error
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = to_mujoco(problem.q, problem.qd)
    return model, data


def look_at_rims(data: mujoco.MjData, problem: Problem, every: int = 1) -> Callable[[float], Ending | None]:
    """Make the look at both rims of a `Rig`, which looks only at every so many calls.

    Raises
    ------
    EngineError
        If a rim lies inside the ground at the start.
    """
    try:
        watch = RimWatch(problem.bicycle, problem.surface, problem.q)
    except ValueError as error:
        raise EngineError(str(error)) from error
    if not watch.needed:
        return lambda _: None
    calls, arguments = count(), (data.qpos, constants(problem.bicycle), watch.centre, watch.axle)
    # Finding the types out at every call would take numba longer than MuJoCo its step.
    pose = partial(wheel_poses.compile(tuple(typeof(argument) for argument in arguments)), *arguments)

    def look(time: float) -> Ending | None:
        if next(calls) % every:
            return None
        pose()
        return watch.look(time)

    return look


def look_stride(step: float) -> int:
    """Steps in `LOOK_INTERVAL`."""
    return max(1, int(LOOK_INTERVAL / step))


def rim_stride(problem: Problem, step: float) -> int:
    """Steps between two looks at wheels whose ground needs no care but for their rims.

    Where the ground is less than half as curved as a wheel, a rim touches twice only when the wheel nearly lies flat.
    """
    largest = max(problem.bicycle.rear_wheel_radius, problem.bicycle.front_wheel_radius)
    sharpest = bicycle_rim_search(problem.bicycle, problem.surface).bends.max() * largest
    return look_stride(step) if sharpest < 0.5 else 1


def bodies(model: mujoco.MjModel) -> list[int]:
    """MuJoCo's numbers of the four bodies, in the order of `BODIES`."""
    return [model.body(name).id for name in BODIES]


def wheel_geoms(model: mujoco.MjModel) -> dict[int, int]:
    """From MuJoCo's number of a wheel's geom to the wheel, 0 rear and 1 front."""
    return {model.geom(name).id: k for k, name in enumerate(WHEELS)}


def read_contact_forces(model: mujoco.MjModel, data: mujoco.MjData, wheels: dict[int, int], out: np.ndarray) -> None:
    """Fill ``out`` (2, 3) with MuJoCo's contact forces on the wheels, inertial axes; zero without contact."""
    out[:] = 0
    wrench = np.empty(6)
    contacts = data.contact
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, wrench)
        # The frame's rows are its axes; the normal points from the plane, the first geom, to the wheel.
        out[wheels[int(contacts.geom[i, 1])]] += contacts.frame[i].reshape(3, 3).T @ wrench[:3]


def record_sample(rig: Rig, recording: Recording, k: int) -> None:
    """Measure sample k at the present state.

    Poses, forces and energies are stale after a step, so everything is computed anew. `mj_forward`
    leaves the solver's warm start alone: the next step does not know that it was called.
    """
    data = rig.data
    mujoco.mj_forward(rig.model, data)
    mujoco.mj_energyPos(rig.model, data)
    mujoco.mj_energyVel(rig.model, data)
    recording.time[k], recording.qpos[k], recording.qvel[k] = data.time, data.qpos, data.qvel
    recording.position[k], recording.quaternion[k] = data.xipos[rig.bodies], data.xquat[rig.bodies]
    recording.energy[k] = data.energy
    rig.forces(recording.force[k])


def find_trouble(data: mujoco.MjData, standing: bool) -> str | None:
    """Why the ride cannot go on; None if it can."""
    # MuJoCo looks at a state before it steps from it: the last one has not been seen yet.
    if any(data.warning[kind].number for kind in UNSTABLE) or not np.all(np.isfinite([*data.qpos, *data.qvel])):
        return "MuJoCo's state became infinite or huge"
    return None if standing else "a wheel lies flat or has no contact point with the surface"


def find_unconverged(convergence: SolverConvergence, step: float) -> str | None:
    """Where MuJoCo's contact solver gave forces that are none; None if it did not."""
    convergence.look()
    if convergence.wrong is None:
        return None
    steps, residual = convergence.wrong
    return f"MuJoCo's contact solver stopped unconverged at {steps * step:.6g} s: {share(residual)}"


def advance(rig: Rig, step: float, steps: int, until: int) -> tuple[int, bool, Ending | None]:
    """Go on from ``steps`` to ``until`` steps of length ``step``, or as far as the wheels roll on the ground.

    Returns the steps, whether the wheels stand, and why the ride ends if a rim touches the ground twice.
    """
    while steps < until:
        more = min(until - steps, rig.stride - steps % rig.stride)
        mujoco.mj_step(rig.model, rig.data, more)
        steps += more
        if steps % rig.stride == 0:
            if not rig.follow():
                return steps, False, None
            ending = rig.look(steps * step)
            if ending is not None:
                return steps, True, ending
    return steps, True, None


@contextmanager
def no_report() -> Iterator[None]:
    """Keep MuJoCo from writing its warnings to a log file in the current folder."""
    previous = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(previous)


def ride_rig(rig: Rig, step: float, counts: list[int], progress: Progress) -> RideState:
    """Integrate from the state that a rig is in.

    Parameters
    ----------
    rig : Rig
    step : float
        Time step [s].
    counts : list of int
        Steps from the start to each output time.
    progress : callable

    Raises
    ------
    EngineError
        If a wheel stands nowhere at the start, or MuJoCo's contact solver fails there.
    """
    recording = Recording.empty(len(counts))
    with no_report(), rig.callbacks() as convergence:
        mujoco.mj_forward(rig.model, rig.data)
        if not rig.follow():
            raise EngineError("a wheel has no contact point with the surface at the start")
        rig.look(0.0)
        record_sample(rig, recording, 0)
        ended = find_unconverged(convergence, step)
        if ended is not None:
            raise EngineError(ended)
        samples, steps, cpu_time, ended = _go_on(rig, step, counts, progress, recording, convergence)
        return RideState(
            recording=recording.first(samples),
            steps=steps,
            cpu_time=cpu_time,
            ended=ended,
            # The last sample is evaluated too, and begins a step that is not taken.
            unconverged_steps=min(convergence.unconverged, steps) if rig.judged else None,
            largest_residual=convergence.largest if rig.judged else None,
        )


def _go_on(
    rig: Rig, step: float, counts: list[int], progress: Progress, recording: Recording, convergence: SolverConvergence
) -> tuple[int, int, float, str | None]:
    """Ride on from the first sample; return the samples, the steps, their CPU time [s] and why it ended early."""
    steps, cpu_time, reported = 0, 0.0, 0
    most = max(1, int(REPORT_INTERVAL / step))
    for k in range(1, len(counts)):
        while steps < counts[k]:
            convergence.begin(steps)
            begun = process_time()
            steps, standing, touch = advance(rig, step, steps, min(steps + most, counts[k]))
            cpu_time += process_time() - begun
            ended = find_trouble(rig.data, standing)
            # A solver that has failed may be why the state is as it is.
            if (stopped := find_unconverged(convergence, step)) is not None:
                return k, steps, cpu_time, stopped
            if touch is not None and ended is None:
                # It may lie before the last sample.
                return max(1, bisect_right(counts[:k], touch.time / step)), steps, cpu_time, touch.why
            if ended is not None:
                return k, steps, cpu_time, f"{ended} at {steps * step:.6g} s"
            if steps - reported >= most:
                reported = steps
                progress(steps * step)
        convergence.begin(steps)
        record_sample(rig, recording, k)
        if (stopped := find_unconverged(convergence, step)) is not None:
            return k, steps, cpu_time, stopped
    return len(counts), steps, cpu_time, None
