"""Ride a bicycle in MuJoCo Warp: put the model and its start there, step, follow the ground, record.

The order of `mujoco_warp.step` is turned round: a step integrates from an evaluated state and evaluates the new one, so
that what is sampled at a state is what the next step starts from. Poses of tangent planes and the wheels' standing come
from the suite's own search in double precision, at the state that MuJoCo Warp gives. All rides of a batch are equal, so
that the planes are those of the ride whose results are given.
"""

# MuJoCo Warp is an extra, without which its types are not known; MuJoCo's compiled bindings carry none.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from time import process_time
from typing import Any

import mujoco
import mujoco_warp
import numpy as np
import warp

from ...reference.fall import Ending, Fall
from ...reference.surface import is_level
from ..engine import EngineError, Problem, Progress
from ..mujoco.convergence import share
from ..mujoco.planes import build_planes
from ..mujoco.ride import REPORT_INTERVAL, Recording, RideState, Rig
from ..mujoco.settings import WRONG
from .evaluation import Evaluation
from .settings import SINGLE, WarpSettings

# Numbers beyond this are a failure, as MuJoCo's own mjMAXVAL says.
_HUGE = 1e10
# Contacts and constraint rows of one ride for which there is room: a wheel has one contact of three or four rows.
CONTACTS, ROWS = 2, 8
# A gap is the difference of coordinates with some roundings each.
_GAP_ROUNDINGS = 4
_INTEGRATE = {
    "Euler": mujoco_warp.euler,
    "implicit": mujoco_warp.implicit,
    "implicitfast": mujoco_warp.implicit,
    "RK4": mujoco_warp.rungekutta4,
}


@dataclass
class WarpRide:
    """A ride in MuJoCo Warp with what follows it in MuJoCo.

    Attributes
    ----------
    rig : Rig
        The model in MuJoCo, which follows the ground; its state has the poses of the given ride.
    settings : WarpSettings
    model : mujoco_warp.Model
    data : mujoco_warp.Data
    steps : int
        Steps taken.
    standing : bool
        Whether both wheels stand on the ground, as far as looked at.
    touch : Ending or None
        Why the ride ends if a rim touches twice or the bicycle falls.
    unconverged : int
        Number of evaluations of new states whose residual counts as unconverged.
    largest : float
        Largest relative residual of the contact solver.
    """

    rig: Rig
    settings: WarpSettings
    model: Any
    data: Any
    steps: int = 0
    standing: bool = True
    touch: Ending | None = None
    unconverged: int = 0
    largest: float = 0.0

    def begin(self) -> Evaluation:
        """Evaluate the start.

        Raises
        ------
        EngineError
            If a wheel has no contact point, or the forces there are wrong.
        """
        if not self.rig.follow():
            raise EngineError("a wheel has no contact point with the surface at the start")
        self.rig.look(0.0)
        self._move_planes()
        return self._evaluate()

    def step(self) -> Evaluation:
        """Take a step from an evaluated state, and evaluate the new one."""
        _INTEGRATE[self.settings.integrator](self.model, self.data)
        self.steps += 1
        if self.rig.is_due(self.steps):
            for name in ("qpos", "qvel"):
                getattr(self.rig.data, name)[:] = getattr(self.data, name).numpy()[self.settings.batch_place]
            if self.standing and np.all(np.abs(self.rig.data.qpos) < _HUGE):
                self.standing = self.rig.follow()
                self.touch = self.rig.look(self.steps * self.settings.step)
                self._move_planes()
        here = self._evaluate()
        self.unconverged += here.residual > self.settings.converged_below
        return here

    def _move_planes(self) -> None:
        here, there = self.rig.data, self.data
        for given, taken in ((here.mocap_pos, there.mocap_pos), (here.mocap_quat, there.mocap_quat)):
            if given.size:
                taken.assign(np.broadcast_to(given.astype(np.float32), (there.nworld, *given.shape)))

    def _evaluate(self) -> Evaluation:
        mujoco_warp.forward(self.model, self.data)
        here = Evaluation(self.rig, self.model, self.data, self.settings.batch_place)
        self.largest = max(self.largest, here.residual) if np.isfinite(here.residual) else self.largest
        return here

    def find_trouble(self, here: Evaluation) -> str | None:
        """Return why the ride cannot go on from an evaluation; None if it can."""
        at = f"at {self.steps * self.settings.step:.6g} s"
        if here.overflow is not None:
            return f"MuJoCo Warp has more {here.overflow} {at}, and leaves out the others"
        if not np.all(np.abs([*here.qpos, *here.qvel]) < _HUGE):
            return f"MuJoCo Warp's state became infinite or huge {at}"
        if not here.residual <= WRONG:
            return f"MuJoCo Warp's contact solver stopped unconverged {at}: {share(here.residual)}"
        return None if self.standing else f"a wheel lies flat or has no contact point with the surface {at}"


