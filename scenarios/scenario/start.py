"""Computation of a scenario's start: the motion is computed, disturbed and projected onto the constraints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from ...engines.engine import Problem
from ...reference.bicycle import Bicycle
from ...reference.circular import CircularMotion
from ...reference.dae import consistent_state
from ...reference.inputs import Inputs
from ...reference.kinematics import LEAN, REAR_ANGLE, STEER, YAW, body_positions
from ...reference.missing_motion import NoSuchMotion, SearchFailed
from ...reference.regularity import require_inertia
from ...reference.rideability import require_standing
from ...reference.rim import require_clear_rims
from ...reference.stability import growth_rate, growth_rates, linearise, sorted_eigenvalues
from ...reference.starts import StartRequest, StartState, compute_starts
from ...reference.surface import Plane, Surface, evaluate, is_level, is_of_revolution
from ...reference.wheel_overlap import require_separate_wheels
from ..error import ScenarioError
from .circular_motions import MotionKey, find_alike_motions, find_kept_motion, make_motion_key
from .missing_motion import describe_missing_motion
from .schema import CircularTable, Perturbation, Scenario, Simulation, UprightTable

_NO_PERTURBATION = Perturbation()


@dataclass(frozen=True)
class Start:
    """A problem, and the motion that it starts from.

    Attributes
    ----------
    problem : Problem
    undisturbed : tuple of ndarray, shapes (9,)
        Coordinates and rates before the perturbation.
    family : int or None
        Family of the circular motion; None for an upright start.
    motion : CircularMotion or None
        None for an upright start.
    growth_rate : float
        Largest real part of the motion's eigenvalues that symmetry does not fix [1/s]. On ground without symmetry,
        where no motion is steady, the value is that of the same start on the level plane. Of a straight start with
        torques, which is not steady either, it is that of the equations frozen at the start.
    size : float
        Radius of the circle of D, or the wheelbase for a straight start [m].
    """

    problem: Problem
    undisturbed: tuple[np.ndarray, np.ndarray]
    family: int | None
    motion: CircularMotion | None
    growth_rate: float
    size: float


def make_start(scenario: Scenario) -> Start:
    """Compute a scenario's start.

    Raises
    ------
    MissingMotionError
        If there is no such motion.
    ScenarioError
        If its disturbed state cannot be reached, has a rim inside the ground, wheels that overlap, or singular
        equations.
    """
    (found,) = make_starts([scenario])
    if isinstance(found, ScenarioError):
        raise found
    return found


def make_starts(scenarios: Sequence[Scenario]) -> list[Start | ScenarioError]:
    """Compute the starts of many scenarios, most of the work in compiled code.

    Parameters
    ----------
    scenarios : sequence of Scenario
        They may differ in everything.

    Returns
    -------
    list of Start or ScenarioError
        In the order of the scenarios, the starts with the same bits, and the same errors, as `make_start` gives for
        each, whatever the others are.
    """
    found: dict[int, Start | ScenarioError] = {}
    prepared: dict[int, _Prepared] = {}
    # Unrealistic parameters may overflow in between; the results are checked.
    with np.errstate(all="ignore"):
        settings: dict[int, _Setting] = {}
        for i, scenario in enumerate(scenarios):
            try:
                settings[i] = _make_setting(scenario)
            except ScenarioError as error:
                found[i] = error
        find_alike_motions(setting.key for setting in settings.values() if setting.key is not None)
        for i, setting in settings.items():
            try:
                prepared[i] = _prepare(scenarios[i], setting)
            except ScenarioError as error:
                found[i] = error
        states = dict(zip(prepared, compute_starts([each.request for each in prepared.values()]), strict=True))
        level = {i: each.on_plane for i, each in prepared.items() if each.on_plane is not None and states[i]}
        states_on_plane = dict(zip(level, compute_starts(list(level.values())), strict=True))
        clear = {i: state for i, state in states.items() if state and (i not in level or states_on_plane[i])}
        told = [states_on_plane.get(i) or state for i, state in clear.items()]
        rates = _compute_growth_rates([prepared[i] for i in clear], told)
        for (i, state), rate in zip(clear.items(), rates, strict=True):
            found[i] = _assemble_start(scenarios[i], prepared[i], state.undisturbed, (state.q, state.qd), rate)
        for i in prepared.keys() - found.keys():
            try:
                found[i] = _make_doubtful_start(scenarios[i], prepared[i])
            except ScenarioError as error:
                found[i] = error
    return [found[i] for i in range(len(scenarios))]


@dataclass(frozen=True, eq=False)
class _Setting:
    """A scenario's bicycle, ground and inputs, and the arguments of the search for its motion; None if upright."""

    bicycle: Bicycle
    surface: Surface
    inputs: Inputs
    key: MotionKey | None


