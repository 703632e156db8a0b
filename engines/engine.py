"""What every engine takes and gives: `Problem` in, `Trajectory` out.

An engine is any object that satisfies `Engine` and is announced under the entry-point group
``velodrome.engines``; the suite never names one.
"""

# pandas and pyarrow carry no types.
# pyright: reportMissingTypeStubs=false

from __future__ import annotations

import re
import reprlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import EntryPoint, entry_points, version
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np
from pydantic import BaseModel, ConfigDict

from ..reference.bicycle import Bicycle
from ..reference.kinematics import COORDINATES
from ..reference.surface import Surface
from .format_version import VERSION_KEY
from .guard import EngineError as EngineError
from .guard import GuardedEngine, call_engine, where_raised
from .names import suggest_name

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

ENTRY_POINT_GROUP = "velodrome.engines"
REFERENCE = "reference"

Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False, repr=False)
class Problem:
    """A bicycle on a surface, started from a state that satisfies its constraints.

    Attributes
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (9,)
        Generalised coordinates and rates at the start, wheel angles and yaw included.
    times : ndarray, shape (n,)
        Output times, rising from 0 [s]; at least two.

    Raises
    ------
    ValueError
        If an array has another shape, the coordinates or rates are not finite, or the times do not rise from 0.

    Notes
    -----
    Arrays are converted to double precision where they are of another type; problems are compared by identity.
    """

    bicycle: Bicycle
    surface: Surface
    q: np.ndarray
    qd: np.ndarray
    times: np.ndarray

    def __post_init__(self) -> None:
        for name in ("q", "qd", "times"):
            given = getattr(self, name)
            try:
                values = np.asarray(given, dtype=float)
            except (TypeError, ValueError) as error:
                raise ValueError(f"{name} is {reprlib.repr(given)}; it must be an array of numbers") from error
            object.__setattr__(self, name, values)
        for name in ("q", "qd"):
            values = getattr(self, name)
            if values.shape != (9,) or not np.all(np.isfinite(values)):
                text = reprlib.repr(values.tolist())
                raise ValueError(f"{name} has shape {values.shape}, {text}; it must be 9 finite numbers")
        times = self.times
        if times.ndim != 1 or len(times) < 2:
            raise ValueError(f"times have shape {times.shape}; they must be an array of shape (n,), at least two")
        if not (np.all(np.isfinite(times)) and times[0] == 0 and np.all(np.diff(times) > 0)):
            raise ValueError(f"times are {np.array2string(times, threshold=6)}; they must be finite and rise from 0 s")

    def __repr__(self) -> str:
        lines = [
            f"Problem: {len(self.times)} output times from 0 to {self.times[-1]:g} s",
            f"  bicycle: {_shorten(self.bicycle)}",
            f"  surface: {_shorten(self.surface)}",
        ]
        for name, values in (("q", self.q), ("qd", self.qd)):
            named = (f"{key} {value:.6g}" for key, value in zip(COORDINATES, values, strict=True))
            lines.append(f"  {name}: {', '.join(named)}")
        return "\n".join(lines)


