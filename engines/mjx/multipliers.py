"""Steps of MJX's tree under the exact forces of rolling.

MJX gives the mass matrix M, the acceleration a under all forces but those of the ground, and for the material point of
each rim at its contact the Jacobian Jp and Jp'. The forces F of the ground make these points' accelerations those of
rolling without slip,

    Jp M^-1 Jp^T F = -(Jp a + Jp' q' + w x (d' - w x d) + s^2 gap n + 2 s v)

where d' - w x d is the velocity of the contact along the rim (`contact` differentiates d). The stabilisation rate s
contributes nothing where the wheels roll. The integrator is the classical Runge-Kutta method on (qpos, qvel) with the
quaternion's own derivative, which has order 4; MJX's RK4 turns the frame by averaged angular velocities, order 2.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from .contact import find_rim_contact
from .library import jac_dot, mjx, solve_m
from .native import measure_energies
from .setup import MjxInputs, MjxSample, MjxSetup, StepReport

# Stages of the classical Runge-Kutta method: where each is evaluated, and its weight.
_STAGES = ((0.0, 1 / 6), (1 / 2, 1 / 3), (1 / 2, 1 / 3), (1.0, 1 / 6))


def roll(setup: MjxSetup, model: Any, inputs: MjxInputs, data: Any) -> tuple[Any, Any, Any, Any]:
    """Evaluate the dynamics under the forces of rolling.

    Returns
    -------
    data : mjx.Data
        The evaluated state, without the forces of the ground.
    acceleration : array, shape (9,)
    force : array, shape (2, 3)
        Forces of the ground on the wheels, inertial axes [N].
    standing : array, shape ()
    """
    data = mjx.forward(model, data)
    rows, biases, standing = [], [], jnp.array(True)
    for k, body in enumerate(setup.wheels):
        centre, axle, spin = data.xpos[body], data.xmat[body][:, 1], data.cvel[body][:3]

        def find(centre: Any, axle: Any, k: int = k) -> Any:
            return find_rim_contact(setup.height, inputs.parameters, centre, axle, inputs.radii[k])

        here = find(centre, axle)
        jacobian, _ = mjx.jac(model, data, centre + here.arm, body)
        velocity = jacobian.T @ data.qvel
        along = velocity - jnp.cross(spin, here.arm)
        _, turn = jax.jvp(lambda *pose: find(*pose).arm, (centre, axle), (along, jnp.cross(spin, axle)))
        run = turn - jnp.cross(spin, here.arm)
        jacobian_rate, _ = jac_dot(model, data, centre + here.arm, body)
        s = inputs.stabilisation
        error = s * s * here.gap * here.normal + 2 * s * velocity
        rows.append(jacobian.T)
        biases.append(jacobian_rate.T @ data.qvel + jnp.cross(spin, run) + error)
        standing = standing & here.standing
    jacobian, bias = jnp.concatenate(rows), jnp.concatenate(biases)
    softness = jax.vmap(lambda row: solve_m(model, data, row))(jacobian)
    force = -jnp.linalg.solve(jacobian @ softness.T, jacobian @ data.qacc_smooth + bias)
    return data, data.qacc_smooth + force @ softness, force.reshape(2, 3), standing


def _position_rate(qpos: Any, qvel: Any) -> Any:
    """Return the derivative of qpos; angular velocities are in the frame's own axes."""
    w, x, y, z = qpos[3:7]
    a, b, c = qvel[3:6]
    turn = jnp.stack(
        [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a],
    )
    return jnp.concatenate([qvel[:3], 0.5 * turn, qvel[6:]])


def step_rolling(setup: MjxSetup, model: Any, inputs: MjxInputs, data: Any) -> tuple[Any, StepReport]:
    """Take a step of the classical Runge-Kutta method."""
    step, start = model.opt.timestep, (data.qpos, data.qvel)

    def take_stage(carry: Any, stage: Any) -> tuple[Any, Any]:
        (before, total), (node, weight) = carry, stage
        qpos, qvel = (at + step * node * rate for at, rate in zip(start, before, strict=True))
        _, acceleration, _, standing = roll(setup, model, inputs, data.replace(qpos=qpos, qvel=qvel))
        rates = (_position_rate(qpos, qvel), acceleration)
        return (rates, tuple(add + weight * rate for add, rate in zip(total, rates, strict=True))), standing

    still = tuple(jnp.zeros_like(at) for at in start)
    stages = tuple(jnp.array(column, data.qpos.dtype) for column in zip(*_STAGES, strict=True))
    (_, mean), standing = jax.lax.scan(take_stage, (still, still), stages)
    qpos, qvel = (at + step * rate for at, rate in zip(start, mean, strict=True))
    quaternion = qpos[3:7]
    qpos = qpos.at[3:7].set(quaternion / jnp.sqrt(quaternion @ quaternion))
    return data.replace(qpos=qpos, qvel=qvel), StepReport(jnp.all(standing), jnp.zeros_like(step))


def sample_rolling(setup: MjxSetup, model: Any, inputs: MjxInputs, data: Any) -> tuple[MjxSample, StepReport]:
    """Evaluate everything at the state."""
    data, _, force, standing = roll(setup, model, inputs, data)
    bodies = jnp.array(setup.bodies)
    sample = MjxSample(
        qpos=data.qpos,
        qvel=data.qvel,
        position=data.xipos[bodies],
        quaternion=data.xquat[bodies],
        force=force,
        energy=measure_energies(model, data),
    )
    return sample, StepReport(standing, jnp.zeros_like(data.qpos[0]))
