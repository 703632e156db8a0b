"""The ride itself: MuJoCo's steps, the planes that follow the wheels, and what is measured on the way."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import process_time

import mujoco
import numpy as np
from numba import typeof

from engines.engine import EngineError, Problem, Progress
from engines.mujoco.model import mjcf
from engines.mujoco.settings import NativeSettings
from engines.mujoco.state import to_mujoco
from engines.mujoco.tangent import place
from reference.bicycle import BODIES
from reference.kernels.dynamics import guess_contacts
from reference.kinematics import WHEELS, constants
from reference.surface import is_level

REPORT_INTERVAL = 0.05
# How often a bicycle on a resting plane is looked at: a wheel turns by far less than half a turn meanwhile.
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
    qpos, qvel : ndarray, shapes (n, 10), (n, 9)
        MuJoCo's state.
    position, quaternion : ndarray, shapes (n, 4, 3), (n, 4, 4)
        Centres of mass [m] and orientations of the four bodies.
    force : ndarray, shape (n, 2, 3)
        Contact forces on the wheels, inertial axes [N].
    energy : ndarray, shape (n, 2)
        Potential and kinetic energy [J].
    """

    qpos: np.ndarray
    qvel: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    force: np.ndarray
    energy: np.ndarray

    @classmethod
    def empty(cls, n: int) -> Recording:
        """Room for n samples."""
        shapes = ((n, 10), (n, 9), (n, 4, 3), (n, 4, 4), (n, 2, 3), (n, 2))
        return cls(*(np.zeros(shape) for shape in shapes))

    def first(self, n: int) -> Recording:
        """The first n samples."""
        return Recording(*(getattr(self, name)[:n] for name in self.__dataclass_fields__))


class Ground:
    """The planes under the wheels, and the contact parameters at which the next search starts.

    Parameters
    ----------
    problem : Problem
    data : mujoco.MjData
    moving : bool
        Whether the model has one moving plane a wheel; otherwise this only looks for the contacts.
    step : float
        Time step [s].

    Attributes
    ----------
    stride : int
        Steps from one `follow` to the next, counted from the start, so that a ride ends where it ends
        whatever the output times.
    """

    def __init__(self, problem: Problem, data: mujoco.MjData, moving: bool, step: float) -> None:
        self.stride = 1 if moving else max(1, int(LOOK_INTERVAL / step))
        position, quaternion = (data.mocap_pos, data.mocap_quat) if moving else (np.empty((2, 3)), np.empty((2, 4)))
        c, contact = constants(problem.bicycle), np.empty(6)
        function, parameters = problem.surface.function.real, problem.surface.parameters
        guess_contacts(problem.q, contact, function, parameters, c)
        self._arguments = (data.qpos, c, function, parameters, contact, position, quaternion)
        # The types never change, and finding them out takes numba longer than MuJoCo its step.
        self._place = place.compile(tuple(typeof(argument) for argument in self._arguments))

    def follow(self) -> bool:
        """Put the planes under the wheels where they are; False if a wheel has no contact point."""
        return self._place(*self._arguments)


@dataclass(frozen=True)
class Rig:
    """A model with its state and its ground.

    Attributes
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
    ground : Ground
    bodies : list of int
        MuJoCo's numbers of the four bodies, in the order of `BODIES`.
    wheels : dict of int
        From MuJoCo's number of a wheel's geom to the wheel, 0 rear and 1 front.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    ground: Ground
    bodies: list[int]
    wheels: dict[int, int]


def build(problem: Problem, settings: NativeSettings) -> Rig:
    """Everything at the start of a problem.

    Raises
    ------
    EngineError
        If MuJoCo refuses the model or a wheel has no contact point.
    """
    moving = not is_level(problem.surface)
    try:
        model = mujoco.MjModel.from_xml_string(mjcf(problem.bicycle, settings, moving))
    except ValueError as error:
        raise EngineError(f"MuJoCo refuses the bicycle: {error}") from error
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = to_mujoco(problem.q, problem.qd)
    ground = Ground(problem, data, moving, settings.step)
    if not ground.follow():
        raise EngineError("a wheel has no contact point with the surface at the start")
    bodies = [model.body(name).id for name in BODIES]
    return Rig(model, data, ground, bodies, {model.geom(name).id: k for k, name in enumerate(WHEELS)})


def contact_forces(rig: Rig, out: np.ndarray) -> None:
    """Fill ``out`` (2, 3) with MuJoCo's contact forces on the wheels, inertial axes; zero without contact."""
    out[:] = 0
    wrench = np.empty(6)
    contacts = rig.data.contact
    for i in range(rig.data.ncon):
        mujoco.mj_contactForce(rig.model, rig.data, i, wrench)
        # The frame's rows are its axes; the normal points from the plane, the first geom, to the wheel.
        out[rig.wheels[int(contacts.geom[i, 1])]] += contacts.frame[i].reshape(3, 3).T @ wrench[:3]


