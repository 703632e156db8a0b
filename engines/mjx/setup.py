"""What the compiled functions are made for, and what they are given: nothing of it changes during a ride."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from .ground import Height


@dataclass(frozen=True)
class MjxSetup:
    """What is compiled into the functions of a ride; rides with equal setups share them.

    Attributes
    ----------
    rolling : {"contacts", "multipliers"}
        What holds the wheels: MJX's contacts, or the exact forces of rolling.
    height : callable or None
        The ground; None if it is level.
    bodies : tuple of int
        MuJoCo's ids of the four bodies, in the order of `BODIES`.
    wheels : tuple of int
        Those of the rear and the front wheel.
    planes : tuple of int
        Places of the moving planes below them in `mocap_pos`; none on level ground.
    batch_size : int
    """

    rolling: Literal["contacts", "multipliers"]
    height: Height | None
    bodies: tuple[int, ...]
    wheels: tuple[int, int]
    planes: tuple[int, ...]
    batch_size: int


class MjxInputs(NamedTuple):
    """Numbers that the compiled functions take besides the model: arrays of JAX.

    Attributes
    ----------
    parameters : array
        Parameters of the surface.
    radii : array, shape (2,)
        Radii of the wheels [m].
    stabilisation : array, shape ()
        Rate at which gaps and slip decay under the exact forces of rolling [1/s].
    converged_below : array, shape ()
        Relative residual up to which the contact solver counts as converged.
    """

    parameters: Any
    radii: Any
    stabilisation: Any
    converged_below: Any


class StepReport(NamedTuple):
    """What a step tells of the new state besides its data: arrays of JAX.

    Attributes
    ----------
    force : array, shape (2, 3)
        Forces of the ground on the wheels, inertial axes [N].
    standing : array, shape ()
        Whether both wheels have a contact.
    residual : array, shape ()
        Residual of the contact solver, relative to the forces.
    """

    force: Any
    standing: Any
    residual: Any
