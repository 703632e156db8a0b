"""The flow of the equations of motion over given times, with its derivatives by the complex step.

Steps of Dormand's and Prince's method of order 8 are equal and their number is given, so that the end depends
analytically on the start and on the duration: a complex step in either gives the exact derivative of the numbers that
are computed.
"""

from __future__ import annotations

import numpy as np

from .circle import STEP
from .compilation import jit
from .dormand_prince import SIZE, fill_stage, fill_step
from .dynamics import complete_velocity, energies, settle
from .lean import derivative


@jit
def place_on_ground(variables, near, function, parameters, c, y):
    """Fill the state y (24,) = (q, qd, contact parameters), at yaw 0, with seven independent variables.

    ``near`` (24,) is a state from which Newton's method starts. Returns whether both wheels reach the ground.
    """
    q, qd, p = y[:9], y[9:18], y[18:]
    for i in range(SIZE):
        y[i] = near[i]
    q[0], q[1], q[4], q[6] = variables[0], variables[1], variables[2], variables[3]
    q[3], q[7], q[8] = 0.0, 0.0, 0.0
    qd[:] = 0.0
    qd[4], qd[6], qd[7] = variables[4], variables[5], variables[6]
    if not settle(q, p, function, parameters, c):
        return False
    complete_velocity(q, qd, p, function, parameters, c)
    return True


@jit
def extract_variables(y, variables):
    """Fill the independent variables (7,), x and y in the heading frame, of a state (24,)."""
    cosine, sine = np.cos(y[3]), np.sin(y[3])
    variables[0], variables[1] = cosine * y[0] + sine * y[1], cosine * y[1] - sine * y[0]
    variables[2], variables[3] = y[4], y[6]
    variables[4], variables[5], variables[6] = y[13], y[15], y[16]


@jit
def take_steps(y, duration, steps, function, parameters, a):
    """Advance a state y (24,) in place by equal steps; ``a`` the `Aligned` constants."""
    k, work, new = np.empty(13 * SIZE, y.dtype), np.empty(SIZE, y.dtype), np.empty(SIZE, y.dtype)
    h = duration / steps
    for _ in range(steps):
        derivative(y, function, parameters, a, k[:SIZE])
        for s in range(1, 12):
            fill_stage(s, y, h, k, work)
            derivative(work, function, parameters, a, k[s * SIZE : (s + 1) * SIZE])
        fill_step(y, h, k, new)
        for i in range(SIZE):
            y[i] = new[i]


@jit
def flow_legs(variables, durations, steps, near, function, parameters, c, a, out):
    """Fill ``out`` (m, 7), the independent variables after each of m durations (m,) one after another.

    ``variables`` (7,), ``durations`` and ``out`` are complex, ``steps`` (m,) are the numbers of steps. Returns the
    energy, and whether the start is on the ground.
    """
    y = np.empty(SIZE, np.complex128)
    if not place_on_ground(variables, near, function, parameters, c, y):
        return 0j, False
    kinetic, potential = energies(y[:9], y[9:18], c)
    for n in range(len(durations)):
        take_steps(y, durations[n], steps[n], function, parameters, a)
        extract_variables(y, out[n])
    return kinetic + potential, True


@jit
def variable_rates(variables, near, function, parameters, c, a, out):
    """Fill the time derivatives (7,) of independent variables; return whether they are those of a state."""
    y, dy, here = np.empty(SIZE, np.complex128), np.empty(SIZE, np.complex128), np.empty(7, np.complex128)
    if not place_on_ground(variables, near, function, parameters, c, y):
        return False
    derivative(y, function, parameters, a, dy)
    for i in range(SIZE):
        y[i] += complex(0.0, STEP) * dy[i]
    extract_variables(y, here)
    for i in range(7):
        out[i] = here[i].imag / STEP
    return True