# Shapes of what a trajectory samples, but for the number of samples; the first five must be given.
SHAPES: dict[str, tuple[int, ...]] = {
    "time": (),
    "q": (9,),
    "qd": (9,),
    "body_position": (4, 3),
    "body_quaternion": (4, 4),
    "contact_point": (2, 3),
    "contact_force": (2, 3),
    "gap": (2,),
    "slip": (2, 2),
    "kinetic_energy": (),
    "potential_energy": (),
}
REQUIRED = tuple(SHAPES)[:5]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Trajectory:
    """What an engine computed. What it cannot give is None, never made up.

    All fields are given by name. Trajectories are compared by identity; compare their arrays for equal values.

    Attributes
    ----------
    engine, version : str
        Name and version of the engine.
    settings : dict
        The settings it ran with, JSON values.
    time : ndarray, shape (n,)
        Times of the samples by the engine's own clock [s], one for each of the problem's, or fewer where the run
        ended early. `velodrome.engines.admission.ride_engine` holds them against the problem's.
    q, qd : ndarray, shape (n, 9)
        Generalised coordinates and rates.
    body_position : ndarray, shape (n, 4, 3)
        Centres of mass, in the order of `velodrome.reference.bicycle.BODIES` [m].
    body_quaternion : ndarray, shape (n, 4, 4)
        Orientations (w, x, y, z), body to inertial axes.
    contact_point : ndarray or None, shape (n, 2, 3)
        Rim points of the rear and the front wheel that are closest to the surface [m].
    contact_force : ndarray or None, shape (n, 2, 3)
        Force of the ground on each wheel, inertial axes [N].
    gap : ndarray or None, shape (n, 2)
        Distance of each rim from the surface [m].
    slip : ndarray or None, shape (n, 2, 2)
        Lateral and forward material velocity of each contact [m/s].
    kinetic_energy, potential_energy : ndarray or None, shape (n,)
        Energies, the potential's datum at z = 0 [J].
    steps : int
        Integration steps taken.
    cpu_time : float
        Process CPU time of the integration alone [s].
    ended : str or None
        Why the run ended before the problem's last time; None if it did not.
    friction : float or None
        Coefficient of friction that its contacts have in every direction; None where wheels are bound to roll.
    unconverged_steps : int or None
        Steps in which an iteration, such as Newton's method or a contact solver, stopped before it met its
        tolerance; 0 where nothing iterates, None where the engine does not say.
    largest_residual : float or None
        Largest relative residual that an iteration left in any step: of a contact problem the residual of the
        forces over the largest force, of Newton's method the residual over the forces that it brings into balance,
        such as the weights. None where the engine does not say.
    """

    engine: str
    version: str
    settings: dict[str, Any]
    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    body_position: np.ndarray
    body_quaternion: np.ndarray
    steps: int
    cpu_time: float
    contact_point: np.ndarray | None = None
    contact_force: np.ndarray | None = None
    gap: np.ndarray | None = None
    slip: np.ndarray | None = None
    kinetic_energy: np.ndarray | None = None
    potential_energy: np.ndarray | None = None
    ended: str | None = None
    friction: float | None = None
    unconverged_steps: int | None = None
    largest_residual: float | None = None

    def __repr__(self) -> str:
        span = f"{self.time[0]:g} to {self.time[-1]:g} s" if len(self.time) else "no time"
        given = [name for name in SHAPES if getattr(self, name) is not None]
        lines = [
            f"Trajectory of {self.engine} {self.version}: {len(self.time)} samples, {span}",
            f"  {self.steps} steps in {self.cpu_time:.3g} s of CPU time",
            f"  arrays: {', '.join(given)}",
            f"  settings: {_shorten(self.settings)}",
        ]
        if self.ended is not None:
            lines.append(f"  ended: {self.ended}")
        if self.unconverged_steps:
            lines.append(f"  steps that did not converge: {self.unconverged_steps}")
        return "\n".join(lines)

    def first(self, samples: int) -> Self:
        """The ride up to a number of samples; steps and CPU time stay those of the whole."""
        cut = {name: value[:samples] for name in SHAPES if (value := getattr(self, name)) is not None}
        return replace(self, **cut)

    def until(self, time: float) -> Self:
        """The ride up to a time [s], its first sample at least; steps and CPU time stay those of the whole."""
        return self.first(max(1, int(np.searchsorted(self.time, time, side="right"))))

    def to_arrow(self) -> pa.Table:  # pyright: ignore[reportUnknownParameterType, reportUnknownMemberType]
        """Return the trajectory as a table, with the columns of the stored Parquet files.

        Units stand in the metadata of the columns, what is no column in that of the schema.

        Returns
        -------
        pyarrow.Table
            With n rows, in double precision.
        """
        from .storage import trajectory_table  # pyright: ignore[reportUnknownVariableType]

        return trajectory_table(self)  # pyright: ignore[reportUnknownVariableType]

    def to_pandas(self) -> pd.DataFrame:
        """Return the trajectory as a data frame, with the columns of the stored Parquet files.

        Returns
        -------
        pandas.DataFrame
            With n rows; the index is the time [s].

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        from .frames import trajectory_frame

        return trajectory_frame(self)

    def not_finite(self) -> list[str]:
        """Names of what is given and is not finite in some samples."""
        given = ((name, getattr(self, name)) for name in SHAPES)
        return [name for name, value in given if value is not None and not np.all(np.isfinite(value))]


def _shorten(value: Any) -> str:
    """Return the repr of a value as a part of one line, cut in the middle where it is long."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 160 else f"{text[:100]} ... {text[-55:]}"