@dataclass(frozen=True, eq=False)
class _Prepared:
    """A start whose motion is found.

    Attributes
    ----------
    family : int or None
    request : StartRequest
    on_plane : StartRequest or None
        The start whose growth rate is told, where that is another one: that on the level plane.
    """

    family: int | None
    request: StartRequest
    on_plane: StartRequest | None


def _make_setting(scenario: Scenario) -> _Setting:
    bicycle, surface, inputs = scenario.make_bicycle(), scenario.surface.make(), scenario.make_inputs()
    key = None
    if isinstance(scenario.motion, CircularTable):
        with _faults_described():
            key = make_motion_key(scenario.motion, bicycle, surface, inputs)
    return _Setting(bicycle, surface, inputs, key)


def _prepare(scenario: Scenario, setting: _Setting) -> _Prepared:
    """Find a scenario's motion.

    Raises
    ------
    ScenarioError
        If there is none.
    """
    bicycle, surface, inputs = setting.bicycle, setting.surface, setting.inputs
    change = None if scenario.perturbation == _NO_PERTURBATION else _list_change(scenario)
    family = None
    if setting.key is not None:
        with _faults_described():
            family, motion = find_kept_motion(setting.key)
        request = StartRequest(bicycle, surface, motion, inputs, change=change)
    else:
        place, rate = _place_upright(scenario, bicycle)
        request = StartRequest(bicycle, surface, None, inputs, place, rate, change)
    on_plane = None if is_of_revolution(surface) else replace(request, surface=Plane(), change=None)
    return _Prepared(family, request, on_plane)


def _list_change(scenario: Scenario) -> tuple[float, float, float, float, float, float, float]:
    """Return what is added to the independent variables; an upright start's place has its part already."""
    change = scenario.perturbation
    x, y = (0.0, 0.0) if isinstance(scenario.motion, UprightTable) else (change.x, change.y)
    return x, y, change.lean, change.steer, change.lean_rate, change.steer_rate, change.rear_rate


def _compute_growth_rates(starts: Sequence[_Prepared], states: Sequence[StartState]) -> list[float]:
    """Return the growth rates [1/s] of starts with known states."""
    if not starts:
        return []
    eigenvalues = sorted_eigenvalues(np.array([state.jacobian for state in states]))
    yaw_rates = np.array([state.undisturbed[1][YAW] for state in states])
    surfaces, rates = [(start.on_plane or start.request).surface for start in starts], np.empty(len(starts))
    level = np.array([is_level(surface) for surface in surfaces])
    for kind in (level, ~level):  # all that growth rates depend on
        if kind.any():
            rates[kind] = growth_rates(surfaces[kind.argmax()], eigenvalues[kind], yaw_rates[kind])
    return [float(rate) for rate in rates]


def _assemble_start(
    scenario: Scenario,
    start: _Prepared,
    undisturbed: tuple[np.ndarray, np.ndarray],
    state: tuple[np.ndarray, np.ndarray],
    rate: float,
) -> Start:
    told = start.request
    # A straight motion is an upright start: it has no circle.
    motion = None if told.motion is None or told.motion.is_straight else told.motion
    size = float(np.hypot(*motion.position[:2])) if motion is not None else told.bicycle.wheelbase
    times, beyond = output_times(scenario.simulation), scenario.simulation.beyond_fall
    problem = Problem(told.bicycle, told.surface, *state, times, told.inputs, beyond)
    return Start(problem, undisturbed, start.family, motion, rate, size)


