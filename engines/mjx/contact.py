"""Contacts of knife-edge wheels with the ground in JAX: the equations of `velodrome.reference.kernels.contact`.

A wheel of centre c, axle y and radius r touches the ground at its rim point c + d, d = r e(a), closest to the surface
point u = (xi, eta, f). With axes x (level) and z of the wheel's plane, e = -sin(a) x - cos(a) z and t = de/da,

    (c + d - u) . g1 = 0,  (c + d - u) . g2 = 0,  t . N = 0

Newton's method solves them for p = (xi, eta, a). Its derivatives are those of one more step from the solution, in which
the solution and the Jacobian count as constants: the implicit function theorem.
"""

# JAX is an extra, without which its types are not known.
# pyright: reportMissingImports=false

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ..mujoco.tangent import HALF_THICKNESS
from .ground import Height

_MOST_STEPS = 50  # of Newton's method, as in the reference


class RimContact(NamedTuple):
    """The contact of a wheel, arrays of JAX.

    Attributes
    ----------
    arm : array, shape (3,)
        d, from the wheel's centre to the contact [m].
    normal : array, shape (3,)
        The ground's unit normal.
    foot : array, shape (3,)
        The surface point u [m].
    gap : array, shape ()
        Signed distance of the two along the normal [m].
    standing : array, shape ()
        Whether the contact was found and the wheel does not lie flat.
    """

    arm: Any
    normal: Any
    foot: Any
    gap: Any
    standing: Any


def find_rim_contact(height: Height | None, parameters: Any, centre: Any, axle: Any, radius: Any) -> RimContact:
    """Find the contact of a wheel with the ground; its derivatives with respect to centre and axle are exact.

    Parameters
    ----------
    height : callable or None
        The height; None for level ground.
    parameters : array
        Parameters of the surface.
    centre, axle : array, shape (3,)
        The wheel's centre [m] and axle [unit vector].
    radius : array, shape ()
        [m].
    """
    if height is None:
        return _find_level_contact(centre, axle, radius)

    def equations(p: Any, centre: Any, axle: Any) -> Any:
        e, t = _rim(p[2], axle)
        slope = jax.grad(lambda at: height(at[0], at[1], parameters))(p[:2])
        w = centre + radius * e - jnp.stack([p[0], p[1], height(p[0], p[1], parameters)])
        return jnp.stack([w[0] + w[2] * slope[0], w[1] + w[2] * slope[1], t[2] - t[0] * slope[0] - t[1] * slope[1]])

    c, y = jax.lax.stop_gradient(centre), jax.lax.stop_gradient(axle)
    solution, jacobian, converged = _solve_newton(lambda p: equations(p, c, y), _guess(c, y, radius), radius)
    p = solution - jnp.linalg.solve(jacobian, equations(solution, centre, axle))
    e, _ = _rim(p[2], axle)
    slope = jax.grad(lambda at: height(at[0], at[1], parameters))(p[:2])
    across = jnp.stack([-slope[0], -slope[1], jnp.ones_like(slope[0])])
    normal, arm = across / jnp.sqrt(across @ across), radius * e
    foot = jnp.stack([p[0], p[1], height(p[0], p[1], parameters)])
    standing = converged & jnp.all(jnp.isfinite(p)) & (arm @ normal < -HALF_THICKNESS)
    return RimContact(arm, normal, foot, (centre + arm - foot) @ normal, standing)


def _find_level_contact(centre: Any, axle: Any, radius: Any) -> RimContact:
    normal = jnp.array([0.0, 0.0, 1.0], centre.dtype)
    # The unit vector opposite to the normal's part in the wheel's plane.
    down = axle[2] * axle - normal
    arm = radius * down / jnp.sqrt(down @ down)
    point = centre + arm
    return RimContact(arm, normal, point * jnp.array([1, 1, 0], centre.dtype), point[2], arm[2] < -HALF_THICKNESS)


def _rim(angle: Any, axle: Any) -> tuple[Any, Any]:
    """Return the unit vectors e to a rim point and t along the rim."""
    x = jnp.stack([axle[1], -axle[0], jnp.zeros_like(axle[0])])
    x = x / jnp.sqrt(x @ x)
    z = jnp.cross(x, axle)
    s, c = jnp.sin(angle), jnp.cos(angle)
    return -s * x - c * z, -c * x + s * z


def _guess(centre: Any, axle: Any, radius: Any) -> Any:
    """Guess p: the lowest point of the rim."""
    e, _ = _rim(jnp.zeros_like(radius), axle)
    return jnp.stack([centre[0] + radius * e[0], centre[1] + radius * e[1], jnp.zeros_like(radius)])


def _solve_newton(equations: Any, guess: Any, radius: Any) -> tuple[Any, Any, Any]:
    """Return the solution, the Jacobian there, and whether Newton's method has converged."""
    # Convergence is quadratic: a step as short as the root of round-off leaves an error of the size of round-off.
    close = radius * jnp.sqrt(jnp.finfo(guess.dtype).eps)
    sizes = jnp.stack([jnp.ones_like(radius), jnp.ones_like(radius), radius])

    def is_going(state: tuple[Any, Any, Any]) -> Any:
        _, worst, steps = state
        return (worst > close) & (steps < _MOST_STEPS)

    def take_step(state: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
        p, _, steps = state
        step = jnp.linalg.solve(jax.jacfwd(equations)(p), equations(p))
        worst = jnp.max(jnp.abs(step) * sizes)
        # Far from the contact a full step may wind around the rim.
        return p - step * jnp.minimum(1, 0.5 * radius / worst), worst, steps + 1

    p, worst, _ = jax.lax.while_loop(is_going, take_step, (guess, jnp.full_like(radius, jnp.inf), 0))
    return p, jax.lax.stop_gradient(jax.jacfwd(equations)(p)), worst <= close
