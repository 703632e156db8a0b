"""The interface of engines: `Engine`, its input `Problem` and its output `Trajectory`.

An engine is any object that satisfies `Engine` and is announced under the entry-point group
``velodrome.engines``. The suite finds engines by this group alone.
"""

# pandas and pyarrow carry no types.
# pyright: reportMissingTypeStubs=false

from __future__ import annotations

import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Protocol, Self, cast

import numpy as np
from pydantic import BaseModel, ConfigDict

from ..reference.bicycle import Bicycle
from ..reference.fall import Fall
from ..reference.inputs import NO_INPUTS, Inputs
from ..reference.kinematics import COORDINATES
from ..reference.surface import Surface
from .guard import EngineError as EngineError
from .guard import GuardedEngine, where_raised

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

REFERENCE = "reference"
DEFAULT_SETTINGS_SOURCE = "the engine's own defaults, as its package declares them"

Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False, repr=False)
class Problem:
    """A bicycle on a surface, started from a state that satisfies its constraints.

    Attributes
    ----------
    bicycle : Bicycle
    surface : Surface
    q, qd : ndarray, shape (9,)
        Generalised coordinates and rates at the start, including wheel angles and yaw.
    times : ndarray, shape (n,)
        Output times, rising from 0 [s]; at least two.
    inputs : Inputs
        Torques and steer damping, constant during the ride; by default there are none.
    beyond_fall : bool
        Whether the ride goes on after the bicycle has fallen, see `velodrome.reference.fall`; by default it ends there.

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
    inputs: Inputs = NO_INPUTS
    beyond_fall: bool = False

    def __post_init__(self) -> None:
        for name in ("q", "qd", "times"):
            given = getattr(self, name)
            try:
                values = np.asarray(given, dtype=float)
            except (TypeError, ValueError) as error:
                raise ValueError(f"{name} is {reprlib.repr(given)}; it must be an array of numbers") from error
            object.__setattr__(self, name, values)
        inputs: Any = vars(self)["inputs"]  # callers may not check types
        if not isinstance(inputs, Inputs):
            raise ValueError(f"inputs is {reprlib.repr(inputs)}; it must be an Inputs")
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
            *([f"  inputs: {self.inputs.describe()}"] if self.inputs != NO_INPUTS else []),
            *(["  beyond a fall"] if self.beyond_fall else []),
        ]
        for name, values in (("q", self.q), ("qd", self.qd)):
            named = (f"{key} {value:.6g}" for key, value in zip(COORDINATES, values, strict=True))
            lines.append(f"  {name}: {', '.join(named)}")
        return "\n".join(lines)


# Shapes of a trajectory's sampled fields without the axis of samples; the first five fields are required.
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
    """The result of an engine. Fields that the engine does not compute are None.

    All fields are given by name. Trajectories are compared by identity; compare their arrays for equal values.

    Attributes
    ----------
    engine, version : str
        Name and version of the engine.
    settings : dict
        JSON values of the settings that it ran with. With a release of its library that lacks something an engine adds
        ``left_out`` and ``replaced``: lines that say what it did otherwise, by name.
    time : ndarray, shape (n,)
        Times of the samples by the engine's own clock [s], one for each output time of the problem, or fewer if the run
        ended early. `velodrome.engines.admission.ride_engine` compares them with the problem's.
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
    fall : Fall or None
        The states just before and just after the fall that ended the run. The suite computes the time of the fall from
        them; the samples are those before it.
    friction : float or None
        Coefficient of friction of its contacts in every direction; None if the wheels are constrained to roll.
    unconverged_steps : int or None
        Number of steps in which an iteration, such as Newton's method or a contact solver, stopped before it met its
        tolerance; 0 if nothing iterates, None if the engine does not report it.
    largest_residual : float or None
        Largest relative residual that an iteration left in any step. For a contact problem it is the residual of the
        forces relative to the largest force; for Newton's method the residual relative to the forces in balance, such
        as the weights. None if the engine does not report it.
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
    fall: Fall | None = None
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
        """Return the first samples of the trajectory; steps and CPU time remain those of the whole."""
        return self if samples >= len(self.time) else self.part(slice(samples))

    def part(self, rows: slice) -> Self:
        """Return some samples of the trajectory; steps and CPU time remain those of the whole."""
        cut = {name: value[rows] for name in SHAPES if (value := getattr(self, name)) is not None}
        return replace(self, **cut)

    def until(self, time: float) -> Self:
        """Return the samples up to a time [s], at least the first; steps and CPU time remain those of the whole."""
        return self.first(max(1, int(np.searchsorted(self.time, time, side="right"))))

    def to_arrow(self) -> pa.Table:  # pyright: ignore[reportUnknownParameterType, reportUnknownMemberType]
        """Return the trajectory as a table, with the columns of the stored Parquet files.

        Units are in the metadata of the columns; everything that is not sampled is in the metadata of the schema.

        Returns
        -------
        pyarrow.Table
            A table with n rows in double precision.
        """
        from .storage import trajectory_table  # pyright: ignore[reportUnknownVariableType]

        return trajectory_table(self)  # pyright: ignore[reportUnknownVariableType]

    def to_pandas(self) -> pd.DataFrame:
        """Return the trajectory as a data frame, with the columns of the stored Parquet files.

        Returns
        -------
        pandas.DataFrame
            A data frame with n rows; the index is the time [s].

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        from .frames import trajectory_frame

        return trajectory_frame(self)

    def not_finite(self) -> list[str]:
        """Return the names of the given fields that are not finite in some samples."""
        given = ((name, getattr(self, name)) for name in SHAPES)
        return [name for name, value in given if value is not None and not np.isfinite(value).all()]


def _shorten(value: Any) -> str:
    """Return the repr of a value as a part of one line, cut in the middle where it is long."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 160 else f"{text[:100]} ... {text[-55:]}"


