"""Step a MuJoCo model through a ride and record its samples."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from math import isfinite
from time import thread_time

import mujoco
import numpy as np

from ...reference.bicycle import BODIES, Bicycle
from ...reference.fall import LOOK_INTERVAL, Ending, Fall, FallWatch, fall_criterion, find_first_ending
from ...reference.kinematics import WHEELS, constants
from ...reference.rim import RimWatch, bicycle_rim_search
from ..engine import EngineError, Problem, Progress
from .bound import bind_kernel
from .convergence import SolverConvergence, UnknownConvergence, share
from .library import read_energy
from .model import Touching, mjcf
from .releases import ENERGY, PLANES, is_present
from .settings import StepSettings
from .state import from_mujoco, to_mujoco
from .tangent import find_height, wheel_poses

Convergence = SolverConvergence | UnknownConvergence

REPORT_INTERVAL = 0.05
UNSTABLE = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


@dataclass(frozen=True)
class Recording:
    """The n samples of a ride.

    Attributes
    ----------
    time : ndarray, shape (n,)
        MuJoCo's time [s].
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
        """Return arrays for n samples, filled with zeros."""
        shapes = ((n,), (n, 10), (n, 9), (n, 4, 3), (n, 4, 4), (n, 2, 3), (n, 2))
        return cls(*(np.zeros(shape) for shape in shapes))

    def first(self, n: int) -> Recording:
        """Return the first n samples."""
        return Recording(*(getattr(self, name)[:n] for name in self.__dataclass_fields__))


class HeightLook:
    """Look for the fall of the bicycle in MuJoCo's state.

    Parameters
    ----------
    data : mujoco.MjData
    problem : Problem
    """

    def __init__(self, data: mujoco.MjData, problem: Problem) -> None:
        self._data, self._start = data, problem.q
        self.watch: FallWatch[tuple[np.ndarray, np.ndarray]] = FallWatch(
            problem.bicycle, problem.surface, self._convert
        )
        function, parameters = problem.surface.function.real, problem.surface.parameters
        self._height = bind_kernel(find_height, data.qpos, fall_criterion(problem.bicycle), function, parameters)

    def __call__(self, time: float) -> Ending | None:
        """Return when and why the ride ends, None if it does not."""
        if not self.watch.is_due(time):
            return None
        return self.watch.look(time, self._height(), (self._data.qpos.copy(), self._data.qvel.copy()))

    def _convert(
        self, times: np.ndarray, states: tuple[tuple[np.ndarray, np.ndarray], ...]
    ) -> tuple[np.ndarray, np.ndarray]:
        qpos, qvel = (np.array(part) for part in zip(*states, strict=True))
        return from_mujoco(times, qpos, qvel, self._start)


@dataclass(frozen=True)
class RideLook:
    """Look at the rims of both wheels, and for the fall of the bicycle unless ``height`` is None."""

    rims: Callable[[float], Ending | None]
    height: HeightLook | None

    def __call__(self, time: float) -> Ending | None:
        """Return when and why the ride ends at a time [s], None if it goes on."""
        return find_first_ending(self.rims(time), None if self.height is None else self.height(time))

    @property
    def near(self) -> bool:
        """Whether the bicycle is so near its fall that every step is to be looked at."""
        return self.height is not None and self.height.watch.near


@dataclass(frozen=True)
class Rig:
    """A model with its state and its contact with the ground.

    Attributes
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
    bodies : list of int
        MuJoCo's ids of the four bodies, in the order of `BODIES`.
    wheels : dict of int
        Wheel, 0 rear and 1 front, by MuJoCo's id of its geom.
    follow : callable
        Updates the contacts. To be called before the first step and after each for which `is_due` says so; returns
        False if a wheel has no contact point.
    stride : int
        Counted from the start, so that the end of a ride does not depend on the output times.
    look : RideLook
        Checks the rims, and whether the bicycle has fallen. To be called after ``follow``, with the time [s].
    forces : callable
        Fills an array (2, 3) with the contact forces of the last evaluation, inertial axes [N].
    callbacks : callable
        Returns the context in which the model may be stepped; it yields the solver's convergence.
    judged : bool
        Whether that convergence is known; after MuJoCo's noslip pass, and where nobody watches, it is not.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    bodies: list[int]
    wheels: dict[int, int]
    follow: Callable[[], bool]
    stride: int
    look: RideLook
    forces: Callable[[np.ndarray], None]
    callbacks: Callable[[], AbstractContextManager[Convergence]]
    judged: bool = True

    def is_due(self, steps: int) -> bool:
        """Return whether to follow the ground and to look after a number of steps: at all of them near a fall."""
        return steps % self.stride == 0 or self.look.near


@dataclass(frozen=True)
class RideState:
    """Result of a ride.

    Attributes
    ----------
    recording : Recording
        The samples that were reached.
    steps : int
    cpu_time : float
        CPU time of the steps, in their thread [s].
    ended : str or None
        Why the ride ended early.
    unconverged_steps : int or None
        Steps in which MuJoCo's contact solver stopped before it had converged; None where this is not known.
    largest_residual : float or None
        Largest residual of that solver, relative to the forces; None also where there is no solver.
    fall : Fall or None
        The states around the fall that ended the ride.
    """

    recording: Recording
    steps: int
    cpu_time: float
    ended: str | None
    unconverged_steps: int | None
    largest_residual: float | None
    fall: Fall | None = None


def set_start(problem: Problem, settings: StepSettings, touching: Touching) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return the model and its state at the start of a problem, with the problem's torques as applied forces.

    Raises
    ------
    EngineError
        If MuJoCo refuses the model.
    """
    # Callers may change their model.
    model = copy(_compile_model(_ModelKey(problem.bicycle, settings, touching, problem.inputs.steer_damping)))
    if not is_present(ENERGY):
        model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = to_mujoco(problem.q, problem.qd)
    for joint, torque in (("steer", problem.inputs.steer_torque), ("rear_angle", problem.inputs.rear_wheel_torque)):
        data.qfrc_applied[model.jnt_dofadr[_find_id(model, "JOINT", joint)]] = torque
    return model, data


