"""Steps of MJX's tree under the exact forces of rolling.

MJX gives the mass matrix M, the acceleration a under all forces but those of the ground, and for the material point of
each rim at its contact the Jacobian Jp and Jp'. The forces F of the ground make these points' accelerations those of
rolling without slip,

    Jp M^-1 Jp^T F = -(Jp a + Jp' q' + w x (d' - w x d) + s^2 gap n + 2 s v)

where d' - w x d is the velocity of the contact along the rim (`contact` differentiates d). The stabilisation rate s
contributes nothing where the wheels roll. The integrator is the classical Runge-Kutta method on (qpos, qvel) with the
quaternion's own derivative, which has order 4; MJX's RK4 turns the frame by averaged angular velocities, order 2.
"""

# JAX is an extra, without which its types are not known; MJX takes ids of bodies as numbers too.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false, reportArgumentType=false

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from mujoco import mjx
from mujoco.mjx._src.smooth import solve_m
from mujoco.mjx._src.support import jac_dot

from .contact import find_rim_contact
from .native import are_standing
from .setup import MjxInputs, MjxSetup, StepReport

# The classical Runge-Kutta method: of the rates before, those that lead to stages two to four and to the new state.
_TABLEAU = (
    (1 / 2, 0.0, 0.0, 0.0),
    (0.0, 1 / 2, 0.0, 0.0),
    (0.0, 0.0, 1.0, 0.0),
    (1 / 6, 1 / 3, 1 / 3, 1 / 6),
)


def evaluate_rolling(setup: MjxSetup, model: Any, inputs: MjxInputs, data: Any, first: Any) -> tuple[Any, StepReport]:
    """Evaluate the dynamics under the forces of rolling; ``qacc`` of the data is the acceleration under them.

    ``first`` tells that the data hold no evaluated state before this one.
    """
    before, data = data, mjx.forward(model, data)
    rows, biases, contacts = [], [], []
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
        contacts.append(here)
    jacobian, bias = jnp.concatenate(rows), jnp.concatenate(biases)
    softness = jax.vmap(lambda row: solve_m(model, data, row))(jacobian)
    force = -jnp.linalg.solve(jacobian @ softness.T, jacobian @ data.qacc_smooth + bias)
    report = StepReport(
        force=force.reshape(2, 3),
        standing=are_standing(setup, contacts, before, data, first),
        residual=jnp.zeros_like(force[0]),
    )
    return data.replace(qacc=data.qacc_smooth + force @ softness), report


def _position_rate(qpos: Any, qvel: Any) -> Any:
    """Return the derivative of qpos; angular velocities are in the frame's own axes."""
    w, x, y, z = qpos[3:7]
    a, b, c = qvel[3:6]
    turn = jnp.stack(
        [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a],
    )
    return jnp.concatenate([qvel[:3], 0.5 * turn, qvel[6:]])


def step_rolling(setup: MjxSetup, model: Any, inputs: MjxInputs, data: Any, first: Any) -> tuple[Any, StepReport]:
    """Take a step of the classical Runge-Kutta method from an evaluated state, and evaluate the new one.

    Parameters and results are those of `velodrome.engines.mjx.native.step_on_planes`.
    """
    start, step = (data.qpos, data.qvel), model.opt.timestep

    def take_stage(carry: Any, stage: Any) -> tuple[Any, Any]:
        (data, rates), (weights, number) = carry, stage
        now = (_position_rate(data.qpos, data.qvel), data.qacc)
        rates = tuple(known.at[number].set(rate) for known, rate in zip(rates, now, strict=True))
        qpos, qvel = (
            jnp.where(first, at, at + step * (weights @ known)) for at, known in zip(start, rates, strict=True)
        )
        # The kinematics take a quaternion of any length; the new state's is a unit again.
        quaternion = qpos[3:7]
        unit = quaternion / jnp.sqrt(quaternion @ quaternion)
        qpos = qpos.at[3:7].set(jnp.where(first | (number < 3), quaternion, unit))
        data, report = evaluate_rolling(setup, model, inputs, data.replace(qpos=qpos, qvel=qvel), first)
        return (data, rates), report

    rates = tuple(jnp.zeros((4, *at.shape), at.dtype) for at in start)
    stages = (jnp.array(_TABLEAU, data.qpos.dtype), jnp.arange(4))
    (data, _), reports = jax.lax.scan(take_stage, (data, rates), stages)
    last = StepReport(*(values[-1] for values in reports))
    return data, last._replace(standing=jnp.all(reports.standing))
