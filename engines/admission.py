"""Simulation with an engine, and validation of the trajectory that it returns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np

from ..reference.fall import Fall, fall_criterion, find_first_ending, heights_above_fallen, solve_fall
from ..reference.rim import find_second_touch, require_clear_rims
from ..reference.wheel_overlap import find_wheel_collision, require_separate_wheels
from .disk_arrays import is_long, move_to_disk
from .engine import (
    REQUIRED,
    SHAPES,
    Engine,
    EngineError,
    Problem,
    Progress,
    Settings,
    Trajectory,
    find_ignored_inputs,
)
from .guard import simulate_guarded
from .releases import split_adaptations

# Largest relative error of a sample's time, the same as `velodrome.reference.simulate.steps_per_output` allows for a
# step. An engine that sums up its steps errs by at most half a unit of round-off per addition: less than this limit in
# nine million steps.
CLOCK_ERROR = 1e-9
# Largest height by which the states around a fall may miss the side of the criterion that they are said to lie on,
# relative to the height of the criterion. Joints that drift make an engine's own height differ from that of its
# coordinates, by far less than this in any ride whose reports agree.
FALL_ERROR = 0.01


def ride_engine(
    engine: Engine, problem: Problem, settings: Any, progress: Progress, folder: Path | None = None
) -> Trajectory:
    """Run a problem in an engine and validate the trajectory.

    The trajectory is cut before a state that is not finite, and where a rim touches the ground at a second place or the
    wheels collide. An engine may detect this in its own steps; here the samples of every engine are checked. The
    engine's times must agree with the problem's up to `CLOCK_ERROR`; they are then replaced by the problem's, so that
    engines can be compared sample by sample.

    Parameters
    ----------
    engine : Engine
    problem : Problem
    settings : Settings
    progress : callable
    folder : Path, optional
        Folder for a temporary file with the arrays of a long ride, see `velodrome.engines.disk_arrays`; by default
        they are in memory.

    Returns
    -------
    Trajectory

    Raises
    ------
    OSError
        If the temporary file cannot be written.
    EngineError
        If the engine does not apply the problem's inputs, a rim lies inside the ground or the wheels overlap at the
        start, or the engine returns no trajectory, or one that does not fit the problem. The message states the fault.
    Exception
        Any exception that the engine raises.
    """
    require_sound_start(engine, problem)
    return admit_trajectory(engine, problem, settings, simulate_guarded(engine, problem, settings, progress), folder)


def require_sound_start(engine: Engine, problem: Problem) -> None:
    """Refuse inputs that an engine does not apply, rims inside the ground, and wheels that overlap.

    Raises
    ------
    EngineError
        With the reason.
    """
    ignored = find_ignored_inputs(engine, problem)
    if ignored is not None:
        raise EngineError(ignored)
    try:
        require_clear_rims(problem.bicycle, problem.surface, problem.q, may_sink=True)
        require_separate_wheels(problem.bicycle, problem.q)
    except ValueError as error:
        raise EngineError(str(error)) from error


def admit_trajectory(
    engine: Engine, problem: Problem, settings: Any, trajectory: Any, folder: Path | None = None
) -> Trajectory:
    """Validate what an engine returns for a problem, and cut it, as `ride_engine` does.

    Raises
    ------
    EngineError
        If it is no trajectory, or one that does not fit the problem.
    """
    if not isinstance(trajectory, Trajectory):
        raise EngineError(f"it gave a {type(trajectory).__name__}, not a Trajectory")
    for wrong in _list_faults(engine, problem, settings, trajectory):
        raise EngineError(wrong)
    trajectory = _copy_arrays(trajectory, folder)
    asked = problem.times[: len(trajectory.time)]
    if not np.array_equal(trajectory.time, asked):
        trajectory = replace(trajectory, time=asked.copy())
    finite = np.all([np.isfinite(_flatten_samples(getattr(trajectory, name))).all(axis=1) for name in REQUIRED], axis=0)
    if finite.all():
        return _cut_at_collision(problem, trajectory)
    bad = int(np.argmin(finite))
    if bad == 0:
        raise EngineError("its first state is not finite")
    ended = f"its state is not finite at {trajectory.time[bad]:.6g} s"
    return _cut_at_collision(problem, replace(trajectory.first(bad), ended=trajectory.ended or ended, fall=None))


def _copy_arrays(trajectory: Trajectory, folder: Path | None) -> Trajectory:
    """Copy a trajectory's arrays, which an engine may reuse, and convert numpy's scalars to Python's."""
    trajectory = replace(trajectory, steps=int(trajectory.steps), cpu_time=float(trajectory.cpu_time))
    if folder is not None and is_long(trajectory):
        return move_to_disk(trajectory, folder)
    given = {name: value for name in SHAPES if (value := getattr(trajectory, name)) is not None}
    copies: dict[str, Any] = {name: np.array(value, dtype=float, order="C") for name, value in given.items()}
    return replace(trajectory, **copies)


def _cut_at_collision(problem: Problem, trajectory: Trajectory) -> Trajectory:
    """Return the trajectory up to where a rim touches a second place or the wheels collide.

    It keeps at least its first sample.
    """
    ending = find_first_ending(
        find_second_touch(problem.bicycle, problem.surface, trajectory.time, trajectory.q, trajectory.qd),
        find_wheel_collision(problem.bicycle, trajectory.time, trajectory.q),
    )
    if ending is None:
        return trajectory
    return replace(trajectory.until(ending.time), ended=ending.why, fall=None)


def _flatten_samples(values: np.ndarray) -> np.ndarray:
    return values.reshape(len(values), -1)


