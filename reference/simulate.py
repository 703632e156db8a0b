"""Integration of the equations of motion: a precise method, and the method of the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .bicycle import Bicycle
from .dae import contact_parameters
from .inputs import NO_INPUTS, Inputs
from .kernels import integrate as kernel
from .kinematics import WHEELS, constants
from .rim import bicycle_rim_search, require_clear_rims, second_touch
from .surface import Surface, evaluate
from .tableau import TABLEAU

_TOUCHING_WHEEL = {kernel.REAR_TOUCHED: WHEELS[0], kernel.FRONT_TOUCHED: WHEELS[1]}
_STEPS_A_CALL = 200  # between two reports of progress; a step takes about 6 us
# Steps shrink to `kernel.SMALLEST_STEP` before the edge of the ground: at 100 m/s a wheel is then within 1 um of it.
# Where the ground becomes vertical, as on a sphere, they shrink earlier.
_EDGE_DISTANCE = 1e-3  # [m]


@dataclass(frozen=True)
class PreciseMotion:
    """A computed motion; the arrays end early if the integration does.

    Attributes
    ----------
    time : ndarray, shape (n,)
        [s].
    q, qd : ndarray, shape (n, 9)
        Generalised coordinates and rates.
    contact : ndarray, shape (n, 2, 3)
        Contact parameters (xi, eta, rim angle).
    force : ndarray, shape (n, 2, 3)
        Contact forces on the wheels in inertial axes [N].
    steps, evaluations : int
        Integration steps and evaluations of the right-hand side.
    ended : str or None
        Why the integration ended early.
    """

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    contact: np.ndarray
    force: np.ndarray
    steps: int
    evaluations: int
    ended: str | None


def _make_motion(
    bicycle: Bicycle,
    surface: Surface,
    inputs: Inputs,
    times: np.ndarray,
    rows: np.ndarray,
    steps: int,
    evaluations: int,
    ended: str | None,
) -> PreciseMotion:
    n = len(rows)
    q, qd, p = (np.ascontiguousarray(part) for part in (rows[:, :9], rows[:, 9:18], rows[:, 18:]))
    force = np.empty((n, 6))
    kernel.contact_forces(rows, surface.function.real, surface.parameters, constants(bicycle, inputs), force)
    return PreciseMotion(times[:n].copy(), q, qd, p.reshape(n, 2, 3), force.reshape(n, 2, 3), steps, evaluations, ended)


def simulate(
    bicycle: Bicycle,
    surface: Surface,
    q: np.ndarray,
    qd: np.ndarray,
    times: np.ndarray,
    tolerance: float = 1e-13,
    progress: Callable[[float], None] | None = None,
    inputs: Inputs = NO_INPUTS,
) -> PreciseMotion:
    """Integrate precisely: Dormand-Prince 8(5,3), adaptive, projected onto all constraints.

    The motion ends where a rim touches the ground at a second place: an impact follows, which the equations do not
    describe.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (9,)
        Start, on the constraints.
    times : ndarray, shape (n,)
        Output times, not decreasing, the first >= 0 [s].
    tolerance : float
        Tolerance of a step's error, relative to 1 + |state|.
    progress : callable, optional
        Called with the time reached.
    inputs : Inputs
        Held constant.

    Returns
    -------
    PreciseMotion

    Raises
    ------
    ValueError
        If a wheel has no contact at the start, or a rim lies inside the ground or touches it twice.
    """
    times = np.ascontiguousarray(times, float)
    y = np.concatenate([q, qd, contact_parameters(bicycle, surface, np.asarray(q, float))])
    require_clear_rims(bicycle, surface, y[:9], y[18:])
    rims = bicycle_rim_search(bicycle, surface)
    out = np.empty((len(times), kernel.SIZE))
    index, t, h, steps, evaluations = 0, 0.0, 1e-3, 0, 0
    status = kernel.MORE
    while status == kernel.MORE:
        status, index, t, h, more, count = kernel.dop853(
            y,
            times,
            index,
            t,
            h,
            tolerance,
            _STEPS_A_CALL,
            TABLEAU,
            rims,
            surface.function.real,
            surface.parameters,
            constants(bicycle, inputs),
            out,
        )
        steps, evaluations = steps + more, evaluations + count
        if progress is not None:
            progress(min(t, float(times[-1])))
    ended = None
    if status in _TOUCHING_WHEEL:
        ended = second_touch(_TOUCHING_WHEEL[status], t)
    elif status != kernel.DONE:
        why = _describe_edge_of_ground(surface, y[18:]) or "the equations of motion become singular"
        ended = f"no solution beyond t = {t:.6g} s: {why}"
    return _make_motion(bicycle, surface, inputs, times, out[:index], steps, evaluations, ended)


def _describe_edge_of_ground(surface: Surface, contact: np.ndarray) -> str | None:
    """Describe which wheel, at contact parameters (6,), has reached the edge of the ground; None if none has."""
    angle = np.arange(8) * np.pi / 4
    for wheel, (x, y) in zip(WHEELS, (contact[0:2], contact[3:5]), strict=True):
        around = evaluate(surface, x + _EDGE_DISTANCE * np.cos(angle), y + _EDGE_DISTANCE * np.sin(angle))
        if np.isfinite(x + y) and not np.all(np.isfinite(around)):
            return f"the ground ends under the {wheel} wheel"
    return None


def simulate_modified_euler(
    bicycle: Bicycle,
    surface: Surface,
    q: np.ndarray,
    qd: np.ndarray,
    times: np.ndarray,
    step: float = 1e-3,
    inputs: Inputs = NO_INPUTS,
) -> PreciseMotion:
    """Integrate as the paper does (section 4.2): modified Euler method with a fixed step, without projection.

    The motion ends at a second touch, as in `simulate`.

    Parameters
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (9,)
        Start, on the constraints.
    times : ndarray, shape (n,)
        Output times, a uniform grid from 0 whose spacing is a multiple of ``step`` [s].
    step : float
        Step [s]; the paper's is 1 ms.
    inputs : Inputs
        Held constant.

    Returns
    -------
    PreciseMotion

    Raises
    ------
    ValueError
        If ``times`` is not such a grid, a wheel has no contact at the start, or a rim lies inside the ground or
        touches it twice.
    """
    stride = steps_per_output(times, step)
    y = np.concatenate([q, qd, contact_parameters(bicycle, surface, np.asarray(q, float))])
    require_clear_rims(bicycle, surface, y[:9], y[18:])
    out = np.empty((len(times), kernel.SIZE))
    out[0] = y
    count = stride * (len(times) - 1)
    status, rows, reached = kernel.modified_euler(
        y,
        step,
        count,
        stride,
        bicycle_rim_search(bicycle, surface),
        surface.function.real,
        surface.parameters,
        constants(bicycle, inputs),
        out[1:],
    )
    rows += 1
    ended = None
    if status in _TOUCHING_WHEEL:
        ended = second_touch(_TOUCHING_WHEEL[status], reached)
    elif status != kernel.DONE:
        ended = f"the state is no longer finite after t = {times[rows - 1]:.6g} s"
    steps = (rows - 1) * stride
    return _make_motion(bicycle, surface, inputs, times, out[:rows], steps, 2 * steps, ended)


def steps_per_output(times: np.ndarray, step: float) -> int:
    """Return the number of fixed steps between two outputs.

    Raises
    ------
    ValueError
        If the times are not a uniform grid from 0, or its spacing is not a multiple of the step.
    """
    if len(times) < 2 or times[0] != 0:
        raise ValueError("output times must be a grid of two or more that starts at 0")
    spacing = float(times[-1]) / (len(times) - 1)
    if not np.allclose(times, spacing * np.arange(len(times)), rtol=0, atol=1e-9 * spacing):
        raise ValueError("output times must be evenly spaced for an engine of fixed step")
    stride = round(spacing / step)
    if stride < 1 or abs(stride * step - spacing) > 1e-9 * spacing:
        raise ValueError(
            f"step {step!r} s does not divide the output interval {spacing!r} s; "
            f"{spacing / max(1, np.ceil(spacing / step)):.6g} s would"
        )
    return stride