class Settings(BaseModel):
    """Base of an engine's settings: unknown names are refused, values are checked, nothing changes later."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def refined(self, factor: float) -> Self:
        """These settings with another step, for a study of convergence.

        Parameters
        ----------
        factor : float
            Of the step. A method that chooses its own steps scales what it chooses them by.

        Raises
        ------
        ValueError
            If there is no step, or it would be out of its range.
        """
        values = self.model_dump()
        if "step" not in values:
            raise ValueError(f"{type(self).__name__} has no step to refine")
        return self.model_validate(values | {"step": values["step"] * factor})


class Engine(Protocol):
    """A multibody engine that rides the bicycle.

    An engine is an object of any class with the members below. It joins the suite from a package of its own, through
    an entry point of the group ``velodrome.engines`` whose name is the engine's; nothing in the suite is touched. To
    write one:

    1. Derive its settings from `Settings`. Every field has a default, bounds and a description with its unit. With a
       field ``step`` the settings can be refined for studies of convergence; a method that chooses its own steps
       overrides ``refined`` and scales its tolerance by the factor to the power of its order.
    2. In ``check`` refuse what cannot be run, before anything is computed: a ground that the engine does not know by
       `UnsuitableProblem`, output times that its steps do not meet by ValueError, in one line that says what would
       do. `velodrome.reference.simulate.steps_per_output` does the latter for a fixed step.
    3. Start from exactly the coordinates and rates of the problem, for its bicycle and on its ground.
       `velodrome.engines.coordinates` has the poses and twists of the bodies there, `velodrome.engines.rolling` the
       contacts of the wheels.
    4. Sample at the problem's times and stamp each sample with the engine's own clock. Call ``progress`` now and then.
    5. Give coordinates, rates and poses of the bodies at every sample. Coordinates of rigid bodies come from
       `velodrome.engines.coordinates.coordinates_from_bodies`. Angles go on beyond a turn, or not: whole turns do not
       count.
    6. List in ``gives`` what else the engine computes itself, and give it. What it does not compute is None, never
       filled from the reference. Contact forces are those of the ground on the wheels, in inertial axes.
    7. End a ride that cannot go on with the samples so far and the reason in ``ended``; raise `EngineError` where not
       even the first sample can be computed. Count steps whose iterations did not converge.
    8. State in ``step_noise`` what a step may leave beyond its method: 2^-52 for round-off, or the tolerance of its
       iterations or of its steps. Limits follow from it.
    9. Give the same bits in every ride of one problem, whatever was ridden before. Neither print to stdout nor change
       the process; import what is slow to load where it is needed.
    10. Hold it against all of this with `velodrome.testing.check_engine`, which says what looks wrong.

    ``examples/velodrome-symbrim`` is a whole package with an engine.

    An engine may also have a ``description``, one line of text that says what it is, which `velodrome show` prints.
    """

    @property
    def name(self) -> str:
        """Name in tables, files and on the command line."""
        ...

    @property
    def version(self) -> str:
        """Version of the library behind it."""
        ...

    @property
    def gives(self) -> tuple[str, ...]:
        """The optional fields of `Trajectory` that it fills."""
        ...

    @property
    def settings(self) -> type[Settings]:
        """The model of its settings; every field has a default."""
        ...

    def check(self, problem: Problem, settings: Any) -> None:
        """Refuse a problem that this engine cannot run with these settings, before anything is computed.

        Raises
        ------
        UnsuitableProblem
            If no settings of this engine would do: a run that did not ask for it by name leaves it out.
        ValueError
            With one line that says what is wrong and what would be right.
        """
        ...

    def step_noise(self, settings: Any) -> float:
        """Relative error that one step may add beyond its method: round-off and unconverged iterations."""
        ...

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        """Run a problem.

        Parameters
        ----------
        problem : Problem
        settings : Settings
            An instance of this engine's `settings`.
        progress : callable
            To be called now and then with the simulated time reached [s].

        Returns
        -------
        Trajectory

        Raises
        ------
        EngineError
            If not even the first sample could be computed.
        """
        ...


_FACTS = ("name", "version", "gives", "settings")
_MEMBERS = (*_FACTS, "check", "step_noise", "simulate")


class UnsuitableProblem(ValueError):
    """A problem of a kind that an engine is not made for, such as a ground that it does not know."""


# Keys of documents that have a key an engine besides; no engine may bear such a name.
RESERVED_NAMES = (VERSION_KEY, "sha256")
# Files are called after engines, and a name may come from any package.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def _announced() -> dict[str, EntryPoint]:
    """Entry points by name; one whose name could lead a file elsewhere is no engine.

    Raises
    ------
    ValueError
        If two packages announce one name: which of them ran would hang on the order of the path.
    """
    found: dict[str, EntryPoint] = {}
    for point in entry_points(group=ENTRY_POINT_GROUP):
        if not _NAME.fullmatch(point.name) or point.name in RESERVED_NAMES:
            continue
        other = found.setdefault(point.name, point)
        # One package may stand on the path twice, as with an editable install.
        if other is not point and _package(other) != _package(point):
            raise ValueError(
                f"engine {point.name!r} is announced by two packages, {_package(other)} and {_package(point)}; "
                "uninstall one of them"
            )
    return found


def _package(point: EntryPoint) -> str:
    """What announces an entry point: its distribution's name, as package indices compare them."""
    return point.value if point.dist is None else re.sub(r"[-_.]+", "-", point.dist.name).lower()


