"""Integration of the equations of motion: a precise method, and the method of the paper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from .bicycle import Bicycle
from .dae import contact_parameters
from .fall import Fall, describe_fall, fall_criterion
from .inputs import NO_INPUTS, Inputs
from .kernels import integrate
from .kernels import rides as kernel
from .kinematics import WHEELS, constants
from .rim import bicycle_rim_search, require_clear_rims, second_touch
from .surface import Surface, evaluate

_TOUCHING_WHEEL = {integrate.REAR_TOUCHED: WHEELS[0], integrate.FRONT_TOUCHED: WHEELS[1]}
_ALL_CALLS = 1 << 40  # more calls than any ride takes
_PARTS_A_THREAD = 8  # so that a thread with short rides takes over some of the others'
# Steps shrink to `integrate.SMALLEST_STEP` before the edge of the ground: at 100 m/s a wheel is then within 1 um of it.
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
    fall : Fall or None
        The states just before and just after the fall that ended it.
    """

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    contact: np.ndarray
    force: np.ndarray
    steps: int
    evaluations: int
    ended: str | None
    fall: Fall | None = None


def _make_motion(
    times: np.ndarray,
    rows: np.ndarray,
    force: np.ndarray,
    steps: int,
    evaluations: int,
    ended: str | None,
    fall: Fall | None,
) -> PreciseMotion:
    n = len(rows)
    q, qd, p = (np.ascontiguousarray(part) for part in (rows[:, :9], rows[:, 9:18], rows[:, 18:]))
    shape = (n, 2, 3)
    return PreciseMotion(
        times[:n].copy(), q, qd, p.reshape(shape), force.reshape(shape), steps, evaluations, ended, fall
    )


@dataclass(frozen=True, eq=False)
class RideStart:
    """A bicycle on its ground in a state from which it rides.

    Attributes
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (9,)
        Generalised coordinates and rates, on the constraints.
    inputs : Inputs
        Held constant.
    until_fall : bool
        Whether the ride ends where the bicycle falls.
    """

    bicycle: Bicycle
    surface: Surface
    q: np.ndarray
    qd: np.ndarray
    inputs: Inputs = NO_INPUTS
    until_fall: bool = False


