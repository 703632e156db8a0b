"""The order of Jiminy's Runge-Kutta methods on a body that turns freely, in Jiminy alone.

Needs jiminy-py and numpy. The exit status is 1 as long as the defect is there, 0 once it is cured.

A box tumbles freely, without forces. In half a second the error of a method of order 4 falls by 16 when the step is
halved. Jiminy 1.8 adds the angular velocities of the stages as if all of them belonged to the orientation at the start
of the step (`AbstractRungeKuttaStepper::tryStepImpl` sums `ki_` in the tangent space, without the corrections that
Runge-Kutta methods on Lie groups need beyond order 2). The error falls by 4, which is order 2.
"""

# Jiminy's compiled bindings carry no types, and it may be missing where types are checked.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import sys
from importlib.metadata import version
from itertools import pairwise

import jiminy_py.core as jiminy
import numpy as np
from jiminy_py.core import pinocchio as pin

INERTIA = np.array([0.1, 0.2, 0.25])  # [kg m^2]
SPIN = np.array([1.0, -2.0, 3.0])  # [rad/s]
DURATION = 0.5  # [s]
STEPS = (32, 64, 128, 256)  # Jiminy's longest step is 0.02 s
# The next term of the error changes the order by a rate of 4 rad/s times the longest step.
CLOSE = 0.1


def tumble_in_jiminy(count: int) -> np.ndarray:
    """Return the box's final quaternion (x, y, z, w) after a number of steps."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.diag(INERTIA)), pin.SE3.Identity())
    robot = jiminy.Robot()
    robot.initialize(model)
    engine = jiminy.Engine()
    engine.add_robot(robot)
    options = engine.get_options()
    options["world"]["gravity"] = np.zeros(6)
    options["stepper"] |= {"odeSolver": "runge_kutta_4", "dtMax": DURATION / count}
    engine.set_options(options)
    engine.start(np.array([0, 0, 0, 0, 0, 0, 1.0]), np.concatenate([np.zeros(3), SPIN]))
    engine.step(DURATION)
    found = np.array(engine.robot_states[0].q[3:7])
    engine.stop()
    return found


def solve_exactly() -> np.ndarray:
    """Integrate Euler's equations and the quaternion with steps so small that only round-off is left."""
    state, count = np.array([0, 0, 0, 1.0, *SPIN]), 4096
    for _ in range(count):
        state = step_quaternion(state, DURATION / count)
    return state[:4]


def step_quaternion(state: np.ndarray, step: float) -> np.ndarray:
    """Return quaternion and spin (7,) after a step of Runge-Kutta's method on the quaternion's four numbers."""

    def rate(state: np.ndarray) -> np.ndarray:
        (x, y, z, w), spin = state[:4], state[4:]
        a, b, c = spin
        turn = np.array([w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c])
        return np.concatenate([0.5 * turn, np.cross(INERTIA * spin, spin) / INERTIA])

    k1 = rate(state)
    k2 = rate(state + step / 2 * k1)
    k3 = rate(state + step / 2 * k2)
    k4 = rate(state + step * k3)
    moved = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    moved[:4] /= np.linalg.norm(moved[:4])
    return moved


def measure_orders() -> tuple[list[float], list[float]]:
    """Return the errors of the quaternion by number of steps, and the orders between neighbours."""
    exact = solve_exactly()
    errors = [float(np.abs(tumble_in_jiminy(count) - exact).max()) for count in STEPS]
    return errors, [float(np.log2(coarse / fine)) for coarse, fine in pairwise(errors)]


def main() -> int:
    """Print errors, orders and the verdict; return the exit status."""
    errors, orders = measure_orders()
    print(f"Jiminy {version('jiminy-py')}, a box that tumbles freely for {DURATION:g} s, runge_kutta_4")
    for count, error, order in zip(STEPS, errors, [None, *orders], strict=True):
        print(f"step {1e3 * DURATION / count:6.3f} ms  error {error:.2e}" + (f"  order {order:.2f}" if order else ""))
    if min(orders) > 4 - CLOSE:
        print("cured: the method has order 4")
        return 0
    print("defect: the method has not the order 4")
    return 1


if __name__ == "__main__":
    sys.exit(main())
