"""The curves of a recording: which quantity, under what title, computed how."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ...engines.engine import REFERENCE, Trajectory
from ...reference.kinematics import FRONT_ANGLE, LEAN, REAR_ANGLE, STEER, WHEELS, YAW
from ...reference.surface import Surface
from ..measure import START_ERROR, Mode, Modes, normal_force, required_friction

# Sizes below this are round-off of quantities of order one: they have no logarithm worth a point.
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
        Where two runs are shown together: from the name of a trajectory to that of the earlier one that it is
        held against.
    modes : Modes or None
        Of the motion that all started from.
    """

    surface: Surface
    trajectories: Mapping[str, Trajectory]
    before: Mapping[str, str] = field(default_factory=dict)
    modes: Modes | None = None

    @property
    def reference(self) -> Trajectory | None:
        """The trajectory that the others are compared with, if there is one."""
        return self.trajectories.get(REFERENCE)


Values = Callable[[RideData, Trajectory], np.ndarray | None]
PlotCurve = tuple[np.ndarray, np.ndarray]  # times [s] and values


@dataclass(frozen=True)
class Plot:
    """One view of curves, one curve an engine.

    Attributes
    ----------
    key : str
        Name in entity paths: ``/plots/<key>/<engine>``.
    title : str
        Quantity and unit.
    values : callable
        (ride, trajectory) to samples of shape (n,); NaN where there is none, None where the engine
        does not give the quantity.
    span : float
        Least height of the axis, so that round-off of a constant does not fill the view; 0 leaves
        the axis to the viewer.
    expected : callable, optional
        ride to the curve that theory expects, or None.
    """

    key: str
    title: str
    values: Values
    span: float = 0.0
    expected: Callable[[RideData], PlotCurve | None] = lambda _: None


def drawable_values(ride: RideData, plot: Plot) -> dict[str, np.ndarray]:
    """Values of a plot by engine; what an engine does not give, or gives no number of, has no entry."""
    found = {}
    for name, run in ride.trajectories.items():
        values = plot.values(ride, run)
        if values is not None and np.isfinite(values).any():
            found[name] = values
    return found


def to_nanoseconds(time: np.ndarray) -> np.ndarray:
    """Times [s] rounded to whole nanoseconds, int64."""
    return np.round(np.asarray(time, float) * NANOSECONDS).astype(np.int64)


def log_size(values: np.ndarray) -> np.ndarray:
    """log10 of the size of values; NaN where the size is round-off or the value not finite."""
    size = np.abs(values)
    out = np.full(size.shape, np.nan)
    kept = np.isfinite(size) & (size > SMALLEST_SIZE)
    out[kept] = np.log10(size[kept])
    return out


