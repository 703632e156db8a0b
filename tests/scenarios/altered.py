"""An engine with one thing changed: what it is given, what it gives, how it breaks, or what it says of itself."""

from __future__ import annotations

import signal
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tests.wrapped import WrappedEngine
from velodrome.engines.engine import Problem, Progress, Trajectory
from velodrome.reference.kinematics import REAR_ANGLE


@dataclass(frozen=True)
class Altered(WrappedEngine):
    """Another engine behind two functions.

    Attributes
    ----------
    inner : Engine
    before : callable, optional
        Applied to the problem.
    after : callable, optional
        Applied to the trajectory; it may raise.
    called : str, optional
        Another name, to ride beside the engine itself.
    """

    before: Callable[[Problem], Problem] = lambda problem: problem
    after: Callable[[Trajectory], Trajectory] = lambda trajectory: trajectory
    called: str = ""

    @property
    def name(self) -> str:
        return self.called or self.inner.name

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        trajectory = self.after(self.inner.simulate(self.before(problem), settings, progress))
        return replace(trajectory, engine=self.name)


# Where `raising` raises, as it is named.
RAISED_AT = f"altered.py:{Path(__file__).read_text().splitlines().index('        raise error') + 1}"


def raising(error: BaseException) -> Callable[[Trajectory], Trajectory]:
    """An `after` that breaks the engine when its work is nearly done."""

    def fail(_: Trajectory) -> Trajectory:
        raise error

    return fail


def pressing_ctrl_c(trajectory: Trajectory) -> Trajectory:
    """An `after` during which the user presses Ctrl-C."""
    signal.raise_signal(signal.SIGINT)
    return trajectory


def with_fields(**changes: Callable[[np.ndarray], np.ndarray]) -> Callable[[Trajectory], Trajectory]:
    """An `after` that changes fields of the trajectory."""

    def changed(trajectory: Trajectory) -> Trajectory:
        return replace(trajectory, **{name: change(getattr(trajectory, name)) for name, change in changes.items()})

    return changed


def _late(values: np.ndarray) -> np.ndarray:
    """One sample late."""
    return np.concatenate([values[:1], values[:-1]])


def _faster_wheel(qd: np.ndarray) -> np.ndarray:
    return qd * np.where(np.arange(9) == REAR_ANGLE, 1.001, 1.0)


def _late_rates(trajectory: Trajectory) -> Trajectory:
    """Rates half a millisecond late, as a leapfrog method has them."""
    change = np.gradient(trajectory.qd, trajectory.time, axis=0, edge_order=2)
    return replace(trajectory, qd=trajectory.qd - 0.5e-3 * change)


_OTHER_WHEEL = [0, 1, 3, 2]
# What an engine may say wrongly of itself while its coordinates are exact, and the reports to be named.
CONTRADICTIONS: dict[str, tuple[Callable[[Trajectory], Trajectory], set[str]]] = {
    "rear rate x 1.001": (with_fields(qd=_faster_wheel), {"qd", "slip", "kinetic_energy"}),
    "rates half a step late": (_late_rates, {"qd", "slip", "kinetic_energy"}),
    "bodies 1 mm high": (with_fields(body_position=lambda p: p + np.array([0, 0, 1e-3])), {"body_position"}),
    "wheels swapped": (
        with_fields(
            body_position=lambda p: p[:, _OTHER_WHEEL],
            body_quaternion=lambda q: q[:, _OTHER_WHEEL],
            contact_point=lambda p: p[:, ::-1],
        ),
        {"body_position", "body_quaternion", "contact_point"},
    ),
    "late energies": (
        with_fields(kinetic_energy=_late, potential_energy=_late),
        {"kinetic_energy", "potential_energy"},
    ),
    "late contact points": (with_fields(contact_point=_late), {"contact_point"}),
    "contact points mirrored": (with_fields(contact_point=lambda p: p * np.array([1, -1, 1])), {"contact_point"}),
    "slip in mm/s off": (with_fields(slip=lambda s: s + 1e-3), {"slip"}),
    "gap 1 mm off": (with_fields(gap=lambda g: g + 1e-3), {"gap"}),
    "quaternions x, y, z, w": (with_fields(body_quaternion=lambda q: q[..., [1, 2, 3, 0]]), {"body_quaternion"}),
    "kinetic energy 1 J off": (with_fields(kinetic_energy=lambda e: e + 1.0), {"kinetic_energy"}),
    "potential energy 1 J off": (with_fields(potential_energy=lambda e: e + 1.0), {"potential_energy"}),
}
