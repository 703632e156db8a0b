"""User functions that give Exudyn the constraints of a rolling joint and their Jacobian.

For its initial accelerations the engine needs d(W)/dt q', with W the Jacobian. It differentiates W with respect to the
coordinates, one after the other, and sums the derivatives with the weights q' (NumericalConstraintJacobianDerivative).
Of a node with a rotation vector v these are not v', but the angular velocity in the body's axes, w = T(v) v' with the
tangent operator T. So W is evaluated there at v + T(v)^-1 d where the engine asks for it at v + d: its derivative along
w is then that in time. The node's derivative is right without this only where v is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np
from exudyn.lieGroupBasics import TExpSO3Inv

from ...reference.rim import rim_search
from . import general, kernel
from .attachment import read_node_coordinates, reference_coordinates
from .pose import EULER_PARAMETERS, FIXED, ROTATION_VECTOR, Frames

if TYPE_CHECKING:
    from .joint import RollingJoint

GRAVITY = 9.80665  # standard gravity [m/s^2], the scale of the force that closing a gap may take
PLACEMENT = 1e-10  # of the radius: what placing a wheel by Newton's method in double precision may leave
DIFFERENCE = 1e-5  # of a rotation vector [rad]: more than the engine's differences, which are 1e-7 of it by default

_INITIAL: Any = exu.ConfigurationType.Initial
_START_OF_STEP: Any = exu.ConfigurationType.StartOfStep


def make_constraint_functions(mbs: exu.MainSystem, joint: RollingJoint, ratio: float, labels: Sequence[str]) -> Any:
    """Make the connector's two user functions, which share one evaluation.

    The engine requests the Jacobian and the constraints at every iterate, with the same coordinates.

    Parameters
    ----------
    mbs : exudyn.MainSystem
    joint : RollingJoint
        Its object does not exist yet.
    ratio : float
        Newmark's beta / gamma.
    labels : sequence of str
        The wheels' names in messages.
    """
    frames, triads, radii, order, surface = joint.frames, joint.triads, joint.radii, joint.order, joint.surface
    start = reference_coordinates(mbs, joint.nodeNumbers)
    count, size = int(order.max()) + 1, len(start)
    function = surface.function.real
    where = (rim_search(surface, radii), function, surface.parameters)
    rows, values, scale = np.zeros((count, size)), np.zeros((2, count)), np.zeros(1)
    if _is_common(frames, order):
        state = np.stack([start, np.zeros(size)]).reshape(-1, 7)
        evaluate = kernel.constraints(state, frames.positions[:-1], triads, radii, *where, scale, rows, values).__next__
    else:
        state = np.stack([start, np.zeros(size)])
        evaluate = general.attached_constraints(
            state, frames, triads, radii, order, *where, scale, rows, values
        ).__next__
    evaluate()  # compiles
    memory, pack = state.data.cast("B"), Struct(f"{2 * size}d").pack_into
    on_position_level, on_velocity_level = values[0].tolist, values[1].tolist
    turns = _list_rotation_vectors(frames)
    evaluated_at: tuple[Any, Any, Any] = (None, None, None)

    def start_coordinates(mbs):
        return read_node_coordinates(mbs, joint.nodeNumbers, _START_OF_STEP)

    def begin_time(mbs, time):
        begun = mbs.systemData.GetTime(_START_OF_STEP)
        # A step that begins where one has ended is not the first; asking the engine takes longer.
        continued = scale[0] > 0 and begun == evaluated_at[0]
        scale[0] = ratio * (time - begun)
        if not continued and begun == mbs.systemData.GetTime(_INITIAL):
            pack(memory, 0, *start_coordinates(mbs), *[0.0] * size)
            evaluate()
            _check_start(joint, labels, time - begun, rows, values[0])

    def update(mbs, time, coordinates, rates):
        nonlocal evaluated_at
        if time != evaluated_at[0]:
            begin_time(mbs, time)
        pack(memory, 0, *coordinates, *rates)
        # Only the engine's differences leave the rates as they are, so the time need not be asked for at every iterate.
        if turns and rates == evaluated_at[2] and time == mbs.systemData.GetTime(_START_OF_STEP):
            _follow_rotations(state[0], start_coordinates(mbs), turns)
        evaluate()
        evaluated_at = (time, coordinates, rates)

    def constraint(mbs, time, _item, coordinates, rates, velocity_level):
        if (time, coordinates, rates) != evaluated_at:
            update(mbs, time, coordinates, rates)
        return on_velocity_level() if velocity_level else on_position_level()

    # The generator does not keep the surface's compiled function alive, but the default argument does.
    def jacobian(mbs, time, _item, coordinates, rates, _velocity_level, _function=function):
        if (time, coordinates, rates) != evaluated_at:
            update(mbs, time, coordinates, rates)
        return rows  # the engine makes a copy

    return constraint, jacobian


def _is_common(frames: Frames, order: np.ndarray) -> bool:
    """Whether the joint is of the kind that `kernel` is for, as in a bicycle."""
    *wheels, ground = frames.kinds
    return (
        ground == FIXED
        and not frames.positions[-1].any()
        and np.array_equal(frames.rotations[-1], np.eye(3))
        and all(kind == EULER_PARAMETERS for kind in wheels)
        and len(set(frames.starts[:-1])) == len(wheels)
        and bool(np.all(order >= 0))
    )


def _list_rotation_vectors(frames: Frames) -> list[slice]:
    """Return where the nodes' rotation vectors stand among the coordinates."""
    starts = sorted({int(first) for first in frames.starts[frames.kinds == ROTATION_VECTOR]})
    return [slice(first + 3, first + 6) for first in starts]


def _follow_rotations(coordinates: np.ndarray, start: np.ndarray, turns: Sequence[slice]) -> None:
    """Replace the engine's differences d of rotation vectors v by T(v)^-1 d, in ``coordinates`` (n,)."""
    for turn in turns:
        difference = coordinates[turn] - start[turn]
        # A state that is not a difference, which a user has set, is as it is.
        if np.abs(difference).max() <= DIFFERENCE:
            coordinates[turn] = start[turn] + TExpSO3Inv(start[turn]) @ difference


def _check_start(
    joint: RollingJoint, labels: Sequence[str], step: float, rows: np.ndarray, constraints: np.ndarray
) -> None:
    """Raise if a wheel has no contact at the start, or a gap that the first step cannot close.

    A gap that is closed in a step h takes accelerations of at least gap / h^2 times two, and so more than the weight if
    the gap is longer than the free fall in the step. ``step`` is 0 while the engine computes initial accelerations.
    """
    for label, order, radius in zip(labels, joint.order, joint.radii, strict=True):
        if not np.all(np.isfinite(rows[order[order >= 0]])):
            raise ValueError(
                f"the {label} does not touch the ground at the start: its edge lies flat on the surface, "
                "the surface is more curved than the wheel, or there is no ground"
            )
        if step <= 0 or order[2] < 0:
            continue
        gap, most = float(constraints[order[2]]), GRAVITY / 2 * step**2 + PLACEMENT * radius
        if abs(gap) > most:
            side = "above" if gap > 0 else "below"
            raise ValueError(
                f"the {label} starts {abs(gap) * 1e3:.6g} mm {side} the ground; closing more than "
                f"{most * 1e3:.2g} mm, the free fall in the first step of {step:g} s, takes more than the weight; "
                "move its centre by minus the gap along the normal, both from velodrome.engines.rolling.observe_wheel"
            )
