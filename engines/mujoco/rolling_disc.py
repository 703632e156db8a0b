"""Roll a coin in a circle: an example of knife edges in a model of one's own.

    python -m velodrome.engines.mujoco.rolling_disc

A thin disc of mass m, radius r and moments of inertia I1 (about a diameter) and I3 (about its axle) leans by an angle
theta towards the centre of the circle of radius rho on which its centre moves. The motion is steady at

    Omega^2 = m g r sin(theta) / (cos(theta) ((I3 / r + m r) rho + I1 sin(theta)))

with the disc spinning about its axle at -Omega (rho + r sin(theta)) / r relative to the rotation at Omega. MuJoCo's own
contacts make the disc creep; on a knife edge it stays on its circle.
"""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass

import mujoco
import numpy as np

from ...reference.surface import Plane, Surface
from .knife_edge import knife_edges, stiffen

MASS, RADIUS, GRAVITY = 0.5, 0.3, 9.81
ACROSS, AXIAL = MASS * RADIUS**2 / 4, MASS * RADIUS**2 / 2
TOUCHING = {"wheel": "ground"}


def disc_mjcf(step: float) -> str:
    """Return the model's XML: a free disc, and a plane that stands for the ground."""
    return f"""
<mujoco model="disc">
  <option timestep="{step!r}" integrator="RK4" cone="elliptic" gravity="0 0 {-GRAVITY}" tolerance="1e-14"/>
  <worldbody>
    <geom name="ground" type="plane" size="0 0 1"/>
    <body name="disc">
      <freejoint/>
      <inertial pos="0 0 0" mass="{MASS}" diaginertia="{ACROSS} {ACROSS} {AXIAL}"/>
      <geom name="wheel" type="cylinder" size="{RADIUS} 0.001"/>
    </body>
  </worldbody>
  <contact>
    <pair geom1="ground" geom2="wheel" condim="3" friction="2 2 0 0 0" solref="0.05 1"
          solimp="0.9999 0.9999 0.001 0.5 2" margin="1e-3" gap="1e9"/>
  </contact>
</mujoco>"""


@dataclass(frozen=True)
class Rolled:
    """Trajectory of a disc.

    Attributes
    ----------
    time : ndarray, shape (n,)
        [s].
    position, axle : ndarray, shape (n, 3)
        Centre [m] and unit vector along the axle.
    energy : ndarray, shape (n,)
        Kinetic plus potential energy [J].
    slip : ndarray, shape (n,)
        Speed of the material point at the contact [m/s].
    """

    time: np.ndarray
    position: np.ndarray
    axle: np.ndarray
    energy: np.ndarray
    slip: np.ndarray


def steady_state(lean: float, circle: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return MuJoCo's state (7,), (6,) of steady rolling on the plane z = 0, and the rate Omega [rad/s]."""
    sine, cosine = np.sin(lean), np.cos(lean)
    inertia = (AXIAL / RADIUS + MASS * RADIUS) * circle + ACROSS * sine
    rate = np.sqrt(MASS * GRAVITY * RADIUS * sine / (cosine * inertia))
    axle, up = np.array([cosine, 0.0, sine]), np.array([-sine, 0.0, cosine])
    forward = np.array([0.0, 1.0, 0.0])
    axes = np.column_stack([forward, up, axle])
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    spin = np.array([0.0, 0.0, rate]) - rate * (circle + RADIUS * sine) / RADIUS * axle
    position = np.array([circle, 0.0, RADIUS * cosine])
    return np.concatenate([position, quaternion]), np.concatenate([rate * circle * forward, axes.T @ spin]), rate


def roll(
    qpos: np.ndarray, qvel: np.ndarray, surface: Surface, duration: float, step: float = 0.002, exact: bool = True
) -> Rolled:
    """Simulate a rolling disc.

    Parameters
    ----------
    qpos, qvel : ndarray, shape (7,), (6,)
        MuJoCo's state at the start.
    surface : Surface
        The ground; MuJoCo's own contacts use the plane z = 0.
    duration, step : float
        [s]
    exact : bool
        Whether to roll on a knife edge; otherwise MuJoCo's own contacts of a thin cylinder are used.
    """
    model = mujoco.MjModel.from_xml_string(disc_mjcf(step))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    if exact:
        stiffen(model, TOUCHING, 1e-5)
    else:
        model.pair_margin[:] = 0
    rows = []
    with knife_edges(model, data, surface, TOUCHING) if exact else nullcontext():
        for _ in range(round(duration / step) + 1):
            mujoco.mj_forward(model, data)
            rows.append(_measure_disc(model, data))
            mujoco.mj_step(model, data)
    time, position, axle, energy, slip = (np.array(column) for column in zip(*rows, strict=True))
    return Rolled(time, position, axle, energy, slip)


def _measure_disc(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[float, np.ndarray, np.ndarray, float, float]:
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    slip = np.nan
    if data.ncon:
        rows = np.empty((3, model.nv))
        mujoco.mj_jac(model, data, rows, None, data.contact.pos[0], model.body("disc").id)
        slip = float(np.linalg.norm(rows @ data.qvel))
    return data.time, data.xpos[1].copy(), data.xmat[1].reshape(3, 3)[:, 2].copy(), float(data.energy.sum()), slip


def main() -> None:
    """Roll a disc on its circle with both kinds of contact and print how far it strays."""
    lean, circle, duration = 0.4, 1.0, 10.0
    qpos, qvel, rate = steady_state(lean, circle)
    print(f"a disc leans by {lean} rad and rolls on a circle of {circle} m at {rate:.4f} rad/s, {duration:g} s")
    for name, exact in (("MuJoCo's own contact", False), ("knife edge", True)):
        rolled = roll(qpos, qvel, Plane(), duration, exact=exact)
        turn = rate * rolled.time
        path = circle * np.column_stack([np.cos(turn), np.sin(turn)])
        off = np.linalg.norm(rolled.position[:, :2] - path, axis=1).max()
        change = np.ptp(rolled.energy) / rolled.energy[0]
        print(f"{name:>21}: off its path by {off:.1e} m, slip {np.nanmax(rolled.slip):.1e} m/s, energy {change:.1e}")


if __name__ == "__main__":
    main()