def build_ride(problem: Problem, settings: WarpSettings) -> WarpRide:
    """Put the model and its state at the start of a problem into MuJoCo Warp, on the current device.

    Raises
    ------
    EngineError
        If MuJoCo or MuJoCo Warp refuses the model, or a wheel has no contact point.
    """
    rig = build_planes(problem, settings)
    # MuJoCo Warp resets no state, and refuses the flag that forbids it.
    rig.model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    rig.model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    rig.model.pair_margin[:] = _find_margin(problem)
    size = settings.batch_size
    try:
        model = mujoco_warp.put_model(rig.model)
        data = mujoco_warp.put_data(rig.model, rig.data, nworld=size, nconmax=CONTACTS, njmax=ROWS)
    except (NotImplementedError, ValueError) as error:
        raise EngineError(f"MuJoCo Warp refuses the bicycle: {error}") from error
    # What does not fit is refused here; on stdout it would spoil what is printed there.
    model.opt.warn_overflow = 0
    # On GPUs the order of sums would otherwise change from run to run.
    model.opt.deterministic = int(mujoco_warp.DeterminismType.ALL)
    return WarpRide(rig, settings, model, data)


def _find_margin(problem: Problem) -> float:
    """Return the distance up to which a wheel counts as touching the ground [m].

    The gaps of a start that fulfils the constraints are round-off, here that of single precision, of either sign. On
    level ground they are differences of heights alone.
    """
    coordinates = problem.q[2:3] if is_level(problem.surface) else problem.q[:3]
    return _GAP_ROUNDINGS * SINGLE * max(1.0, float(np.abs(coordinates).max()))


def ride_in_warp(problem: Problem, settings: WarpSettings, counts: list[int], progress: Progress) -> RideState:
    """Integrate a problem.

    Parameters
    ----------
    problem : Problem
    settings : WarpSettings
    counts : list of int
        Number of steps from the start to each output time.
    progress : callable

    Raises
    ------
    EngineError
        If MuJoCo or MuJoCo Warp refuses the model, a wheel has no contact at the start, or the contact solver fails
        there.
    """
    with warp.ScopedDevice(settings.device):
        _compile_kernels(problem, settings)
        ride = build_ride(problem, settings)
        start = ride.begin()
        trouble = ride.find_trouble(start)
        if trouble is not None:
            raise EngineError(trouble)
        recording = Recording.empty(len(counts))
        start.record(recording, 0, 0.0)
        samples, cpu_time, ended, fall = _continue_ride(ride, counts, progress, recording)
    # Steps of RK4 have four evaluations, and only the last one's solution remains to be looked at.
    judged = settings.integrator != "RK4" and ride.rig.judged
    return RideState(
        recording=recording.first(samples),
        steps=ride.steps,
        cpu_time=cpu_time,
        ended=ended,
        unconverged_steps=ride.unconverged if judged else None,
        largest_residual=ride.largest if judged else None,
        fall=fall,
    )


def _compile_kernels(problem: Problem, settings: WarpSettings) -> None:
    """Take a step that nobody sees: Warp compiles a kernel where it is first called."""
    ride = build_ride(problem, settings)
    ride.begin()
    ride.step()


def _continue_ride(
    ride: WarpRide, counts: list[int], progress: Progress, recording: Recording
) -> tuple[int, float, str | None, Fall | None]:
    """Continue from the first sample; return samples, CPU time [s] of the steps, why the ride ended, and a fall."""
    step, cpu_time, reported = ride.settings.step, 0.0, 0
    steps_per_report = max(1, int(REPORT_INTERVAL / step))
    for k in range(1, len(counts)):
        begun, here = process_time(), None
        while ride.steps < counts[k]:
            here = ride.step()
            trouble = ride.find_trouble(here)
            touch = ride.touch
            # A wheel that has lost its contact may do so because the bicycle has fallen.
            if trouble is not None and (touch is None or touch.fall is None):
                return k, cpu_time + process_time() - begun, trouble, None
            if touch is not None:
                # The end may lie before the last sample.
                samples = max(1, bisect_right(counts[:k], touch.time / step))
                return samples, cpu_time + process_time() - begun, touch.why, touch.fall
        cpu_time += process_time() - begun
        if here is not None:
            here.record(recording, k, ride.steps * step)
        if ride.steps - reported >= steps_per_report:
            reported = ride.steps
            progress(ride.steps * step)
    return len(counts), cpu_time, None, None
