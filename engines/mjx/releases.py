"""From which releases of MJX and JAX on the engines ride.

MJX is a part of MuJoCo's module and rides with the MuJoCo of the suite, which other releases of MJX do not replace. Of
its releases before 3.8 those from 3.3.5 on ask MuJoCo for a flag that 4.0 does not have any more, ``mjENBL_MULTICCD``,
and those up to 3.3.5 for another one, ``mjDSBL_PASSIVE``.

Up to 3.13 ``jac_dot`` takes columns for those of a free joint's rotation that are not: ``&`` binds tighter than ``==``.
With 3.10.0 a ride of half a second on the plane ends 0.6 m off.
"""

from __future__ import annotations

from ..releases import LibraryReach

MJX = LibraryReach("mujoco-mjx", "MJX", oldest="3.8.0", needs="the flags of MuJoCo 4.0, with which it rides")
JACOBIAN_RATE = LibraryReach("mujoco-mjx", "MJX", oldest="3.14.0", needs="jac_dot that is right for free joints")
JAX = LibraryReach("jax", "JAX", oldest="0.10.0", needs="the oldest release that the tests hold")