def position_error(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
    """Distance of D from the reference's [m], shape (n,), NaN at times the reference lacks."""
    return _distance(trajectory, ride.reference)


def position_change(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
    """Distance of D from the earlier run's [m], shape (n,), NaN at times that run lacks."""
    name = next((name for name, run in ride.trajectories.items() if run is trajectory), None)
    return _distance(trajectory, ride.trajectories.get(ride.before.get(name or "", "")))


def _distance(trajectory: Trajectory, other: Trajectory | None) -> np.ndarray | None:
    if other is None or trajectory is other:
        return None
    _, ours, theirs = np.intersect1d(to_nanoseconds(trajectory.time), to_nanoseconds(other.time), return_indices=True)
    out = np.full(len(trajectory.time), np.nan)
    out[ours] = np.linalg.norm(trajectory.q[ours, :3] - other.q[theirs, :3], axis=1)
    return out


def energy_change(_: RideData, trajectory: Trajectory) -> np.ndarray | None:
    """Change of kinetic and potential energy since the start, as a share of the start's size [-]."""
    if trajectory.kinetic_energy is None or trajectory.potential_energy is None:
        return None
    energy = trajectory.kinetic_energy + trajectory.potential_energy
    return (energy - energy[0]) / abs(energy[0]) if energy[0] != 0 else None


def pushing_force(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
    """Part of the contact forces along the surface's normal, shape (n, 2) [N]."""
    return normal_force(trajectory, ride.surface)


def friction_used(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
    """Tangential over normal contact force, shape (n, 2); NaN where the ground does not push."""
    normal = normal_force(trajectory, ride.surface)
    return None if normal is None else np.where(normal > 0, required_friction(trajectory, ride.surface), np.nan)


def _column(get: Values, index: int) -> Values:
    def values(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
        both = get(ride, trajectory)
        return None if both is None else both[:, index]

    return values


def _log(get: Values) -> Values:
    def values(ride: RideData, trajectory: Trajectory) -> np.ndarray | None:
        linear = get(ride, trajectory)
        return None if linear is None else log_size(linear)

    return values


def _gap(_: RideData, trajectory: Trajectory) -> np.ndarray | None:
    return trajectory.gap


def _slip(_: RideData, trajectory: Trajectory) -> np.ndarray | None:
    return None if trajectory.slip is None else np.linalg.norm(trajectory.slip, axis=-1)


ERROR = Plot("log_position_error", "log10 distance of D from the reference [m]", _log(position_error))
CHANGE = Plot("log_position_change", "log10 distance of D from the earlier run [m]", _log(position_change))
RADIUS = Plot("radius", "distance of D from the z axis [m]", lambda _, run: np.hypot(run.q[:, 0], run.q[:, 1]), 0.05)
ENERGY = Plot("energy_change", "relative energy change [-]", energy_change, 1e-6)
LOG_ENERGY = Plot("log_energy_change", "log10 relative energy change [-]", _log(energy_change))

STATES = (
    Plot("lean", "lean [rad]", lambda _, run: run.q[:, LEAN], 0.02),
    Plot("steer", "steer [rad]", lambda _, run: run.q[:, STEER], 0.02),
    Plot("lean_rate", "lean rate [rad/s]", lambda _, run: run.qd[:, LEAN], 0.02),
    Plot("yaw_rate", "yaw rate [rad/s]", lambda _, run: run.qd[:, YAW], 0.02),
    Plot("rear_rate", "rear wheel rate [rad/s]", lambda _, run: run.qd[:, REAR_ANGLE], 0.1),
    Plot("front_rate", "front wheel rate [rad/s]", lambda _, run: run.qd[:, FRONT_ANGLE], 0.1),
)
FORCES = (
    *(
        Plot(f"{w}_normal_force", f"{w} normal force [N]", _column(pushing_force, k), 10.0)
        for k, w in enumerate(WHEELS)
    ),
    *(
        Plot(f"{w}_friction", f"{w} tangential / normal force [-]", _column(friction_used, k), 0.05)
        for k, w in enumerate(WHEELS)
    ),
)
CONSTRAINTS = (
    *(Plot(f"{w}_log_gap", f"log10 {w} gap [m]", _column(_log(_gap), k)) for k, w in enumerate(WHEELS)),
    *(Plot(f"{w}_log_slip", f"log10 {w} slip [m/s]", _column(_log(_slip), k)) for k, w in enumerate(WHEELS)),
)
PLOTS = (ERROR, CHANGE, RADIUS, LOG_ENERGY, ENERGY, *STATES, *FORCES, *CONSTRAINTS)


def mode_plots(modes: Modes | None) -> tuple[Plot, ...]:
    """A plot a mode: its amplitude, and how it would grow or decay by the linear law."""
    return () if modes is None else tuple(_mode_plot(modes, k, mode) for k, mode in enumerate(modes.modes))


def _mode_plot(modes: Modes, k: int, mode: Mode) -> Plot:
    def values(_: RideData, trajectory: Trajectory) -> np.ndarray:
        return log_size(modes.amplitude(mode, trajectory))

    def expected(ride: RideData) -> PlotCurve | None:
        run = ride.reference or next(iter(ride.trajectories.values()))
        begin = float(modes.amplitude(mode, run)[0])
        if begin < START_ERROR:
            return None  # not excited but by round-off
        law = np.log10(begin) + mode.eigenvalue.real * run.time / np.log(10)
        kept = law <= 0  # the law is that of small angles: far below 1
        return run.time[kept], law[kept]

    what = "rear rate" if mode.unit == "rad/s" else "angle"
    return Plot(f"mode_{k}", f"{mode.title}: log10 {what} [{mode.unit}]", values, expected=expected)
