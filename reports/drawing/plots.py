"""The curves of a run: their quantities, titles and values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ...engines.disk_arrays import release_pages
from ...engines.engine import REFERENCE, Trajectory
from ...reference.inputs import NO_INPUTS, Inputs
from ...reference.kinematics import FRONT_ANGLE, LEAN, REAR_ANGLE, STEER, WHEELS, YAW
from ...reference.surface import Surface
from ..measure import START_ERROR, Mode, Modes, conserved_energy, normal_force, required_friction

# Smaller magnitudes are round-off of quantities of order one, and their logarithms are not drawn.
SMALLEST_SIZE = 1e-16

NANOSECONDS = 1e9


@dataclass(frozen=True)
class RideData:
    """One scenario as ridden by several engines.

    Attributes
    ----------
    surface : Surface
    trajectories : mapping of str to Trajectory
        By engine name, in the order of display.
    before : mapping of str to str
        For two runs shown together: the name of the earlier trajectory that each trajectory is compared with.
    modes : Modes or None
        Modes of the motion that all rides started from.
    inputs : Inputs
        Inputs of all rides.
    """

    surface: Surface
    trajectories: Mapping[str, Trajectory]
    before: Mapping[str, str] = field(default_factory=dict)
    modes: Modes | None = None
    inputs: Inputs = NO_INPUTS

    @property
    def reference(self) -> Trajectory | None:
        """The trajectory that the others are compared with, if there is one."""
        return self.trajectories.get(REFERENCE)


Values = Callable[[RideData, Trajectory], np.ndarray | None]
PlotCurve = tuple[np.ndarray, np.ndarray]  # times [s] and values


@dataclass(frozen=True)
class Plot:
    """A view with one curve for each engine.

    Attributes
    ----------
    key : str
        Name in entity paths: ``/plots/<key>/<engine>``.
    title : str
        Quantity and unit.
    values : callable
        Returns samples of shape (n,) for (ride, trajectory); NaN where there is no value, None where the engine
        does not report the quantity.
    span : float
        Smallest height of the axis, so that round-off of a constant does not fill the view; with 0 the viewer
        chooses the axis.
    expected : callable, optional
        Returns the curve that theory predicts for a ride, or None.
    """

    key: str
    title: str
    values: Values
    span: float = 0.0
    expected: Callable[[RideData], PlotCurve | None] = lambda _: None


def drawable_values(ride: RideData, plot: Plot) -> dict[str, np.ndarray]:
    """Return the values of a plot by engine, without engines that do not report it or have no finite value."""
    found = {}
    for name, run in ride.trajectories.items():
        values = plot.values(ride, run)
        if values is not None and np.isfinite(values).any():
            found[name] = values
        release_pages(run)
    return found


def to_nanoseconds(time: np.ndarray) -> np.ndarray:
    """Round times [s] to whole nanoseconds, int64."""
    return np.round(np.asarray(time, float) * NANOSECONDS).astype(np.int64)


def log_size(values: np.ndarray) -> np.ndarray:
    """Return log10 of the magnitude of values; NaN where it is round-off or the value not finite."""
    size = np.abs(values)
    out = np.full(size.shape, np.nan)
    valid = np.isfinite(size) & (size > SMALLEST_SIZE)
    out[valid] = np.log10(size[valid])
    return out


def position_error(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
    """Return the distance of D from the reference's [m], shape (n,), NaN at times that the reference lacks."""
    return _distance_between(trajectory, ride.reference)