def simulate(
    bicycle: Bicycle,
    surface: Surface,
    q: np.ndarray,
    qd: np.ndarray,
    times: np.ndarray,
    tolerance: float = 1e-13,
    progress: Callable[[float], None] | None = None,
    inputs: Inputs = NO_INPUTS,
    until_fall: bool = False,
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
    until_fall : bool
        Whether the motion ends where the bicycle falls, see `velodrome.reference.fall`.

    Returns
    -------
    PreciseMotion

    Raises
    ------
    ValueError
        If a wheel has no contact at the start, or a rim lies inside the ground or touches it twice.
    """
    start, times = RideStart(bicycle, surface, q, qd, inputs, until_fall), np.ascontiguousarray(times, float)
    setups, states = _set_rides_up([start], len(times))
    riding = True
    while riding:
        calls = _ALL_CALLS if progress is None else 1
        kernel.continue_rides(0, 1, calls, times, tolerance, setups, surface.function.real, states)
        riding = states.counts[0, 0] == integrate.MORE
        _require_start(start, states, 0)
        if progress is not None:
            progress(min(float(states.clock[0, 0]), float(times[-1])))
    return _finish_ride(start, times, states, 0)


def simulate_many(
    starts: Sequence[RideStart], times: np.ndarray, tolerance: float = 1e-13, threads: int = 1
) -> list[PreciseMotion | ValueError]:
    """Integrate the rides of many starts as `simulate` does, in compiled code.

    Parameters
    ----------
    starts : sequence of RideStart
        They may differ in everything; those on ground of one kind share a call of compiled code.
    times : ndarray, shape (n,)
        Output times of all rides, not decreasing, the first >= 0 [s].
    tolerance : float
        Tolerance of a step's error, relative to 1 + |state|.
    threads : int
        Number of threads that share the starts.

    Returns
    -------
    list of PreciseMotion or ValueError
        In the order of the starts. Each motion has the bits that `simulate` gives for its start, whatever the other
        starts, their order and the number of threads are. A start that `simulate` refuses has its error in place of a
        motion; the others ride nevertheless.

    Notes
    -----
    All samples are held at once, 30 numbers each: divide very many starts into calls of some hundred.
    """
    times = np.ascontiguousarray(times, float)
    found: dict[int, PreciseMotion | ValueError] = {}
    for kind in group_by_ground(starts):
        own = [starts[i] for i in kind]
        setups, states = _set_rides_up(own, len(times))
        function = own[0].surface.function.real

        def ride(part: range, setups=setups, states=states, function=function) -> None:
            kernel.continue_rides(part.start, part.stop, _ALL_CALLS, times, tolerance, setups, function, states)

        _share(ride, len(own), threads)
        for k, (i, start) in enumerate(zip(kind, own, strict=True)):
            try:
                _require_start(start, states, k)
                found[i] = _finish_ride(start, times, states, k)
            except ValueError as error:
                found[i] = error
    return [found[i] for i in range(len(starts))]


def kernels_are_loaded() -> bool:
    """Return whether the kernels of a ride have been compiled, or loaded from the cache, in this process."""
    return bool(kernel.continue_rides.signatures)


def group_by_ground(starts: Sequence[OnGround]) -> list[list[int]]:
    """Return the indices of starts whose grounds have the same height function, with any parameters, group by group."""
    groups: dict[Any, list[int]] = {}
    for i, start in enumerate(starts):
        groups.setdefault((start.surface.function.real, start.surface.parameters.size), []).append(i)
    return list(groups.values())


def _share(ride: Callable[[range], None], count: int, threads: int) -> None:
    """Call a function for all ranges of starts, in threads if there are more than one."""
    if threads == 1 or count < 2:
        ride(range(count))
        return
    size = max(1, count // (threads * _PARTS_A_THREAD))
    parts = [range(first, min(first + size, count)) for first in range(0, count, size)]
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(ride, parts))


class OnGround(Protocol):
    """Anything with a bicycle on its ground, under inputs."""

    @property
    def bicycle(self) -> Bicycle:
        """The bicycle."""
        ...

    @property
    def surface(self) -> Surface:
        """The ground."""
        ...

    @property
    def inputs(self) -> Inputs:
        """The inputs."""
        ...


def ride_setups(starts: Sequence[OnGround], falls: np.ndarray) -> kernel.RideSetups:
    """Return what compiled code needs of n starts on one kind of ground; ``falls`` (n, 4) are the fall criteria."""
    searches = [bicycle_rim_search(start.bicycle, start.surface) for start in starts]
    return kernel.RideSetups(
        constants=np.array([constants(start.bicycle, start.inputs) for start in starts]),
        parameters=np.array([start.surface.parameters for start in starts]),
        curved=np.array([search.curved for search in searches]),
        bends=np.concatenate([search.bends for search in searches]),
        offsets=np.cumsum([0, *(len(search.bends) for search in searches)]),
        widths=np.array([search.width for search in searches]),
        details=np.array([search.detail for search in searches]),
        samples=np.array([search.samples for search in searches]),
        falls=falls,
    )


def _set_rides_up(starts: Sequence[RideStart], samples: int) -> tuple[kernel.RideSetups, kernel.RideStates]:
    """Return what the kernel needs of starts on one kind of ground, with their contacts found."""
    n = len(starts)
    falls = np.array([fall_criterion(start.bicycle, start.until_fall) for start in starts], float)
    setups = ride_setups(starts, falls)
    states = kernel.RideStates(
        y=np.zeros((n, integrate.SIZE)),
        clock=np.empty((n, 2)),
        counts=np.empty((n, 4), np.int64),
        rows=np.empty((n, samples, integrate.SIZE)),
        force=np.empty((n, samples, 6)),
        fallen=np.empty((n, 2, integrate.SIZE)),
        at=np.empty((n, 2)),
    )
    for i, start in enumerate(starts):
        states.y[i, :9], states.y[i, 9:18] = start.q, start.qd
    kernel.begin_rides(0, n, setups, starts[0].surface.function.real, states)
    return setups, states


def _require_start(start: RideStart, states: kernel.RideStates, i: int) -> None:
    """Raise the error of a start that the kernel has refused."""
    status = states.counts[i, 0]
    if status == kernel.NO_CONTACT:
        raise ValueError(f"no contact point found at q = {states.y[i, :9].tolist()}")
    if status == kernel.NOT_CLEAR:
        require_clear_rims(start.bicycle, start.surface, states.y[i, :9], states.y[i, 18:])
        raise ValueError("a rim touches the ground at a second place")


def _finish_ride(start: RideStart, times: np.ndarray, states: kernel.RideStates, i: int) -> PreciseMotion:
    """Return the motion of start i, whose ride has ended."""
    status, index, steps, evaluations = (int(count) for count in states.counts[i])
    t, ended = float(states.clock[i, 0]), None
    if status in _TOUCHING_WHEEL:
        ended = second_touch(_TOUCHING_WHEEL[status], t)
    elif status == integrate.FELL:
        ended = describe_fall(t)
    elif status != integrate.DONE:
        why = _describe_edge_of_ground(start.surface, states.y[i, 18:]) or "the equations of motion become singular"
        ended = f"no solution beyond t = {t:.6g} s: {why}"
    fall = _make_fall(states.fallen[i], states.at[i]) if status == integrate.FELL else None
    # Copies, so that no motion keeps the samples of all others in memory.
    return _make_motion(times, states.rows[i, :index], states.force[i, :index].copy(), steps, evaluations, ended, fall)


def _make_fall(fallen: np.ndarray, at: np.ndarray) -> Fall:
    return Fall(at.copy(), *(np.ascontiguousarray(part) for part in (fallen[:, :9], fallen[:, 9:18])))


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
    until_fall: bool = False,
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
    until_fall : bool
        As in `simulate`.

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
    out, fallen, at = np.empty((len(times), integrate.SIZE)), np.empty((2, integrate.SIZE)), np.empty(2)
    out[0] = y
    count = stride * (len(times) - 1)
    status, rows, reached = integrate.modified_euler(
        y,
        step,
        count,
        stride,
        bicycle_rim_search(bicycle, surface),
        fall_criterion(bicycle, until_fall),
        surface.function.real,
        surface.parameters,
        constants(bicycle, inputs),
        out[1:],
        fallen,
        at,
    )
    rows += 1
    ended, fall = None, None
    if status in _TOUCHING_WHEEL:
        ended = second_touch(_TOUCHING_WHEEL[status], reached)
    elif status == integrate.FELL:
        ended, fall = describe_fall(reached), _make_fall(fallen, at)
    elif status != integrate.DONE:
        ended = f"the state is no longer finite after t = {times[rows - 1]:.6g} s"
    steps = (rows - 1) * stride
    force = np.empty((rows, 6))
    integrate.contact_forces(out[:rows], surface.function.real, surface.parameters, constants(bicycle, inputs), force)
    return _make_motion(times, out[:rows], force, steps, 2 * steps, ended, fall)


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