class Settings(BaseModel):
    """Base of an engine's settings: unknown names are refused, values are checked, and instances are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def refined(self, factor: float) -> Self:
        """Return these settings with another step, for a study of convergence.

        Parameters
        ----------
        factor : float
            Factor on the step. An adaptive method scales the tolerance that determines its steps.

        Raises
        ------
        ValueError
            If there is no step, or the new step would be out of its range.
        """
        values = self.model_dump()
        if "step" not in values:
            raise ValueError(f"{type(self).__name__} has no step to refine")
        return self.model_validate(values | {"step": values["step"] * factor})


class Engine(Protocol):
    """A multibody engine that simulates the bicycle.

    An engine is an object of any class with the members below. Its package adds it to the suite through an entry point
    of the group ``velodrome.engines`` with the engine's name; the suite itself is not changed. To write an engine:

    1. Derive its settings from `Settings`. Every field has a default, bounds, a description and its unit, as
       ``json_schema_extra={"unit": "1/s"}``; the description of a field ``step`` names its unit too, ``[s]``. With a
       field ``step`` the settings can be refined for studies of convergence; a method that chooses its own steps
       overrides ``refined`` and scales its tolerance by the factor to the power of its order.
    2. In ``check`` refuse what the engine cannot run, before anything is computed: raise `UnsuitableProblem` for a
       ground that the engine does not know, and ValueError for output times that its steps do not meet. The message is
       one line that says what would be right. `velodrome.engines.problems` has the usual questions: whether the
       ground is level, and whether a fixed step meets the output times.
    3. Start from exactly the coordinates and rates of the problem, for its bicycle and on its ground.
       `velodrome.engines.coordinates` computes the poses and twists of the bodies, and `velodrome.engines.rolling` the
       contacts of the wheels.
    4. Sample at the problem's times and stamp each sample with the engine's own clock. Call ``progress`` from time to
       time.
    5. Return coordinates, rates and poses of the bodies at every sample. For rigid bodies,
       `velodrome.engines.coordinates.coordinates_from_bodies` computes the coordinates. Whole turns of angles do not
       matter.
    6. List in ``gives`` the optional fields that the engine computes itself, and return them. Fields that it does not
       compute are None, and are never filled from the reference. Contact forces are those of the ground on the wheels,
       in inertial axes.
    7. If a ride cannot go on, return the samples so far with the reason in ``ended``. If not even the first sample can
       be computed, raise `EngineError`. Count the steps whose iterations did not converge.
       A ride ends where the bicycle falls, unless the problem asks for what follows (``beyond_fall``): watch for it
       with `velodrome.reference.fall.FallWatch`, and return the states around it in ``fall``. The suite also finds the
       fall of an engine that rides on, from its samples.
    8. Return from ``step_noise`` the relative error that a step may add beyond its method: 2^-52 for round-off, or the
       tolerance of its iterations or of its steps. The suite derives limits from it.
    9. Return the same bits for the same problem, whatever was simulated before. Do not print to stdout and do not
       change the process, not by an import either. Import modules that load slowly only where they are needed.
    10. Test the engine with `velodrome.testing.check_engine`, which diagnoses violations of these rules.

    ``examples/velodrome-symbrim`` is a complete package with an engine.

    An engine may also have a ``description``, one line of text, which `velodrome show` prints, and ``takes_inputs``. An
    engine that applies the torques and the steer damping in `Problem.inputs` sets it to True; without it the engine is
    never given a problem with inputs.

    An engine that rides with older releases of its library may say so by ``reach``, a
    `velodrome.engines.releases.LibraryReach`, and refuses the others in ``check``.

    Two further attributes serve `velodrome league`. ``settings_source`` is one line of text that says whose choice the
    defaults of the settings are, such as the page of the library's documentation. ``bit_variants`` maps descriptions to
    changed settings with which a ride should be the same to the last bit, such as another number of threads or another
    place in a batch. An engine that computes in float32 tells `velodrome float32` so by ``single_precision``, a
    `velodrome.engines.single_precision.SinglePrecision`.

    An engine may ride many problems in one call, by a method ``simulate_many(problems, settings, threads)``. It returns
    a list with a trajectory for each problem, or the exception that ``simulate`` would raise: the same to the bit but
    for the CPU time. `velodrome.engines.many.ride_engine_many` calls it.

    The tuple ``packages`` serves `velodrome history`: it names the packages of the library behind the engine, whose
    releases can be compared, where they are neither the engine's own package nor those of its extra.
    """

    @property
    def name(self) -> str:
        """Name in tables, files and on the command line."""
        ...

    @property
    def version(self) -> str:
        """Version of the library that it uses."""
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
            If the engine cannot run the problem with any settings. Runs that do not name the engine leave it out.
        ValueError
            If the settings do not fit the problem. The message is one line that says what is wrong and what would be
            right.
        """
        ...

    def step_noise(self, settings: Any) -> float:
        """Return the relative error that one step may add beyond its method, by round-off and iterations."""
        ...

    def simulate(self, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
        """Run a problem.

        Parameters
        ----------
        problem : Problem
        settings : Settings
            An instance of this engine's `settings`.
        progress : callable
            To be called from time to time with the simulated time reached [s].

        Returns
        -------
        Trajectory

        Raises
        ------
        EngineError
            If not even the first sample could be computed.
        """
        ...


class UnsuitableProblem(ValueError):
    """Raised for a problem of a kind that an engine does not support, such as an unknown ground."""


def describe_engine(engine: Engine) -> str:
    """Return a line that describes an engine: its ``description``, or the first line of its docstring."""
    own = engine.inner if isinstance(engine, GuardedEngine) else engine
    text = getattr(own, "description", None)
    if not isinstance(text, str) or not text.strip():
        text = next(iter((type(own).__doc__ or "").strip().splitlines()), "")
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def describe_settings_source(engine: Engine) -> str:
    """Return a line that says whose choice an engine's default settings are: its ``settings_source``."""
    own = engine.inner if isinstance(engine, GuardedEngine) else engine
    text = getattr(own, "settings_source", None)
    if not isinstance(text, str) or not text.strip():
        return DEFAULT_SETTINGS_SOURCE
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def list_bit_variants(engine: Engine) -> dict[str, dict[str, Any]]:
    """Return the changed settings with which an engine's rides should be the same to the last bit, by description."""
    own = engine.inner if isinstance(engine, GuardedEngine) else engine
    found: object = getattr(own, "bit_variants", None)
    if not isinstance(found, Mapping):
        return {}
    given = cast("Mapping[object, object]", found)
    return {
        str(text): {str(key): value for key, value in cast("Mapping[object, Any]", changes).items()}
        for text, changes in given.items()
        if isinstance(changes, Mapping)
    }


def find_ignored_inputs(engine: Engine, problem: Problem) -> str | None:
    """Return one line that says which inputs of a problem an engine would ignore; None if it applies all of them."""
    if problem.inputs == NO_INPUTS or getattr(engine, "takes_inputs", False) is True:
        return None
    return f"it applies no inputs, and the problem has {problem.inputs.describe()}; without inputs it rides"


def why_failed(error: Exception) -> str:
    """Return one line that says why an engine failed: the message of an `EngineError`, or the exception and its place.

    The place is the file and the line in the engine's code.
    """
    if isinstance(error, EngineError):
        return " ".join(str(error).split())
    place = None if isinstance(error, UnsuitableProblem) else where_raised(error)
    words = f"{type(error).__name__}: {error}" + (f" ({place})" if place else "")
    return " ".join(words.split())


@cache
def package_version(name: str) -> str:
    """Return the version of an installed package; cached, since a look-up takes longer than a short ride."""
    return version(name)
