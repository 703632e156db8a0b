"""What an engine gives is looked at before anything is made of it: an engine may come from anywhere."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from .engine import REQUIRED, SHAPES, Engine, EngineError, Problem, Progress, Settings, Trajectory
from .guard import simulate


def ride(engine: Engine, problem: Problem, settings: Any, progress: Progress) -> Trajectory:
    """Run a problem in an engine and look at what it gives.

    A state that is not finite ends the ride before it.

    Parameters
    ----------
    engine : Engine
    problem : Problem
    settings : Settings
    progress : callable

    Returns
    -------
    Trajectory

    Raises
    ------
    EngineError
        If the engine gives no trajectory, or one that is none of this problem: what is wrong with it.
    Exception
        Whatever the engine raises.
    """
    trajectory = simulate(engine, problem, settings, progress)
    if not isinstance(trajectory, Trajectory):
        raise EngineError(f"it gave a {type(trajectory).__name__}, not a Trajectory")
    for wrong in _faults(engine, problem, settings, trajectory):
        raise EngineError(wrong)
    finite = np.all([np.isfinite(_rows(getattr(trajectory, name))).all(axis=1) for name in REQUIRED], axis=0)
    if finite.all():
        return trajectory
    bad = int(np.argmin(finite))
    if bad == 0:
        raise EngineError("its first state is not finite")
    ended = f"its state is not finite at {trajectory.time[bad]:.6g} s"
    return replace(trajectory.first(bad), ended=trajectory.ended or ended)


def _rows(values: np.ndarray) -> np.ndarray:
    return values.reshape(len(values), -1)


def _faults(engine: Engine, problem: Problem, settings: Settings, trajectory: Trajectory) -> Iterator[str]:
    """What makes it no trajectory of the problem, in words."""
    for name, said, own in (
        ("engine", trajectory.engine, engine.name),
        ("version", trajectory.version, engine.version),
        ("settings", trajectory.settings, settings.model_dump(mode="json")),
    ):
        if said != own:
            yield f"its trajectory is of {name} {said!r}, not {own!r}"
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
        elif value.shape != (samples, *shape):
            yield f"its {name} has shape {value.shape}; it must be {(samples, *shape)}"
    if samples == 0:
        yield "its trajectory has no sample"
    if samples > len(problem.times) or not np.array_equal(trajectory.time, problem.times[:samples]):
        yield "its times are not the problem's, from the first on"
    if samples < len(problem.times) and trajectory.ended is None:
        yield f"it ends at {trajectory.time[-1]:.6g} s and does not say why"
    for name in ("steps", "cpu_time"):
        if not np.isfinite(getattr(trajectory, name)):
            yield f"its {name} is {getattr(trajectory, name)!r}"
    count, residual = trajectory.unconverged_steps, trajectory.largest_residual
    if count is not None and not (isinstance(count, int) and 0 <= count <= trajectory.steps):
        yield f"its unconverged_steps is {count!r}; it must be a number of its {trajectory.steps} steps, or None"
    if residual is not None and not (isinstance(residual, float) and 0 <= residual < np.inf):
        yield f"its largest_residual is {residual!r}; it must be a finite number that is not negative, or None"
