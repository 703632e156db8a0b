"""A plain engine for the gate's tests: the reference's matrices in numpy, a Runge-Kutta method, nothing projected."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field

from velodrome.engines.engine import Problem, Progress, Settings, Trajectory
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import contact_parameters
from velodrome.reference.kernels import dynamics
from velodrome.reference.kinematics import body_positions, body_quaternions, constants
from velodrome.reference.simulate import steps_per_output

Correct = Callable[[Bicycle, np.ndarray, np.ndarray, np.ndarray], None]


class PlainSettings(Settings):
    step: float = Field(default=4e-3, ge=1e-6, le=0.1, description="step [s]")


def nothing(bicycle: Bicycle, q: np.ndarray, qd: np.ndarray, values: np.ndarray) -> None:
    """Leave a bias (9,) or the rolling rows (6, 9) as they are."""


@dataclass(frozen=True)
class PlainEngine:
    """M qdd + h = W' f, W qdd + gamma = 0, with `bias` and `rows` free to change h and W in place.

    Attributes
    ----------
    bias, rows : callable
        Called with the bicycle, the state and h (9,) or W (6, 9).
    stages : int
        Of the method: 4 for the classical Runge-Kutta method, 2 for Heun's.
    coarser : int
        Times its step that it really takes.
    """

    bias: Correct = nothing
    rows: Correct = nothing
    stages: int = 4
    coarser: int = 1
    name: str = "plain"
    version: str = "1"
    gives: tuple[str, ...] = ("contact_force",)
    settings: type[Settings] = PlainSettings

    def check(self, problem: Problem, settings: Any) -> None:
        steps_per_output(problem.times, self.coarser * settings.step)

    def step_noise(self, settings: Any) -> float:
        return 2.0**-52

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        begin = time.process_time()
        step = self.coarser * settings.step
        stride = steps_per_output(problem.times, step)
        y = np.concatenate([problem.q, problem.qd])
        states = [y]
        for _ in problem.times[1:]:
            for _ in range(stride):
                y = self._stepped(problem, y, step)
            states.append(y)
        rows = np.array(states)
        q, qd = rows[:, :9].copy(), rows[:, 9:].copy()
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(mode="json"),
            time=problem.times,
            q=q,
            qd=qd,
            body_position=body_positions(problem.bicycle, q),
            body_quaternion=body_quaternions(problem.bicycle, q),
            contact_force=np.array([self._solved(problem, y)[1] for y in states]).reshape(-1, 2, 3),
            steps=stride * (len(problem.times) - 1),
            cpu_time=time.process_time() - begin,
        )

    def _stepped(self, problem: Problem, y: np.ndarray, step: float) -> np.ndarray:
        def slope(y: np.ndarray) -> np.ndarray:
            return np.concatenate([y[9:], self._solved(problem, y)[0]])

        first = slope(y)
        if self.stages == 2:
            return y + step / 2 * (first + slope(y + step * first))
        second = slope(y + step / 2 * first)
        third = slope(y + step / 2 * second)
        return y + step / 6 * (first + 2 * second + 2 * third + slope(y + step * third))

    def _solved(self, problem: Problem, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations (9,) and contact forces (6,)."""
        bicycle, surface, (q, qd) = problem.bicycle, problem.surface, (y[:9].copy(), y[9:].copy())
        mass, h, w, gamma = np.empty((9, 9)), np.empty(9), np.empty((6, 9)), np.empty(6)
        c = constants(bicycle)
        dynamics.mass_and_bias(q, qd, c, mass, h)
        p = contact_parameters(bicycle, surface, q)
        dynamics.rolling(q, qd, p, surface.function.real, surface.parameters, c, w, gamma, np.empty(6))
        self.bias(bicycle, q, qd, h)
        self.rows(bicycle, q, qd, w)
        matrix = np.block([[mass, -w.T], [w, np.zeros((6, 6))]])
        found = np.linalg.solve(matrix, np.concatenate([-h, -gamma]))
        return found[:9], found[9:]


def _turned(axis: np.ndarray, angle: float) -> np.ndarray:
    k = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def without_gyroscopic_moment(bicycle: Bicycle, q: np.ndarray, qd: np.ndarray, h: np.ndarray) -> None:
    """Take the moment I spin (w x axle) of the front wheel's spin out of the bias."""
    x, y, z = np.eye(3)
    leaned = _turned(z, q[3]) @ _turned(x, q[4])
    rear = leaned @ _turned(y, q[5])
    steer = rear @ bicycle.steer_axis
    axes = np.array([z, _turned(z, q[3]) @ x, leaned @ y, steer])
    axle = rear @ _turned(bicycle.steer_axis, q[6]) @ y
    h[3:7] -= axes @ (bicycle.front_wheel_Iyy * qd[8] * np.cross(qd[3:7] @ axes, axle))
