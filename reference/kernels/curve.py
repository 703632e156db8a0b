"""Steps along a curve of circular motions, and properties of the motions on it.

With J (8, 9) the Jacobian of `circle` and n a covector that is not orthogonal to the curve, the inverse B of

    [ J ]
    [ n ]

contains both Newton's step in the plane n . du = 0, du = -B[:, :8] rows, and, in its last column, the curve's
tangent. A step along the curve starts from the end of the tangent, takes steps with the B computed there until
they are small, and one with the B of the point they lead to, which also gives the next tangent. This takes two
Jacobians for each point, and more where the curve bends so much that a step is not a tenth of the one before.

The arclength counts all 22 unknowns of `steady`, in a metric in which those that grow without bound
count relatively.
"""

from __future__ import annotations

import numpy as np

from .arrays import copy_array
from .circle import COORDINATES, FULL, ROWS, STEP, circle_and_unknowns, circle_jacobian, circle_residual, unfold
from .compilation import jit
from .linear import invert
from .reduced import FRONT, REAR, VARIABLES, reduced_jacobian, telling_spin
from .steady import running_rates, steady_energy

CHOSEN = np.array([0, 1, 2, 3, 4, 5, 9, 12, 15])  # indices of the nine unknowns among the 22
X, Y, Z, LEAN, REAR_SPEED, FRONT_SPEED, SIGMA = 0, 1, 2, 3, 7, 8, 9
_FIRST_STEP, _SHORTEST_STEP = 0.02, 1e-6
_MOST = 15  # largest number of iterations in a step, each of which gains a digit or two


@jit
def metric(u, out):
    """Fill ``out`` (22,), the diagonal of the arclength's metric at the unknowns ``u`` (22,)."""
    reach = 0.3 / (1 + 0.3 * np.hypot(u[X], u[Y]))
    largest = 0.0
    for i in range(16, FULL):
        largest = max(largest, abs(u[i]))
    out[:] = 1.0
    for i in (0, 1, 10, 11, 13, 14):
        out[i] = reach * reach
    out[Z] = 1 / (1 + abs(u[Z])) ** 2
    out[SIGMA] = 1 / (1 + abs(u[SIGMA])) ** 2
    for i in range(16, FULL):
        out[i] = 1 / (1 + largest) ** 2


@jit
def unfold_along(u, t, function, parameters, a, full, along):
    """Fill all unknowns (22,) of a solution and their derivatives (22,) along a change ``t`` (9,) of the nine."""
    z, out = u.astype(np.complex128), np.empty(FULL, np.complex128)
    for i in range(COORDINATES):
        z[i] = complex(u[i], STEP * t[i])
    unfold(z, function, parameters, a, out)
    for i in range(FULL):
        full[i], along[i] = out[i].real, out[i].imag / STEP


@jit
def expanded(u, function, parameters, a, rows, jacobian, full, basis):
    """Fill all that Newton's method on ``u`` (9,) needs under any condition.

    rows (8,) and their jacobian (8, 9); all unknowns, full (22,), and their derivatives in the nine, basis (22, 9).
    """
    z, r, out = u.astype(np.complex128), np.empty(ROWS, np.complex128), np.empty(FULL, np.complex128)
    for j in range(COORDINATES):
        z[j] = complex(u[j], STEP)
        circle_and_unknowns(z, function, parameters, a, r, out)
        z[j] = u[j]
        for i in range(ROWS):
            rows[i], jacobian[i, j] = r[i].real, r[i].imag / STEP
        for i in range(FULL):
            full[i], basis[i, j] = out[i].real, out[i].imag / STEP


@jit
def _invert_bordered(u, covector, function, parameters, a, inverse):
    """Fill the inverse (9, 9) of the Jacobian bordered by a covector; return the determinant's sign."""
    circle_jacobian(u, function, parameters, a, inverse[:ROWS])
    copy_array(covector, inverse[ROWS])
    return invert(inverse, COORDINATES)


@jit
def _newton_step(u, inverse, rows):
    """Take a Newton step in place; return its size, relative for large unknowns."""
    size = 0.0
    for i in range(COORDINATES):
        step = 0.0
        for j in range(ROWS):
            step -= inverse[i, j] * rows[j]
        u[i] += step
        size = max(size, abs(step) / (1 + abs(u[i])))
    return size


@jit
def correct(u, covector, real, function, parameters, a, tangent):
    """Move ``u`` (9,) to the curve in the plane orthogonal to a covector; fill the tangent t (9,), covector . t = 1.

    ``real`` and ``function`` are the surface's functions for real and for complex numbers. Returns the number of
    iterations, 0 on failure, and the determinant's sign.
    """
    inverse, rows, before = np.empty((COORDINATES, COORDINATES)), np.empty(ROWS), 0.0
    slow = True
    for iteration in range(1, _MOST + 1):
        if slow:
            _invert_bordered(u, covector, function, parameters, a, inverse)
        circle_residual(u, real, parameters, a, rows)
        size = _newton_step(u, inverse, rows)
        if not size < 1.0:
            return 0, 0.0
        slow, before = iteration > 1 and size > 0.1 * before, size
        if size < 1e-9:
            sign = _invert_bordered(u, covector, function, parameters, a, inverse)
            circle_residual(u, real, parameters, a, rows)
            # Convergence is quadratic from here: what remains is round-off, about 1e-16 times the inverse's size.
            if not _newton_step(u, inverse, rows) < 1e-8:
                return 0, 0.0
            for i in range(COORDINATES):
                tangent[i] = inverse[i, ROWS]
            return iteration, sign
    return 0, 0.0


