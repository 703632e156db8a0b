"""The order of MJX's Runge-Kutta method on a free body, in MJX alone: `python examples/defects/mjx_rk4.py`.

A box tumbles freely, without forces. In half a second the error of a method of order 4 falls by 16 when the step is
halved. MJX 3.17's RK4 turns a free joint by the weighted mean of the stages' angular velocities, which belong to
different orientations: its error falls by 4, order 2. MuJoCo in C had the same order before version 4.0.
"""

# MuJoCo's compiled bindings carry no types, and JAX may be missing where types are checked.
# pyright: reportAttributeAccessIssue=false, reportMissingImports=false

from __future__ import annotations

from importlib.metadata import version
from itertools import pairwise

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

BOX = """<mujoco><option integrator="RK4" gravity="0 0 0"/><worldbody><body><freejoint/>
<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.2 0.25"/></body></worldbody></mujoco>"""
SPIN = (1.0, -2.0, 3.0)  # [rad/s]
DURATION = 0.5  # [s]
STEPS = (16, 32, 64, 128)


def tumble_in_mjx(counts: tuple[int, ...] = STEPS) -> list[np.ndarray]:
    """Return the box's final quaternions (4,) after rides of some numbers of steps, in double precision."""
    with jax.enable_x64(True):
        model = mujoco.MjModel.from_xml_string(BOX)
        put, data = mjx.put_model(model), mjx.make_data(model)
        data = data.replace(qpos=jnp.asarray(model.qpos0), qvel=jnp.array([0.0, 0.0, 0.0, *SPIN]))

        def ride(data: mjx.Data, step: float, count: int) -> mjx.Data:
            stepped = put.replace(opt=put.opt.replace(timestep=step))
            return jax.lax.fori_loop(0, count, lambda _, data: mjx.step(stepped, data), data)

        compiled = jax.jit(ride)
        return [np.asarray(compiled(data, DURATION / count, count).qpos[3:]) for count in counts]


def solve_exactly() -> np.ndarray:
    """Integrate Euler's equations and the quaternion with steps so small that only round-off is left."""
    inertia = np.array([0.1, 0.2, 0.25])

    def rate(state: np.ndarray) -> np.ndarray:
        (w, x, y, z), spin = state[:4], state[4:]
        a, b, c = spin
        turn = np.array([-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a])
        return np.concatenate([0.5 * turn, np.cross(inertia * spin, spin) / inertia])

    state, count = np.array([1.0, 0.0, 0.0, 0.0, *SPIN]), 4096
    step = DURATION / count
    for _ in range(count):
        k1 = rate(state)
        k2 = rate(state + step / 2 * k1)
        k3 = rate(state + step / 2 * k2)
        k4 = rate(state + step * k3)
        state = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return state[:4] / np.linalg.norm(state[:4])


def measure_orders() -> tuple[list[float], list[float]]:
    """Return the errors of the quaternion by number of steps, and the orders between neighbours."""
    exact = solve_exactly()
    errors = [float(np.abs(found - exact).max()) for found in tumble_in_mjx()]
    return errors, [float(np.log2(coarse / fine)) for coarse, fine in pairwise(errors)]


def main() -> None:
    """Print the errors and the orders."""
    errors, orders = measure_orders()
    for count, error, order in zip(STEPS, errors, [None, *orders], strict=True):
        print(f"step {1e3 * DURATION / count:6.3f} ms  error {error:.2e}" + (f"  order {order:.2f}" if order else ""))
    verdict = "of order 4: the defect is mended" if min(orders) > 3.5 else "not of order 4"
    print(f"RK4 of MJX {version('mujoco-mjx')} is {verdict}")


if __name__ == "__main__":
    main()