class _ModelKey:
    """Arguments of `mjcf`, equal only if they are to the bit: parameters such as 0.0 and -0.0 compare as equal."""

    def __init__(self, bicycle: Bicycle, settings: StepSettings, touching: Touching, steer_damping: float) -> None:
        self.arguments = bicycle, settings, touching, steer_damping
        self._text = f"{self.arguments!r} {PLANES.installed}"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ModelKey) and self._text == other._text

    def __hash__(self) -> int:
        return hash(self._text)


@lru_cache(maxsize=16)
def _compile_model(key: _ModelKey) -> mujoco.MjModel:
    try:
        return mujoco.MjModel.from_xml_string(mjcf(*key.arguments))
    except ValueError as error:
        raise EngineError(f"MuJoCo refuses the bicycle: {error}") from error


def _find_id(model: mujoco.MjModel, kind: str, name: str) -> int:
    """Return MuJoCo's id of a body, joint or geom; MuJoCo's views by name take ten times as long in a new model."""
    return mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), name)


def make_look(data: mujoco.MjData, problem: Problem, every: int = 1) -> RideLook:
    """Return the look at both rims and at the height of the bicycle for a `Rig`.

    It looks at the rims in one of ``every`` calls, and at the height about every `LOOK_INTERVAL`.

    Raises
    ------
    EngineError
        If a rim lies inside the ground at the start.
    """
    rims = _look_at_rims(data, problem, every)
    return RideLook(rims, None if problem.beyond_fall else HeightLook(data, problem))


def _look_at_rims(data: mujoco.MjData, problem: Problem, every: int) -> Callable[[float], Ending | None]:
    try:
        watch = RimWatch(problem.bicycle, problem.surface, problem.q)
    except ValueError as error:
        raise EngineError(str(error)) from error
    if not watch.needed:
        return lambda _: None
    calls, pose = count(), bind_kernel(wheel_poses, data.qpos, constants(problem.bicycle), watch.centre, watch.axle)

    def look(time: float) -> Ending | None:
        if next(calls) % every:
            return None
        pose()
        return watch.look(time)

    return look


def look_stride(step: float) -> int:
    """Return the number of steps in `LOOK_INTERVAL`."""
    return max(1, int(LOOK_INTERVAL / step))


def rim_stride(problem: Problem, step: float) -> int:
    """Return the number of steps between two checks of the wheels where only their rims need checking.

    Where the ground is less than half as curved as a wheel, a rim touches twice only when the wheel nearly lies flat.
    """
    largest = max(problem.bicycle.rear_wheel_radius, problem.bicycle.front_wheel_radius)
    sharpest = bicycle_rim_search(problem.bicycle, problem.surface).bends.max() * largest
    return look_stride(step) if sharpest < 0.5 else 1


def bodies(model: mujoco.MjModel) -> list[int]:
    """Return MuJoCo's ids of the four bodies, in the order of `BODIES`."""
    return [_find_id(model, "BODY", name) for name in BODIES]


def wheel_geoms(model: mujoco.MjModel) -> dict[int, int]:
    """Return the wheel, 0 rear and 1 front, by MuJoCo's id of its geom."""
    return {_find_id(model, "GEOM", name): k for k, name in enumerate(WHEELS)}


def read_contact_forces(model: mujoco.MjModel, data: mujoco.MjData, wheels: dict[int, int], out: np.ndarray) -> None:
    """Fill ``out`` (2, 3) with MuJoCo's contact forces on the wheels, inertial axes [N]; zero without contact."""
    out[:] = 0
    wrench = np.empty(6)
    contacts = data.contact
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, wrench)
        # The frame's rows are its axes; the normal points from the plane, the first geom, to the wheel.
        out[wheels[int(contacts.geom[i, 1])]] += contacts.frame[i].reshape(3, 3).T @ wrench[:3]


