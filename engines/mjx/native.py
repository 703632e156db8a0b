"""Steps of MJX on planes, under its own soft contacts: the model of `mujoco-native`.

On curved ground the planes below the wheels are moved to the tangent planes before every step, as in
`velodrome.engines.mujoco.planes`, here inside the compiled loop.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from .contact import RimContact, find_rim_contact
from .library import contact_force, mjx, solve_m
from .setup import MjxInputs, MjxSample, MjxSetup, StepReport


def find_wheel_contacts(setup: MjxSetup, inputs: MjxInputs, data: Any) -> list[RimContact]:
    """Return the contacts of both wheels at the poses that the data hold."""
    return [
        find_rim_contact(setup.height, inputs.parameters, data.xpos[body], data.xmat[body][:, 1], inputs.radii[k])
        for k, body in enumerate(setup.wheels)
    ]


def place_mjx_planes(setup: MjxSetup, model: Any, inputs: MjxInputs, data: Any) -> tuple[Any, Any]:
    """Move the planes to the tangent planes below the wheels; return the data and whether both wheels stand."""
    here = find_wheel_contacts(setup, inputs, mjx.kinematics(model, data))
    position, quaternion = data.mocap_pos, data.mocap_quat
    for plane, contact in zip(setup.planes, here, strict=True):
        x, y, z = contact.normal
        length = jnp.sqrt(2 * (1 + z))
        turn = jnp.stack([(1 + z) / length, -y / length, x / length, jnp.zeros_like(z)])
        position, quaternion = position.at[plane].set(contact.foot), quaternion.at[plane].set(turn)
    data = data.replace(mocap_pos=position, mocap_quat=quaternion)
    return data, here[0].standing & here[1].standing


def step_on_planes(setup: MjxSetup, model: Any, inputs: MjxInputs, data: Any) -> tuple[Any, StepReport]:
    """Take a step of MJX with the planes where they are, and place them for the next one."""
    data = mjx.step(model, data)
    residual = measure_residual(model, data)
    if setup.planes:
        data, standing = place_mjx_planes(setup, model, inputs, data)
    else:
        # The poses are those before the step; the planes of the next one need no others.
        here = find_wheel_contacts(setup, inputs, data)
        standing = here[0].standing & here[1].standing
    return data, StepReport(standing, residual)


def measure_residual(model: Any, data: Any) -> Any:
    """Return the residual of the contact solver in the last evaluation, relative to the forces.

    The measure is that of `velodrome.engines.mujoco.convergence`.
    """

    def square(force: Any) -> Any:
        return force @ solve_m(model, data, force)

    gradient = mjx.mul_m(model, data, data.qacc - data.qacc_smooth) - data.qfrc_constraint
    scale = jnp.maximum(data.qacc_smooth @ data.qfrc_smooth, square(data.qfrc_constraint))
    return jnp.sqrt(square(gradient) / jnp.where(scale > 0, scale, 1))


def measure_energies(model: Any, data: Any) -> Any:
    """Return the potential and the kinetic energy (2,) of the last evaluation's state."""
    potential = -jnp.sum(model.body_mass[:, None] * data.xipos * model.opt.gravity)
    return jnp.stack([potential, 0.5 * data.qvel @ mjx.mul_m(model, data, data.qvel)])


def sample_on_planes(setup: MjxSetup, model: Any, inputs: MjxInputs, data: Any) -> tuple[MjxSample, StepReport]:
    """Evaluate everything at the state, as the next step will, and leave the state as it is."""
    if setup.planes:
        data, standing = place_mjx_planes(setup, model, inputs, data)
        data = mjx.forward(model, data)
    else:
        data = mjx.forward(model, data)
        here = find_wheel_contacts(setup, inputs, data)
        standing = here[0].standing & here[1].standing
    force = jnp.stack([contact_force(model, data, k, to_world_frame=True)[:3] for k in range(2)])
    bodies = jnp.array(setup.bodies)
    sample = MjxSample(
        qpos=data.qpos,
        qvel=data.qvel,
        position=data.xipos[bodies],
        quaternion=data.xquat[bodies],
        force=force,
        energy=measure_energies(model, data),
    )
    return sample, StepReport(standing, measure_residual(model, data))
