"""Vehicles in plain MuJoCo on knife-edge wheels: `python examples/rolling/mujoco_vehicles.py`.

Wheels roll in two ways: under MuJoCo's own contact solver on knife edges (`knife_edges`), whose rows are nearly rigid,
and under the exact forces of rolling (`rolling_forces`). The script rides a tricycle on the exact circle of its wheels,
a cart and a tandem in bowls, at two steps each.

The lateral constraints of the cart's four wheels contradict each other a little in a bowl. The forces of rolling leave
two of them out. Contacts have friction in all directions, so that the cart's wheels strain against each other and
scrub.
"""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np
from vehicles import GRAVITY, Body, Vehicle, find_tricycle_positions, make_cart, make_tandem, make_tricycle

from velodrome.engines.mujoco.knife_edge import knife_edges, rolling_forces, stiffen

Rolling = Literal["contacts", "forces"]
SOFTNESS = 1e-5  # of what MuJoCo gives a row: wheels creep by nanometres a second
STABILISATION = 20.0  # rate at which errors of the start decay [1/s]


@dataclass(frozen=True)
class VehicleRide:
    """Samples of a ride, n of them.

    Attributes
    ----------
    time : ndarray, shape (n,)
        [s].
    position : ndarray, shape (n, bodies, 3)
        Mass centres of the bodies [m].
    force : ndarray, shape (n, wheels, 3)
        Forces on the wheels, inertial axes [N].
    gap : ndarray, shape (n, wheels)
        [m].
    energy : ndarray, shape (n,)
        [J].
    standing : bool
        Whether all wheels stood on the ground at the end and none was ever held down.
    """

    time: np.ndarray
    position: np.ndarray
    force: np.ndarray
    gap: np.ndarray
    energy: np.ndarray
    standing: bool


def write_mjcf(vehicle: Vehicle, step: float, rolling: Rolling) -> str:
    """Return a vehicle's model as XML; bodies' origins are at their mass centres, as at the start."""
    grounds = "".join(
        f'<pair geom1="ground" geom2="{wheel.body}" condim="3" friction="2 2 0 0 0" solref="0.05 1" '
        'solimp="0.9999 0.9999 0.001 0.5 2" margin="1e-3" gap="1e9"/>'
        for wheel in vehicle.wheels
    )
    return (
        f'<mujoco><compiler inertiafromgeom="false"/><option timestep="{step!r}" integrator="RK4" cone="elliptic" '
        f'gravity="0 0 {-GRAVITY!r}"><flag energy="enable"/></option>'
        '<default><geom contype="0" conaffinity="0"/></default>'
        f'<worldbody><geom name="ground" type="plane" size="0 0 1"/>{_write_body(vehicle, 0, None)}</worldbody>'
        f"{f'<contact>{grounds}</contact>' if rolling == 'contacts' else ''}</mujoco>"
    )


def _write_body(vehicle: Vehicle, number: int, parent: Body | None) -> str:
    """Return a body with everything that hangs on it."""
    body, joint = vehicle.bodies[number], "<freejoint/>"
    place, turn = body.position, body.rotation
    if parent is not None:
        hinge = vehicle.hinges[number - 1]
        joint = (
            f'<joint name="{hinge.name}" type="hinge" pos="{_write(body.rotation.T @ (hinge.point - body.position))}" '
            f'axis="{_write(body.rotation.T @ hinge.axis)}"/>'
        )
        place, turn = parent.rotation.T @ (place - parent.position), parent.rotation.T @ turn
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(turn).ravel())
    inertia = body.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    wheels = "".join(
        f'<geom name="{wheel.body}" type="cylinder" size="{wheel.radius!r} 0.001" zaxis="0 1 0"/>'
        for wheel in vehicle.wheels
        if wheel.body == body.name
    )
    carried = "".join(
        _write_body(vehicle, i + 1, body) for i, hinge in enumerate(vehicle.hinges) if hinge.parent == body.name
    )
    return (
        f'<body name="{body.name}" pos="{_write(place)}" quat="{_write(quaternion)}">{joint}<inertial pos="0 0 0" '
        f'mass="{body.mass!r}" fullinertia="{_write(inertia)}"/>{wheels}{carried}</body>'
    )


def _write(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def set_velocities(vehicle: Vehicle, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Set MuJoCo's velocities from those of the bodies: the base's, and the relative spins about the hinges."""
    base = vehicle.bodies[0]
    data.qvel[:3], data.qvel[3:6] = base.velocity, base.rotation.T @ base.spin
    for hinge in vehicle.hinges:
        spins = [vehicle.bodies[vehicle.number(name)].spin for name in (hinge.body, hinge.parent)]
        data.qvel[model.joint(hinge.name).dofadr[0]] = hinge.axis @ (spins[0] - spins[1])


def ride_vehicle(
    vehicle: Vehicle, duration: float, step: float = 0.001, rolling: Rolling = "contacts", samples: int = 100
) -> VehicleRide:
    """Let a vehicle roll freely.

    Parameters
    ----------
    vehicle : Vehicle
    duration, step : float
        [s].
    rolling : {"contacts", "forces"}
        MuJoCo's contacts on knife edges, or the exact forces of rolling.
    samples : int
        Number of samples after the first.
    """
    model = mujoco.MjModel.from_xml_string(write_mjcf(vehicle, step, rolling))
    data = mujoco.MjData(model)
    set_velocities(vehicle, model, data)
    grounds = {wheel.body: "ground" for wheel in vehicle.wheels}
    bodies = [model.body(body.name).id for body in vehicle.bodies]
    if rolling == "contacts":
        stiffen(model, grounds, SOFTNESS)
        block = knife_edges(model, data, vehicle.surface, grounds)
    else:
        constrained = {wheel.body: wheel.constrained for wheel in vehicle.wheels}
        block = rolling_forces(model, data, vehicle.surface, grounds, STABILISATION, constrained)
    rows, steps = [], round(duration / step)
    with block as contacts:
        for k in range(samples + 1):
            mujoco.mj_forward(model, data)
            rows.append((data.time, data.xipos[bodies], contacts.forces(), contacts.gaps(), data.energy.sum()))
            if k < samples:
                mujoco.mj_step(model, data, steps * (k + 1) // samples - steps * k // samples)
        standing = contacts.standing()
    time, position, force, gap, energy = (np.array(column) for column in zip(*rows, strict=True))
    return VehicleRide(time, position, force, gap, energy, standing)


def main() -> None:
    """Print how exactly the vehicles ride."""
    print(f"{'':>23}{'step':>7}{'off [m]':>9}{'gap [m]':>9}{'energy':>9}")
    for name, vehicle in (("tricycle", make_tricycle()), ("cart", make_cart()), ("tandem", make_tandem())):
        for rolling in ("contacts", "forces"):
            for step in (2e-3, 1e-3):
                ride = ride_vehicle(vehicle, 1.0, step, rolling)
                if name == "tricycle":
                    exact = find_tricycle_positions(vehicle, 1.0)
                else:
                    exact = ride_vehicle(vehicle, 1.0, step / 2, rolling).position[-1]
                off = np.linalg.norm(ride.position[-1] - exact, axis=1).max()
                gap, energy = np.abs(ride.gap).max(), np.ptp(ride.energy) / abs(ride.energy[0])
                print(f"{name:>8} under {rolling:>8}{step:7.0e}{off:9.1e}{gap:9.1e}{energy:9.1e}")


if __name__ == "__main__":
    main()