def _is_line(text: object) -> bool:
    """Return whether something is one line of text that is not empty."""
    return isinstance(text, str) and bool(text.strip()) and text.isprintable()


def _list_time_faults(asked: np.ndarray, own: np.ndarray) -> Iterator[str]:
    """List the faults of an engine's sample times."""
    if len(own) > len(asked):
        yield f"it gives {len(own)} samples; {len(asked)} are asked for"
        return
    off = np.abs(own - asked[: len(own)])
    wrong = ~(off <= CLOCK_ERROR * asked[: len(own)])  # also where a time is not a number
    if wrong.any():
        first = int(np.argmax(wrong))
        yield (
            f"its sample {first} is at {own[first]:.9g} s by its own clock, not at the {asked[first]:.9g} s asked for: "
            f"{off[first]:.2g} s off"
        )


def _list_fall_faults(problem: Problem, trajectory: Trajectory) -> Iterator[str]:
    """List the faults of the states around a fall."""
    fall: Any = trajectory.fall  # engines may return anything
    if fall is None:
        return
    if problem.beyond_fall:
        yield "it ends at a fall, but the problem asks for what follows"
        return
    shapes = {"time": (2,), "q": (2, 9), "qd": (2, 9)}
    if not isinstance(fall, Fall) or any(
        not isinstance(value := getattr(fall, name), np.ndarray) or value.shape != shape or value.dtype.kind != "f"
        for name, shape in shapes.items()
    ):
        yield f"its fall is {fall!r}; it must be a Fall with arrays of floats of shapes (2,), (2, 9) and (2, 9)"
        return
    if not all(np.isfinite(getattr(fall, name)).all() for name in shapes) or not fall.time[0] < fall.time[1]:
        yield "its states around the fall are not finite, or their times do not rise"
        return
    where = problem.bicycle, problem.surface
    (before, after), rates = heights_above_fallen(*where, fall.q, fall.qd)
    room = FALL_ERROR * fall_criterion(problem.bicycle).limit
    if heights_above_fallen(*where, problem.q[None], problem.qd[None])[0][0] < room:
        return  # it lies at the start already
    if not (before > -room and after < room):
        yield (
            f"its fall is no fall: the rear frame's centre of mass is {before:.3g} m above the height of a fallen "
            f"bicycle before it, and {after:.3g} m after it"
        )
        return
    fell, samples = solve_fall(fall.time, np.array([before, after]), rates), len(trajectory.time)
    if not 0 < samples < len(problem.times):
        if samples:
            yield f"it gives all samples and a fall at {fell:.9g} s"
        return
    low, high = problem.times[samples - 1], problem.times[samples]
    if not low * (1 - CLOCK_ERROR) <= fell <= high * (1 + CLOCK_ERROR):
        yield f"it fell at {fell:.9g} s, not between its last sample at {low:.9g} s and the next at {high:.9g} s"


def _list_faults(engine: Engine, problem: Problem, settings: Settings, trajectory: Trajectory) -> Iterator[str]:
    """List the faults that make a result no valid trajectory of the problem."""
    given = settings.model_dump(mode="json")
    chosen, adapted = split_adaptations(trajectory.settings, given)
    for name, stated, own in (
        ("engine", trajectory.engine, engine.name),
        ("version", trajectory.version, engine.version),
        ("settings", chosen, given),
    ):
        if stated != own:
            yield f"its trajectory is of {name} {stated!r}, not {own!r}"
    for key, lines in adapted.items():
        if not (isinstance(lines, dict) and lines and all(_is_line(text) for pair in lines.items() for text in pair)):
            yield f"its settings say {key} {lines!r}; it must be lines of text by name"
    samples = np.size(trajectory.time)
    for name, shape in SHAPES.items():
        value = getattr(trajectory, name)
        if value is None:
            if name in REQUIRED:
                yield f"its {name} is missing"
            continue
        if name not in (*REQUIRED, *engine.gives):
            yield f"it gives {name}, which it does not list in gives"
        if not isinstance(value, np.ndarray) or value.dtype.kind != "f":
            yield f"its {name} is no array of floats"
        elif type(value) is not np.ndarray or value.dtype not in (np.float64, np.float32):
            yield f"its {name} is a {type(value).__name__} of {value.dtype}; it must be a plain ndarray of float64"
        elif value.shape != (samples, *shape):
            yield f"its {name} has shape {value.shape}; it must be {(samples, *shape)}"
    if samples == 0:
        yield "its trajectory has no sample"
    yield from _list_time_faults(problem.times, trajectory.time)
    if samples < len(problem.times) and trajectory.ended is None:
        yield f"it ends at {trajectory.time[-1]:.6g} s and does not say why"
    for name, kind, what in (("steps", Integral, "a whole number"), ("cpu_time", Real, "a finite number of seconds")):
        value = getattr(trajectory, name)
        if not isinstance(value, kind) or isinstance(value, bool) or not 0 <= float(value) < np.inf:
            yield f"its {name} is {value!r}; it must be {what}, not negative"
    yield from _list_fall_faults(problem, trajectory)
    ended = trajectory.ended
    if ended is not None and not _is_line(ended):
        yield f"its ended is {ended!r}; it must be one line of text, or None"
    count, residual = trajectory.unconverged_steps, trajectory.largest_residual
    if count is not None and not (isinstance(count, int) and 0 <= count <= trajectory.steps):
        yield f"its unconverged_steps is {count!r}; it must be a number of its {trajectory.steps} steps, or None"
    if residual is not None and not (isinstance(residual, float) and 0 <= residual < np.inf):
        yield f"its largest_residual is {residual!r}; it must be a finite number that is not negative, or None"