def record_sample(rig: Rig, recording: Recording, k: int) -> None:
    """Record sample k at the current state.

    Poses, forces and energies are outdated after a step, so everything is computed anew. `mj_forward` does not change
    the solver's warm start, so this does not affect the next step.
    """
    data = rig.data
    mujoco.mj_forward(rig.model, data)
    mujoco.mj_energyPos(rig.model, data)
    mujoco.mj_energyVel(rig.model, data)
    recording.time[k], recording.qpos[k], recording.qvel[k] = data.time, data.qpos, data.qvel
    recording.position[k], recording.quaternion[k] = data.xipos[rig.bodies], data.xquat[rig.bodies]
    recording.energy[k] = read_energy(data)
    rig.forces(recording.force[k])


def find_trouble(data: mujoco.MjData, standing: bool) -> str | None:
    """Return why the ride cannot continue; None if it can."""
    # MuJoCo checks a state only before it steps from it: the last state has not been checked yet.
    finite = all(map(isfinite, data.qpos.tolist())) and all(map(isfinite, data.qvel.tolist()))
    if not finite or any(data.warning[kind].number for kind in UNSTABLE):
        return "MuJoCo's state became infinite or huge"
    return None if standing else "a wheel lies flat or has no contact point with the surface"


def find_unconverged(convergence: Convergence, step: float) -> str | None:
    """Return when and how far MuJoCo's contact solver failed to converge; None if its forces are usable."""
    convergence.look()
    if convergence.wrong is None:
        return None
    steps, residual = convergence.wrong
    return f"MuJoCo's contact solver stopped unconverged at {steps * step:.6g} s: {share(residual)}"


def advance(rig: Rig, step: float, steps: int, until: int) -> tuple[int, bool, Ending | None]:
    """Step from ``steps`` to ``until`` steps of length ``step``, or until the wheels leave the ground.

    Returns the number of steps, whether the wheels have contact, and why the ride ends if a rim touches twice or the
    bicycle falls.
    """
    while steps < until:
        more = 1 if rig.look.near else min(until - steps, rig.stride - steps % rig.stride)
        mujoco.mj_step(rig.model, rig.data, more)
        steps += more
        if rig.is_due(steps):
            standing, ending = rig.follow(), rig.look(steps * step)
            if ending is not None or not standing:
                return steps, standing, ending
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
    """Integrate from the current state of a rig.

    Parameters
    ----------
    rig : Rig
    step : float
        Time step [s].
    counts : list of int
        Number of steps from the start to each output time.
    progress : callable

    Raises
    ------
    EngineError
        If a wheel has no contact point at the start, or MuJoCo's contact solver fails there.
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
        samples, steps, cpu_time, ended, fall = _continue_ride(rig, step, counts, progress, recording, convergence)
        return RideState(
            recording=recording.first(samples),
            steps=steps,
            cpu_time=cpu_time,
            ended=ended,
            # The last sample is evaluated too; that evaluation belongs to a step that is not taken.
            unconverged_steps=min(convergence.unconverged, steps) if rig.judged else None,
            largest_residual=convergence.largest if rig.judged else None,
            fall=fall,
        )


def _continue_ride(
    rig: Rig, step: float, counts: list[int], progress: Progress, recording: Recording, convergence: Convergence
) -> tuple[int, int, float, str | None, Fall | None]:
    """Continue from the first sample; return samples, steps, their CPU time [s], why the ride ended, and a fall."""
    steps, cpu_time, reported = 0, 0.0, 0
    steps_per_report = max(1, int(REPORT_INTERVAL / step))
    for k in range(1, len(counts)):
        while steps < counts[k]:
            convergence.begin(steps)
            begun = thread_time()
            steps, standing, touch = advance(rig, step, steps, min(steps + steps_per_report, counts[k]))
            cpu_time += thread_time() - begun
            ended = find_trouble(rig.data, standing)
            # An unconverged solver may be the cause of other trouble, so it is reported first.
            if (stopped := find_unconverged(convergence, step)) is not None:
                return k, steps, cpu_time, stopped, None
            # A wheel that has lost its contact may do so because the bicycle has fallen.
            if touch is not None and (ended is None or touch.fall is not None):
                # The end may lie before the last sample.
                samples = max(1, bisect_right(counts[:k], touch.time / step))
                return samples, steps, cpu_time, touch.why, touch.fall
            if ended is not None:
                return k, steps, cpu_time, f"{ended} at {steps * step:.6g} s", None
            if steps - reported >= steps_per_report:
                reported = steps
                progress(steps * step)
        convergence.begin(steps)
        record_sample(rig, recording, k)
        if (stopped := find_unconverged(convergence, step)) is not None:
            return k, steps, cpu_time, stopped, None
    return len(counts), steps, cpu_time, None, None
