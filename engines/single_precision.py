"""What an engine computes in single precision, and the engine that computes the same in double precision."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .engine import Engine
from .guard import GuardedEngine

# Moves states q, qd (n, 9) by a number of steps.
AdvanceStates = Callable[[np.ndarray, np.ndarray, int], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class SinglePrecisionVariant:
    """A way in which an engine computes in float32.

    Attributes
    ----------
    title : str
        What is computed or kept in float32.
    rounded : tuple of str
        The parts of the state that are rounded in every step, of ``positions`` and ``velocities``.
    changes : dict
        Settings that make the variant.
    engine : Engine or None
        An engine that rides in this way and is not announced; None if the announced engine does.
    """

    title: str
    rounded: tuple[str, ...] = ("positions", "velocities")
    changes: Mapping[str, Any] = field(default_factory=dict)
    engine: Any = None


@dataclass(frozen=True)
class SinglePrecision:
    """The attribute ``single_precision`` of an engine that can compute in float32.

    Attributes
    ----------
    counterpart : str
        Name of the engine that computes the same in float64. It has a method
        ``make_advance(problem, settings)``, which returns an `AdvanceStates`.
    variants : tuple of SinglePrecisionVariant
    common : dict
        Settings with which both are compared where a scenario sets no others, such as a tighter tolerance.
    store : callable
        Returns the positions and the velocities that the engine keeps as its state, two arrays, of q and qd (9,).
    """

    counterpart: str
    variants: tuple[SinglePrecisionVariant, ...]
    common: Mapping[str, Any]
    store: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def find_single_precision(engine: Engine) -> SinglePrecision | None:
    """Return what an engine says of its single precision; None if it computes in double precision alone."""
    own = engine.inner if isinstance(engine, GuardedEngine) else engine
    found = getattr(own, "single_precision", None)
    return found if isinstance(found, SinglePrecision) else None


def make_advance(engine: Engine, problem: Any, settings: Any) -> AdvanceStates:
    """Return the function that moves states of a problem by steps of an engine in double precision.

    Raises
    ------
    ValueError
        If the engine has none.
    """
    own = engine.inner if isinstance(engine, GuardedEngine) else engine
    make = getattr(own, "make_advance", None)
    if make is None:
        raise ValueError(f"engine {engine.name!r} cannot step from a given state; it has no make_advance")
    return make(problem, settings)