@contextmanager
def _faults_described() -> Iterator[None]:
    """Turn the errors of functions that compute starts into errors for users."""
    try:
        yield
    except (NoSuchMotion, SearchFailed) as error:
        raise describe_missing_motion(error, "motion: ") from error
    except (ValueError, ArithmeticError) as error:
        raise ScenarioError(f"motion: {error}") from error


def _make_doubtful_start(scenario: Scenario, start: _Prepared) -> Start:
    """Compute a start with functions that raise errors where something is wrong with it."""
    bicycle, surface, motion = start.request.bicycle, start.request.surface, start.request.motion
    with _faults_described():
        if motion is not None:
            require_standing(bicycle, surface, motion)
        q, qd = _compute_undisturbed(start.request)
        require_inertia(bicycle, surface, q)
        rate = _compute_growth_rate(start, q, qd)
        undisturbed, (q, qd) = (q, qd), _disturb_state(start.request, q, qd)
        require_inertia(bicycle, surface, q)
        require_clear_rims(bicycle, surface, q)
        require_separate_wheels(bicycle, q)
    return _assemble_start(scenario, start, undisturbed, (q, qd), rate)


def output_times(simulation: Simulation) -> np.ndarray:
    """Return the times of the samples that a scenario asks for, shape (n,) [s]."""
    samples = round(simulation.duration * simulation.output_rate)
    # Each time is rounded once: i / rate, not a sum of steps.
    return np.arange(samples + 1) / simulation.output_rate


def _compute_growth_rate(start: _Prepared, q: np.ndarray, qd: np.ndarray) -> float:
    told = start.on_plane or start.request
    if start.on_plane is not None:
        q, qd = _compute_undisturbed(told)
    eigenvalues = linearise(told.bicycle, told.surface, q, qd, told.inputs).eigenvalues
    return growth_rate(told.surface, eigenvalues, float(qd[YAW]))


def _place_upright(scenario: Scenario, bicycle: Bicycle) -> tuple[tuple[float, float], float]:
    """Return x and y of D [m] and the rear rate [rad/s] of an upright start."""
    table = scenario.motion
    if not isinstance(table, UprightTable):
        raise TypeError("only an upright start has a place of its own")
    # Where the disturbed bicycle stands: there may be no ground at the origin.
    place = (float(bicycle.reference_point[0]) + scenario.perturbation.x, scenario.perturbation.y)
    return place, table.speed / bicycle.rear_wheel_radius


def _compute_undisturbed(request: StartRequest) -> tuple[np.ndarray, np.ndarray]:
    if request.motion is not None:
        return request.motion.state()
    return consistent_state(request.bicycle, request.surface, request.place, 0.0, 0.0, (0.0, 0.0, request.rear_rate))


def _disturb_state(request: StartRequest, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if request.change is None:
        return q, qd
    bicycle, surface = request.bicycle, request.surface
    x, y, lean, steer, lean_rate, steer_rate, rear_rate = request.change
    lean = float(q[LEAN]) + lean
    q, qd = consistent_state(
        bicycle,
        surface,
        (float(q[0]) + x, float(q[1]) + y),
        lean,
        float(q[STEER]) + steer,
        (qd[LEAN] + lean_rate, qd[STEER] + steer_rate, qd[REAR_ANGLE] + rear_rate),
        guess=(float(q[2]), float(q[5])),
    )
    centre = body_positions(bicycle, q[None])[0, 0]
    # The constraints also hold for wheels that touch the ground from below.
    if centre[2] <= evaluate(surface, centre[0], centre[1])[0]:
        raise ValueError(f"at lean = {lean!r} the rear frame lies below the ground; a smaller perturbation would not")
    return q, qd
