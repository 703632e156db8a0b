"""Steps of MJX on planes, under its own soft contacts: the model of `mujoco-native`.

On curved ground the planes below the wheels are moved to the tangent planes before every step, as in
`velodrome.engines.mujoco.planes`, here inside the compiled loop.
"""

# JAX is an extra, without which its types are not known.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from mujoco import mjx
from mujoco.mjx._src.smooth import solve_m
from mujoco.mjx._src.support import contact_force

from .contact import RimContact, find_rim_contact
from .setup import MjxInputs, MjxSetup, StepReport

_INTEGRATORS = {
    mjx.IntegratorType.EULER: mjx.euler,
    mjx.IntegratorType.IMPLICITFAST: mjx.implicit,
    mjx.IntegratorType.RK4: mjx.rungekutta4,
}


def find_wheel_contacts(setup: MjxSetup, inputs: MjxInputs, data: Any) -> list[RimContact]:
    """Return the contacts of both wheels at the poses that the data hold."""
    return [
        find_rim_contact(setup.height, inputs.parameters, data.xpos[body], data.xmat[body][:, 1], inputs.radii[k])
        for k, body in enumerate(setup.wheels)
    ]


def place_mjx_planes(setup: MjxSetup, model: Any, inputs: MjxInputs, data: Any) -> Any:
    """Move the planes to the tangent planes below the wheels; return the data."""
    here = find_wheel_contacts(setup, inputs, mjx.kinematics(model, data))
    position, quaternion = data.mocap_pos, data.mocap_quat
    for plane, contact in zip(setup.planes, here, strict=True):
        x, y, z = contact.normal
        length = jnp.sqrt(2 * (1 + z))
        turn = jnp.stack([(1 + z) / length, -y / length, x / length, jnp.zeros_like(z)])
        position, quaternion = position.at[plane].set(contact.foot), quaternion.at[plane].set(turn)
    return data.replace(mocap_pos=position, mocap_quat=quaternion)


def step_on_planes(setup: MjxSetup, model: Any, inputs: MjxInputs, data: Any, first: Any) -> tuple[Any, StepReport]:
    """Take a step of MJX from an evaluated state, and evaluate the new one.

    The order of `mjx.step` is turned round, so that what is sampled at a state is what the next step starts from.

    Parameters
    ----------
    setup, model, inputs
    data : mjx.Data
    first : array, shape ()
        Whether the state is not evaluated yet: then it is, and no step is taken.
    """
    integrate, before = _INTEGRATORS[model.opt.integrator], data
    data = jax.tree.map(lambda old, new: jnp.where(first, old, new), data, integrate(model, data))
    if setup.planes:
        data = place_mjx_planes(setup, model, inputs, data)
    data = mjx.forward(model, data)
    here = find_wheel_contacts(setup, inputs, data)
    report = StepReport(
        force=jnp.stack([contact_force(model, data, k, to_world_frame=True)[:3] for k in range(2)]),
        standing=are_standing(setup, here, before, data, first),
        residual=measure_residual(model, data),
    )
    return data, report


def are_standing(setup: MjxSetup, here: list[RimContact], before: Any, data: Any, first: Any) -> Any:
    """Return whether both wheels have contacts, and neither has lain flat since the evaluated state before.

    The axle's part along the ground changes its sign where a wheel lies flat; steps turn it by far less than a quarter.
    """
    standing = here[0].standing & here[1].standing
    for contact, body in zip(here, setup.wheels, strict=True):
        old, new = before.xmat[body][:, 1], data.xmat[body][:, 1]
        along = new - (new @ contact.normal) * contact.normal
        standing = standing & (first | (old @ along > 0))
    return standing


def measure_residual(model: Any, data: Any) -> Any:
    """Return the residual of the contact solver in the last evaluation, relative to the forces.

    The measure is that of `velodrome.engines.mujoco.convergence`.
    """

    def square(force: Any) -> Any:
        return force @ solve_m(model, data, force)

    gradient = mjx.mul_m(model, data, data.qacc - data.qacc_smooth) - data.qfrc_constraint
    scale = jnp.maximum(data.qacc_smooth @ data.qfrc_smooth, square(data.qfrc_constraint))
    return jnp.sqrt(square(gradient) / jnp.where(scale > 0, scale, 1))
