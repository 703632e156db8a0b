"""Circular motions that scenarios start from: each is searched for once, and many together where they are alike."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from ...reference.bicycle import Bicycle
from ...reference.branches import MotionRequest, find_family_motions
from ...reference.circular import CircularMotion
from ...reference.families import find_motion
from ...reference.inputs import Inputs
from ...reference.surface import Surface, SurfaceOfRevolution
from .schema import CircularTable
from .surfaces import make_bowl


class MotionKey(NamedTuple):
    """Arguments of `velodrome.reference.families.find_motion`."""

    bicycle: Bicycle
    surface: SurfaceOfRevolution
    rear_rate: float
    family: int | None
    near: tuple[float, float] | None
    inputs: Inputs

    @property
    def is_of_family(self) -> bool:
        """Whether the motion is a hands-free one of a family."""
        return self.family is not None and self.inputs.steer_torque == 0 and self.inputs.rear_wheel_torque == 0


# Runs that disturb the same motion in different ways share its computation.
_motions: dict[MotionKey, tuple[int | None, CircularMotion]] = {}
_MOST_MOTIONS = 4096


def make_motion_key(table: CircularTable, bicycle: Bicycle, surface: Surface, inputs: Inputs) -> MotionKey:
    """Return the arguments of the search for a scenario's motion.

    Raises
    ------
    ScenarioError
        If the ground is not a surface of revolution.
    """
    near = (table.near.lean, table.near.steer) if table.near is not None else None
    return MotionKey(bicycle, make_bowl(surface), table.rear_rate, table.family, near, inputs)


def find_alike_motions(keys: Iterable[MotionKey]) -> None:
    """Find many motions in less time than one by one, where it is clear which they are, and keep them."""
    missing = {
        key: MotionRequest(key.bicycle, key.surface, key.rear_rate, key.family, key.near)
        for key in keys
        if key not in _motions and key.family is not None and key.is_of_family
    }
    for (key, request), motion in zip(missing.items(), find_family_motions(list(missing.values())), strict=True):
        if motion is not None:
            _keep_motion(key, (request.family, motion))


def find_kept_motion(key: MotionKey) -> tuple[int | None, CircularMotion]:
    """Return a motion and its family as `velodrome.reference.families.find_motion` does, searched for once."""
    # Read once: another thread may clear the dictionary.
    found = _motions.get(key)
    if found is None:
        found = find_motion(*key)
        _keep_motion(key, found)
    return found


def _keep_motion(key: MotionKey, found: tuple[int | None, CircularMotion]) -> None:
    if len(_motions) >= _MOST_MOTIONS:
        _motions.clear()
    _motions[key] = found