def record(rig: Rig, recording: Recording, k: int) -> None:
    """Measure sample k at the present state.

    Poses, forces and energies are stale after a step, so everything is computed anew. `mj_forward`
    leaves the solver's warm start alone: the next step does not know that it was called.
    """
    data = rig.data
    mujoco.mj_forward(rig.model, data)
    mujoco.mj_energyPos(rig.model, data)
    mujoco.mj_energyVel(rig.model, data)
    recording.qpos[k], recording.qvel[k] = data.qpos, data.qvel
    recording.position[k], recording.quaternion[k] = data.xipos[rig.bodies], data.xquat[rig.bodies]
    recording.energy[k] = data.energy
    contact_forces(rig, recording.force[k])


def trouble(data: mujoco.MjData, standing: bool) -> str | None:
    """Why the ride cannot go on; None if it can."""
    # MuJoCo looks at a state before it steps from it: the last one has not been seen yet.
    if any(data.warning[kind].number for kind in UNSTABLE) or not np.all(np.isfinite([*data.qpos, *data.qvel])):
        return "MuJoCo's state became infinite or huge"
    return None if standing else "a wheel lies flat or has no contact point with the surface"


def advance(rig: Rig, steps: int, until: int) -> tuple[int, bool]:
    """Go on from ``steps`` to ``until`` steps, or as far as there is ground; returns the steps and whether there is."""
    stride = rig.ground.stride
    while steps < until:
        count = min(until - steps, stride - steps % stride)
        mujoco.mj_step(rig.model, rig.data, count)
        steps += count
        if steps % stride == 0 and not rig.ground.follow():
            return steps, False
    return steps, True


@contextmanager
def silent() -> Iterator[None]:
    """Keep MuJoCo from writing its warnings to a log file in the current folder."""
    previous = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(previous)


def ride(
    problem: Problem, settings: NativeSettings, counts: list[int], progress: Progress
) -> tuple[Recording, int, float, str | None]:
    """Integrate a problem.

    Parameters
    ----------
    problem : Problem
    settings : NativeSettings
    counts : list of int
        Steps from the start to each output time.
    progress : callable

    Returns
    -------
    Recording
        As many samples as were reached.
    steps : int
    cpu_time : float
        Process CPU time of the steps [s].
    ended : str or None
        Why the ride ended early.
    """
    rig = build(problem, settings)
    recording = Recording.empty(len(counts))
    steps, cpu_time, reported = 0, 0.0, 0
    most = max(1, int(REPORT_INTERVAL / settings.step))
    with silent():
        record(rig, recording, 0)
        for k in range(1, len(counts)):
            while steps < counts[k]:
                begun = process_time()
                steps, standing = advance(rig, steps, min(steps + most, counts[k]))
                cpu_time += process_time() - begun
                ended = trouble(rig.data, standing)
                if ended is not None:
                    return recording.first(k), steps, cpu_time, f"{ended} at {steps * settings.step:.6g} s"
                if steps - reported >= most:
                    reported = steps
                    progress(steps * settings.step)
            record(rig, recording, k)
    return recording, steps, cpu_time, None