def engine_names() -> list[str]:
    """Names of all installed engines, the reference first.

    Raises
    ------
    ValueError
        If two packages announce an engine of one name.
    """
    return sorted(_announced(), key=lambda name: (name != REFERENCE, name))


def load_engine(name: str) -> Engine:
    """Load an engine by name.

    Raises
    ------
    ValueError
        If no engine of that name is installed, or what is announced under it is no engine, or two packages
        announce an engine of one name.
    """
    points = _announced()
    if name not in points:
        raise ValueError(f"engine {name!r} is not installed ({suggest_name(name, engine_names())})")
    where = f"engine {name!r}, announced as {points[name].value},"
    engine = None
    try:
        engine = call_engine(points[name].load)
        members = {member: call_engine(getattr, engine, member) for member in _MEMBERS}
    except Exception as error:  # another package's code may break in any way
        if isinstance(error, AttributeError) and error.obj is engine and where_raised(error) is None:
            raise ValueError(f"{where} is no engine: it has no {error.name}") from error
        raise ValueError(f"{where} cannot be loaded: {why_failed(error)}") from error
    if members["name"] != name:
        raise ValueError(f"{where} calls itself {members['name']!r}; both names must be the same")
    return GuardedEngine(engine, **{fact: members[fact] for fact in _FACTS})


def describe_engine(engine: Engine) -> str:
    """Say in a line what an engine is: its ``description`` if it has one, else the first line of its docstring."""
    own = engine.inner if isinstance(engine, GuardedEngine) else engine
    text = getattr(own, "description", None)
    if not isinstance(text, str) or not text.strip():
        text = next(iter((type(own).__doc__ or "").strip().splitlines()), "")
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def why_failed(error: Exception) -> str:
    """Say in one line why an engine failed: its own words where it chose them, else what broke in which line."""
    if isinstance(error, EngineError):
        return " ".join(str(error).split())
    place = None if isinstance(error, UnsuitableProblem) else where_raised(error)
    words = f"{type(error).__name__}: {error}" + (f" ({place})" if place else "")
    return " ".join(words.split())


def package_of(name: str) -> str | None:
    """Return the distribution that announces an installed engine; None where the entry point does not say.

    Raises
    ------
    KeyError
        If no engine of that name is installed.
    """
    distribution = _announced()[name].dist
    return None if distribution is None else distribution.name


@cache
def package_version(name: str) -> str:
    """Version of an installed package; to look it up each time would take longer than a short ride."""
    return version(name)


def packages() -> dict[str, str]:
    """Versions of the packages that announce engines, by name."""
    found = (point.dist for point in _announced().values())
    return {dist.name: dist.version for dist in found if dist is not None}