@jit
def unit(u, t, function, parameters, a, full, along):
    """Scale a tangent ``t`` (9,) to unit length in place; fill all unknowns and their tangent, (22,) each."""
    weights, length = np.empty(FULL), 0.0
    unfold_along(u, t, function, parameters, a, full, along)
    metric(full, weights)
    for i in range(FULL):
        length += along[i] * weights[i] * along[i]
    length = np.sqrt(length)
    for i in range(COORDINATES):
        t[i] /= length
    for i in range(FULL):
        along[i] /= length


@jit
def covector_of(full, along, covector):
    """Fill the covector (9,), in the arc's metric, of a tangent ``along`` (22,) at the unknowns ``full`` (22,)."""
    weights = np.empty(FULL)
    metric(full, weights)
    for i in range(COORDINATES):
        covector[i] = weights[CHOSEN[i]] * along[CHOSEN[i]]


@jit
def step(full, along, distance, real, function, parameters, a, new, new_along):
    """Take one step along the arc: fill all unknowns and their unit tangent, (22,) each.

    Returns the number of iterations, 0 on failure, and the determinant's sign. A sharp turn means that
    the step has jumped to another branch or over a bend: it counts as a failure too.
    """
    u, t, covector = np.empty(COORDINATES), np.empty(COORDINATES), np.empty(COORDINATES)
    covector_of(full, along, covector)
    for i in range(COORDINATES):
        u[i] = full[CHOSEN[i]] + distance * along[CHOSEN[i]]
    iterations, sign = correct(u, covector, real, function, parameters, a, t)
    if iterations == 0:
        return 0, 0.0
    unit(u, t, function, parameters, a, new, new_along)
    weights, turn = np.empty(FULL), 0.0
    metric(full, weights)
    for i in range(FULL):
        turn += along[i] * weights[i] * new_along[i]
    return (iterations, sign) if turn > 0.9 else (0, 0.0)


@jit
def follow(distance, longest, largest, real, function, parameters, a, full, along):
    """Follow the curve from row 0 of ``full`` and ``along`` (n, 22), unknowns and tangents, and fill the other rows.

    ``distance`` is the first step's length, ``largest`` = (lean, sigma, distance from the origin) are the limits that
    end the curve. Returns the number of rows filled, the next step's length, and whether the curve has ended.

    The determinant keeps its sign along a curve and differs in sign between two branches that nearly
    touch: a step that changes it has crossed to the other branch.
    """
    inverse, covector = np.empty((COORDINATES, COORDINATES)), np.empty(COORDINATES)
    covector_of(full[0], along[0], covector)
    sign = _invert_bordered(full[0][CHOSEN], covector, function, parameters, a, inverse)
    for n in range(1, len(full)):
        while True:
            iterations, new = step(
                full[n - 1], along[n - 1], distance, real, function, parameters, a, full[n], along[n]
            )
            if iterations > 0 and new == sign:
                break
            distance /= 2
            if distance < _SHORTEST_STEP:
                return n, distance, True
        distance = min(longest, distance * (1.4 if iterations <= 6 else 0.8))
        u = full[n]
        far = np.sqrt(u[X] * u[X] + u[Y] * u[Y] + u[Z] * u[Z])
        if not 0 <= u[SIGMA] < largest[1] or abs(u[LEAN]) > largest[0] or far > largest[2]:
            return n + 1, distance, True
    return len(full), distance, False


@jit
def state(full, y):
    """Fill y (24,) = (q, qd, contact parameters) of a motion, the rear wheel rolling forward."""
    y[:] = 0
    turn, rear, front = running_rates(full)
    y[0], y[1], y[2], y[4], y[5], y[6] = full[0], full[1], full[2], full[3], full[4], full[5]
    y[9], y[10], y[12] = -turn * full[1], turn * full[0], turn
    y[REAR], y[FRONT] = rear, front
    for i in range(6):
        y[18 + i] = full[10 + i]


@jit
def _normal_force(full, k, real, parameters):
    """Force on wheel ``k`` along the surface's normal, in weights."""
    _, fx, fy, _, _, _ = real(full[10 + 3 * k], full[11 + 3 * k], parameters)
    row = 16 + 3 * k
    return (full[row + 2] - fx * full[row] - fy * full[row + 1]) / np.sqrt(1 + fx * fx + fy * fy)


@jit
def sample(full, real, function, parameters, a, c, jacobians, seen):
    """Compute the properties of motions ``full`` (n, 22).

    ``c`` and ``a`` are the `kinematics.Constants` and the result of `pose.aligned` for them. Fills jacobians (n, 7, 7),
    whose eigenvalues are those of the motions, and seen (n, 6): the rates of yaw and both wheels [rad/s], the energy
    [J] and the normal forces of both wheels [N].
    """
    y, field = np.empty(24), np.empty(VARIABLES)
    weight = a.mass * a.gravity
    for n in range(len(full)):
        state(full[n], y)
        spin = telling_spin(full[n, REAR_SPEED], full[n, FRONT_SPEED])
        reduced_jacobian(y, spin, function, parameters, a, field, jacobians[n])
        seen[n, 0], seen[n, 1], seen[n, 2] = running_rates(full[n])
        seen[n, 3] = steady_energy(full[n], c)
        for k in range(2):
            seen[n, 4 + k] = weight * _normal_force(full[n], k, real, parameters)