def position_change(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
    """Return the distance of D from the earlier run's [m], shape (n,), NaN at times that this run lacks."""
    name = next((name for name, run in ride.trajectories.items() if run is trajectory), None)
    return _distance_between(trajectory, ride.trajectories.get(ride.before.get(name or "", "")))


def _distance_between(trajectory: Trajectory, other: Trajectory | None) -> np.ndarray | None:
    if other is None or trajectory is other:
        return None
    _, ours, theirs = np.intersect1d(to_nanoseconds(trajectory.time), to_nanoseconds(other.time), return_indices=True)
    out = np.full(len(trajectory.time), np.nan)
    out[ours] = np.linalg.norm(trajectory.q[ours, :3] - other.q[theirs, :3], axis=1)
    return out


def energy_change(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
    """Return the change of the energy less the work of the inputs, relative to the energy at the start [-]."""
    energy = conserved_energy(trajectory, ride.inputs)
    return None if energy is None or energy[0] == 0 else (energy - energy[0]) / abs(energy[0])


def pushing_force(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
    """Return the component of the contact forces along the surface's normal, shape (n, 2) [N]."""
    return normal_force(trajectory, ride.surface)


def friction_used(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
    """Return the tangential over the normal contact force, shape (n, 2); NaN where the ground does not push."""
    normal = normal_force(trajectory, ride.surface)
    return None if normal is None else np.where(normal > 0, required_friction(trajectory, ride.surface), np.nan)


def _select_column(get: Values, index: int) -> Values:
    def values(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
        both = get(ride, trajectory)
        return None if both is None else both[:, index]

    return values


def _take_log(get: Values) -> Values:
    def values(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
        linear = get(ride, trajectory)
        return None if linear is None else log_size(linear)

    return values


def _gap(_: RideData, trajectory: Trajectory) -> np.ndarray | None:
    return trajectory.gap


def _slip(_: RideData, trajectory: Trajectory) -> np.ndarray | None:
    return None if trajectory.slip is None else np.linalg.norm(trajectory.slip, axis=-1)


ERROR = Plot("log_position_error", "distance from the reference [10^x m]", _take_log(position_error))
CHANGE = Plot("log_position_change", "distance from the earlier run [10^x m]", _take_log(position_change))
RADIUS = Plot("radius", "distance from the axis [m]", lambda _, run: np.hypot(run.q[:, 0], run.q[:, 1]), 0.05)
ENERGY = Plot("energy_change", "energy change, relative to the start's", energy_change, 1e-6)
LOG_ENERGY = Plot("log_energy_change", "energy change, relative to the start's [10^x]", _take_log(energy_change))

STATES = (
    Plot("lean", "lean, + to the right [rad]", lambda _, run: run.q[:, LEAN], 0.02),
    Plot("steer", "steer, + to the left [rad]", lambda _, run: run.q[:, STEER], 0.02),
    Plot("lean_rate", "lean rate [rad/s]", lambda _, run: run.qd[:, LEAN], 0.02),
    Plot("yaw_rate", "yaw rate [rad/s]", lambda _, run: run.qd[:, YAW], 0.02),
    Plot("rear_rate", "rear wheel rate [rad/s]", lambda _, run: run.qd[:, REAR_ANGLE], 0.1),
    Plot("front_rate", "front wheel rate [rad/s]", lambda _, run: run.qd[:, FRONT_ANGLE], 0.1),
)
FORCES = (
    *(
        Plot(f"{w}_normal_force", f"{w} normal force [N]", _select_column(pushing_force, k), 10.0)
        for k, w in enumerate(WHEELS)
    ),
    *(
        Plot(f"{w}_friction", f"{w} friction coefficient used", _select_column(friction_used, k), 0.05)
        for k, w in enumerate(WHEELS)
    ),
)
CONSTRAINTS = (
    *(Plot(f"{w}_log_gap", f"{w} gap [10^x m]", _select_column(_take_log(_gap), k)) for k, w in enumerate(WHEELS)),
    *(Plot(f"{w}_log_slip", f"{w} slip [10^x m/s]", _select_column(_take_log(_slip), k)) for k, w in enumerate(WHEELS)),
)
PLOTS = (ERROR, CHANGE, RADIUS, LOG_ENERGY, ENERGY, *STATES, *FORCES, *CONSTRAINTS)


def mode_plots(modes: Modes | None) -> tuple[Plot, ...]:
    """Make one plot per mode: its amplitude, and its growth or decay by the linear law."""
    return () if modes is None else tuple(_mode_plot(modes, k, mode) for k, mode in enumerate(modes.modes))


def _mode_plot(modes: Modes, k: int, mode: Mode) -> Plot:
    def values(_: RideData, trajectory: Trajectory) -> np.ndarray:
        return log_size(modes.amplitude(mode, trajectory))

    def expected(ride: RideData) -> PlotCurve | None:
        run = ride.reference or next(iter(ride.trajectories.values()))
        begin = float(modes.amplitude(mode, run)[0])
        if begin < START_ERROR:
            return None  # not excited, except by round-off
        law = np.log10(begin) + mode.eigenvalue.real * run.time / np.log(10)
        valid = law <= 0  # the law holds for amplitudes far below 1
        return run.time[valid], law[valid]

    what = "rear rate" if mode.unit == "rad/s" else "angle"
    return Plot(f"mode_{k}", f"{mode.title}: {what} [10^x {mode.unit}]", values, expected=expected)
