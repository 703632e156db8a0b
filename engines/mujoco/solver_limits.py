"""Limits of MuJoCo's solver that nearly rigid contact rows need, set while blocks are open on a model."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Lock

import mujoco

# `settings.ExactContactSettings.solver_options` says why these are needed. With rows 1e11 times as stiff as the model,
# the tolerance of the cost is one of the forces of (1e-20 * 1e11)^(1/2) = 3e-5; with a hundredth of it the solver may
# circle in round-off.
LEAST_ITERATIONS, LEAST_SEARCH, LARGEST_TOLERANCE, SEARCH_SLOPE = 10_000, 200, 1e-20, 1e-14

_lock = Lock()


@dataclass
class _Raised:
    """Options of a model before and since its first block, and the number of its blocks."""

    before: dict[str, float]
    since: dict[str, float]
    blocks: int = 0


_raised: dict[int, _Raised] = {}  # by the model's address


@contextmanager
def raise_solver_limits(model: mujoco.MjModel) -> Iterator[None]:
    """Let MuJoCo's solver iterate as long as it needs until the model's last block ends.

    Options that the user changes inside the block stay as they are.
    """
    with _lock:
        if model._address not in _raised:
            _raised[model._address] = _raise(model)
        _raised[model._address].blocks += 1
    try:
        yield
    finally:
        with _lock:
            raised = _raised[model._address]
            raised.blocks -= 1
            if raised.blocks == 0:
                _restore(model, _raised.pop(model._address))


def _raise(model: mujoco.MjModel) -> _Raised:
    options = model.opt
    tolerance = min(options.tolerance, LARGEST_TOLERANCE)
    since = {
        "iterations": max(options.iterations, LEAST_ITERATIONS),
        "ls_iterations": max(options.ls_iterations, LEAST_SEARCH),
        "tolerance": tolerance,
        "ls_tolerance": max(options.ls_tolerance, SEARCH_SLOPE / tolerance) if tolerance > 0 else options.ls_tolerance,
    }
    before = {name: getattr(options, name) for name in since}
    for name, value in since.items():
        setattr(options, name, value)
    return _Raised(before, since)


def _restore(model: mujoco.MjModel, raised: _Raised) -> None:
    for name, value in raised.since.items():
        if getattr(model.opt, name) == value:
            setattr(model.opt, name, raised.before[name])
