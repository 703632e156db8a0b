"""Compiled callbacks that MuJoCo calls inside its step: knife-edge contacts, and forces instead of contacts.

A wheel is a circle of radius r about its geom's z axis. Its contact with the ground z = f(x, y) is the
closest approach of the two (`velodrome.reference.kernels.contact`), and a material point of the rim there has

    velocity      v = Jp q'
    acceleration  Jp q'' + gamma,    gamma = Jp' q' + w x (r a' t)

where Jp' follows the material point and a' t r is how the contact runs along the rim. MuJoCo's contact rows
prescribe J q'' = aref, aref = -b J q' - k gap, as if gamma were zero; `correct_reference` subtracts it.

`press` leaves the contacts to itself: it solves, for the six forces on two wheels,

    Jp M^-1 Jp^T F = -(Jp a + gamma + s^2 gap n + 2 s v),    M a = passive - bias

and applies Jp^T F; s is a rate of stabilisation, which on the constraints adds nothing.

`watch_iterations` looks on: what MuJoCo's solver makes of one evaluation is judged when the next one begins, which is
the first moment after it that a callback sees (`convergence` says what it is judged by). `correct_reference` does so
too.

What the callbacks work on is one `BLACKBOARD` a process: numbers, and addresses of arrays that stay where
they are while a model lives. Its own address comes from a function that the linker resolves, so that the
code can be kept on disk. All of it is in one file, because a changed file is what renews numba's cache.
"""

# numba gives an intrinsic its typing context, and knows what its results are.
# pyright: reportCallIssue=false, reportGeneralTypeIssues=false

from __future__ import annotations

import llvmlite.binding as llvm
import numpy as np
from numba import cfunc, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from ...reference.kernels import contact
from ...reference.kernels.compilation import compile_callback, jit
from ...reference.kernels.linear import factorise, solve_factorised
from ...reference.kernels.rim import RimSearch, find_contact, level_axes
from ...reference.kernels.vector import add, cross, dot
from ...reference.kernels.wheel import contact_run
from .library import announce_collision

WHEEL_COUNT = 8  # the most that a blackboard has room for
# A wheel whose centre is less than this above its contact lies flat [m].
FLAT = 1e-4

_ADDRESS = np.uintp
BLACKBOARD = np.dtype(
    [
        # Callbacks are for one model's one state; others pass.
        ("model", _ADDRESS),
        ("data", _ADDRESS),
        ("collision", _ADDRESS),  # MuJoCo's own function for planes and cylinders
        ("surface", _ADDRESS),
        ("parameters", _ADDRESS),
        ("parameter_count", np.int64),
        # How closely to look at rims, `velodrome.reference.kernels.rim.RimSearch`.
        ("curved", np.int64),
        ("bends", _ADDRESS),
        ("bend_count", np.int64),
        ("bend_width", np.float64),
        ("detail", np.float64),
        ("samples", np.int64),
        ("speeds", np.int64),
        # Arrays of the state that never move.
        ("qvel", _ADDRESS),
        ("geom_xpos", _ADDRESS),
        ("geom_xmat", _ADDRESS),
        ("qacc", _ADDRESS),
        ("qacc_smooth", _ADDRESS),
        ("qacc_warmstart", _ADDRESS),
        ("qfrc_bias", _ADDRESS),
        ("qfrc_passive", _ADDRESS),
        ("qfrc_applied", _ADDRESS),
        ("qfrc_smooth", _ADDRESS),
        ("qfrc_constraint", _ADDRESS),
        ("M", _ADDRESS),
        ("M_rownnz", _ADDRESS),
        ("M_rowadr", _ADDRESS),
        ("M_colind", _ADDRESS),
        ("M_entries", np.int64),
        # The inertia of the last evaluation, whose solution is judged when the next one begins.
        ("kept_M", _ADDRESS),
        ("pending", np.int64),
        # What the judge counts: evaluations since a step that Python knows, and the steps that were left unconverged.
        ("evaluations", np.int64),
        ("evaluations_per_step", np.int64),
        ("since_step", np.int64),
        ("converged_below", np.float64),
        ("wrong_above", np.float64),
        ("unconverged", np.int64),
        ("last_unconverged", np.int64),
        ("largest_residual", np.float64),
        ("wrong_step", np.int64),  # -1 if there is none
        ("wrong_residual", np.float64),
        # Where the state keeps what does move, and where a contact keeps its parts.
        ("ncon_at", np.int64),
        ("contact_at", np.int64),
        ("efc_aref_at", np.int64),
        ("efc_R_at", np.int64),
        ("efc_KBIP_at", np.int64),
        ("contact_size", np.int64),
        ("frame_at", np.int64),
        ("margin_at", np.int64),
        ("friction_at", np.int64),
        ("geom_at", np.int64),
        ("row_at", np.int64),
        ("pyramidal", np.int64),
        ("stabilisation", np.float64),
        # The wheels.
        ("wheels", np.int64),
        ("ground", np.int64, WHEEL_COUNT),
        ("geom", np.int64, WHEEL_COUNT),
        ("body", np.int64, WHEEL_COUNT),
        ("radius", np.float64, WHEEL_COUNT),
        ("place", np.float64, (WHEEL_COUNT, 3)),  # xi, eta, angle of the contacts
        ("force", np.float64, (WHEEL_COUNT, 3)),
        ("lost", np.int64),  # how often a wheel had no contact point
        ("found", np.int64),  # contacts made since the callbacks were installed
    ],
    align=True,
)

board = np.zeros(1, BLACKBOARD)
_BOARD_AT = board.ctypes.data
_WHERE = "velodrome_mujoco_blackboard"


# Compiled anew in every process, the only code that knows an address.
@cfunc(types.uintp())
def _where_the_board_is():
    return _BOARD_AT


llvm.add_symbol(_WHERE, _where_the_board_is.address)
announce_collision("mj_jac", "mj_jacDot", "mj_solveM", "mj_fwdActuation", "mj_fwdAcceleration")

_pointer = types.voidptr
_numbers = types.CPointer(types.float64)
_where = types.ExternalFunction(_WHERE, types.uintp())
_jac = types.ExternalFunction("mj_jac", types.void(_pointer, _pointer, _numbers, _numbers, _numbers, types.int32))
_jac_dot = types.ExternalFunction(
    "mj_jacDot", types.void(_pointer, _pointer, _numbers, _numbers, _numbers, types.int32)
)
_solve_mass = types.ExternalFunction("mj_solveM", types.void(_pointer, _pointer, _numbers, _numbers, types.int32))
_actuation = types.ExternalFunction("mj_fwdActuation", types.void(_pointer, _pointer))
_acceleration = types.ExternalFunction("mj_fwdAcceleration", types.void(_pointer, _pointer))
_SURFACE = types.FunctionType(
    types.UniTuple(types.float64, 6)(types.float64, types.float64, types.Array(types.float64, 1, "C"))
)
COLLISION = types.int32(_pointer, _pointer, _pointer, types.int32, types.int32, types.float64)
CONTROL = types.void(_pointer, _pointer)
_COLLISION = types.FunctionType(COLLISION)


@intrinsic
def _function_at(typing, address, kind):
    """Make an address a function of a given type, called as C functions are."""
    function = kind.instance_type

    def build(context, builder, signature, arguments):
        made = cgutils.create_struct_proxy(function)(context, builder)
        null = cgutils.voidptr_t(None)
        made.c_addr = builder.inttoptr(arguments[0], cgutils.voidptr_t)
        made.py_addr, made.jit_addr = null, null
        return made._getvalue()

    return function(address, kind), build


@intrinsic
def _pointer_at(typing, address):
    """Make an integer an address."""

    def build(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return _pointer(address), build


@intrinsic
def _address_of(typing, pointer):
    """Make an address an integer."""

    def build(context, builder, signature, arguments):
        return builder.ptrtoint(arguments[0], context.get_value_type(types.uintp))

    return types.uintp(pointer), build


@jit
def _reals(address, count):
    return carray(_pointer_at(address), (count,), np.float64)


@jit
def _integers(address, count):
    return carray(_pointer_at(address), (count,), np.int32)


@jit
def _integer(address):
    return carray(_pointer_at(address), (1,), np.int32)[0]


@jit
def _stored(address):
    return carray(_pointer_at(address), (1,), np.uintp)[0]


@jit
def _blackboard():
    return carray(_pointer_at(_where()), (1,), BLACKBOARD)[0]


@jit
def _is_for(board, model, data):
    return _address_of(model) == board.model and _address_of(data) == board.data


@jit
def _wheel(board, k):
    """Return (centre, axle) of wheel k."""
    geom = board.geom[k]
    at, turn = _reals(board.geom_xpos, 3 * geom + 3), _reals(board.geom_xmat, 9 * geom + 9)
    i, j = 3 * geom, 9 * geom
    return (at[i], at[i + 1], at[i + 2]), (turn[j + 2], turn[j + 5], turn[j + 8])


@jit
def _contact_at(board, k):
    """Evaluate wheel k's contact at its place on the blackboard."""
    centre, axle = _wheel(board, k)
    x, z = level_axes(axle)
    function = _function_at(board.surface, _SURFACE)
    xi, eta, angle = board.place[k, 0], board.place[k, 1], board.place[k, 2]
    parameters = _reals(board.parameters, board.parameter_count)
    here = contact.equations(centre, x, z, board.radius[k], xi, eta, angle, function, parameters)
    return centre, axle, here


@jit
def _find(board, k):
    """Search wheel k's contact from its pose alone and keep its place; True where it stands on the ground."""
    centre, axle = _wheel(board, k)
    x, z = level_axes(axle)
    radius, function = board.radius[k], _function_at(board.surface, _SURFACE)
    parameters = _reals(board.parameters, board.parameter_count)
    ground = RimSearch(
        board.curved != 0, _reals(board.bends, board.bend_count), board.bend_width, board.detail, board.samples
    )
    xi, eta, angle, found = find_contact(centre, x, z, radius, ground, function, parameters)
    board.place[k, 0], board.place[k, 1], board.place[k, 2] = xi, eta, angle
    if not found:
        return False
    here = contact.equations(centre, x, z, radius, xi, eta, angle, function, parameters)
    # Not ">=": what is no number is no contact either. Above its centre the search went round the rim.
    return bool(dot(here.arm, here.normal) < -FLAT) and bool(np.isfinite(here.gap))


@jit
def _motion(board, k, model, data, rows, turning):
    """Fill the contact point's velocity rows (3, n); return (contact, velocity, gamma).

    ``turning`` (3, n) is room for the rows of the angular velocity.
    """
    centre, _, here = _contact_at(board, k)
    point, rate = np.empty(3), np.empty((6, board.speeds))
    for i in range(3):
        point[i] = centre[i] + here.arm[i]
    body = types.int32(board.body[k])
    _jac(model, data, rows.ctypes, turning.ctypes, point.ctypes, body)
    _jac_dot(model, data, rate[:3].ctypes, rate[3:].ctypes, point.ctypes, body)
    qvel = _reals(board.qvel, board.speeds)
    v, w, gamma = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(3):
        for j in range(board.speeds):
            v[i] += rows[i, j] * qvel[j]
            w[i] += turning[i, j] * qvel[j]
            gamma[i] += rate[i, j] * qvel[j]
    velocity, spin = (v[0], v[1], v[2]), (w[0], w[1], w[2])
    run = contact_run(here, board.radius[k], velocity, spin)
    return here, velocity, add((gamma[0], gamma[1], gamma[2]), cross(spin, run))


@compile_callback(COLLISION, error_model="numpy")
def touch(model, data, made, ground, geom, margin):
    """Collision function for planes and cylinders: a knife edge's contact with the true ground.

    Other planes and cylinders, and other models, get MuJoCo's own. A wheel without a contact point makes
    no contact and is counted.
    """
    board = _blackboard()
    if _is_for(board, model, data):
        for k in range(board.wheels):
            if board.geom[k] == geom and board.ground[k] == ground:
                if not _find(board, k):
                    board.lost += 1
                    return types.int32(0)
                board.found += 1
                centre, _, here = _contact_at(board, k)
                out = _reals(_address_of(made), 10)
                out[0] = here.gap
                for i in range(3):
                    out[1 + i] = centre[i] + here.arm[i]
                    out[4 + i] = here.normal[i]
                    out[7 + i] = here.tangent[i]
                return types.int32(1)
    return _function_at(board.collision, _COLLISION)(model, data, made, ground, geom, margin)


@jit
def _wheel_of(board, geom, ground):
    for k in range(board.wheels):
        if board.geom[k] == geom and board.ground[k] == ground:
            return k
    return -1


@jit
def _row_axes(board, contact_at):
    """Directions (3 or 4, 3) of MuJoCo's rows of one contact: normal and tangents, or the edges of a pyramid."""
    frame, friction = _reals(contact_at + board.frame_at, 9), _reals(contact_at + board.friction_at, 2)
    axes = np.empty((4 if board.pyramidal else 3, 3))
    for j in range(3):
        if board.pyramidal:
            for i in range(2):
                for side in range(2):
                    axes[2 * i + side, j] = frame[j] + (1 - 2 * side) * friction[i] * frame[3 * (i + 1) + j]
        else:
            for i in range(3):
                axes[i, j] = frame[3 * i + j]
    return axes


@jit
def _correct_rows(board, contact_at, first_row, aref, kbip, along):
    """Subtract gamma along each row from one contact's reference accelerations, and the margin from its distance."""
    margin = _reals(contact_at + board.margin_at, 1)[0]
    # MuJoCo holds a wheel at its margin; it shall touch.
    stiffness = kbip[4 * first_row] * kbip[4 * first_row + 2]
    for i in range(len(along)):
        aref[first_row + i] -= along[i]
        if i == 0 or board.pyramidal:
            aref[first_row + i] -= stiffness * margin


@jit
def _kept_mass(board):
    """Inertia (n, n) of the last evaluation."""
    n = board.speeds
    stored, column = _reals(board.kept_M, board.M_entries), _integers(board.M_colind, board.M_entries)
    count, first = _integers(board.M_rownnz, n), _integers(board.M_rowadr, n)
    mass = np.zeros((n, n))
    for i in range(n):
        for at in range(first[i], first[i] + count[i]):
            mass[i, column[at]] = mass[column[at], i] = stored[at]
    return mass


@jit
def _size(factors, force, n):
    """f^T M^-1 f of a force (n,) from the factors of M; the force is overwritten."""
    total = 0.0
    for i in range(n):
        for k in range(i):
            force[i] -= factors[i, k] * force[k]
        total += force[i] * force[i] / factors[i, i]
    return total


@jit
def _left(board, mass, factors, acceleration):
    """Size of the gradient M (a - a_smooth) - qfrc_constraint at an acceleration (n,)."""
    n = board.speeds
    smooth, force, left = _reals(board.qacc_smooth, n), _reals(board.qfrc_constraint, n), np.empty(n)
    for i in range(n):
        left[i] = -force[i]
        for j in range(n):
            left[i] += mass[i, j] * (acceleration[j] - smooth[j])
    return _size(factors, left, n)


@jit
def _residual(board):
    """What MuJoCo's solver left of the last evaluation, relative to the forces."""
    n = board.speeds
    mass = _kept_mass(board)
    factors = mass.copy()
    factorise(factors, n)
    smooth, free, pushed = _reals(board.qacc_smooth, n), _reals(board.qfrc_smooth, n), np.empty(n)
    scale = 0.0
    for i in range(n):
        pushed[i] = _reals(board.qfrc_constraint, n)[i]
        scale += smooth[i] * free[i]
    scale = max(scale, _size(factors, pushed, n))
    if not scale > 0:
        return 0.0
    # After a step of RK4 qacc is the mean of its stages; the last stage's own is where the warm start comes from.
    left = min(
        _left(board, mass, factors, _reals(board.qacc, n)), _left(board, mass, factors, _reals(board.qacc_warmstart, n))
    )
    return np.sqrt(left / scale)


@jit
def _judge(board):
    """Judge what the solver made of the last evaluation, if nobody has; what is infinite is judged elsewhere."""
    if board.pending == 0:
        return
    board.pending = 0
    step = board.since_step + board.evaluations // board.evaluations_per_step
    board.evaluations += 1
    residual = _residual(board)
    if not np.isfinite(residual):
        return
    board.largest_residual = max(board.largest_residual, residual)
    if residual > board.converged_below and step != board.last_unconverged:
        board.unconverged += 1
        board.last_unconverged = step
    if residual > board.wrong_above and board.wrong_step < 0:
        board.wrong_step, board.wrong_residual = step, residual


@jit
def _keep(board):
    """Keep of this evaluation what the judge needs and MuJoCo will overwrite."""
    now, kept = _reals(board.M, board.M_entries), _reals(board.kept_M, board.M_entries)
    for i in range(board.M_entries):
        kept[i] = now[i]
    board.pending = 1


@jit
def judge(boards):
    """Judge the last evaluation on a blackboard (1,) if no later one has."""
    _judge(boards[0])


@compile_callback(CONTROL, error_model="numpy")
def watch_iterations(model, data):
    """Control callback: look at what MuJoCo's solver leaves unconverged, and change nothing."""
    board = _blackboard()
    if _is_for(board, model, data):
        _judge(board)
        _keep(board)


@jit
def _start_sticking(board, model, data, rows, softness, target):
    """Let MuJoCo's solver start where all these rows (k, n) act, as on wheels that neither slide nor lift off.

    The start's forces are those of the rows' own softness (k,) and reference accelerations (k,):

        (J M^-1 J^T + R) F = aref - J a,    M a = all forces but the contacts'
    """
    n, size = board.speeds, len(target)
    # MuJoCo computes the same again after this callback.
    _actuation(model, data)
    _acceleration(model, data)
    smooth, start = _reals(board.qacc_smooth, n), _reals(board.qacc_warmstart, n)
    spread, force = np.empty((size, n)), target.copy()
    _solve_mass(model, data, spread.ctypes, rows.ctypes, types.int32(size))
    schur = rows @ spread.T
    for i in range(size):
        schur[i, i] += softness[i]
        for j in range(n):
            force[i] -= rows[i, j] * smooth[j]
    factorise(schur, size)
    solve_factorised(schur, force, size)
    for j in range(n):
        start[j] = smooth[j]
        for i in range(size):
            start[j] += spread[i, j] * force[i]


@compile_callback(CONTROL, error_model="numpy")
def correct_reference(model, data):
    """Control callback: bring the contacts' own acceleration into MuJoCo's reference accelerations.

    It also gives MuJoCo's solver its start, and judges how the last evaluation's solution turned out.
    """
    board = _blackboard()
    if not _is_for(board, model, data):
        return
    _judge(board)
    _keep(board)
    base, n = _address_of(data), board.speeds
    each, used = 4 if board.pyramidal else 3, 0
    contacts = _stored(base + types.uintp(board.contact_at))
    velocities, turning = np.empty((3, n)), np.empty((3, n))
    rows, numbers = np.empty((each * board.wheels, n)), np.empty((2, each * board.wheels))
    for i in range(_integer(base + types.uintp(board.ncon_at))):
        contact_at = contacts + types.uintp(i * board.contact_size)
        pair = contact_at + types.uintp(board.geom_at)
        k = _wheel_of(board, _integer(pair + types.uintp(4)), _integer(pair))
        first = _integer(contact_at + types.uintp(board.row_at))
        if k < 0 or first < 0:
            continue
        aref = _reals(_stored(base + types.uintp(board.efc_aref_at)), first + each)
        kbip = _reals(_stored(base + types.uintp(board.efc_KBIP_at)), 4 * first + 4)
        softness = _reals(_stored(base + types.uintp(board.efc_R_at)), first + each)
        _, _, gamma = _motion(board, k, model, data, velocities, turning)
        axes = _row_axes(board, contact_at)
        _correct_rows(board, contact_at, first, aref, kbip, axes @ np.array(gamma))
        rows[used : used + each] = axes @ velocities
        numbers[0, used : used + each], numbers[1, used : used + each] = softness[first:], aref[first:]
        used += each
    if used > 0:
        _start_sticking(board, model, data, rows[:used], numbers[0, :used], numbers[1, :used])


@compile_callback(CONTROL, error_model="numpy")
def press(model, data):
    """Control callback: the contact forces of rolling without slip, as applied forces."""
    board = _blackboard()
    if not _is_for(board, model, data):
        return
    n, size = board.speeds, 3 * board.wheels
    applied = _reals(board.qfrc_applied, n)
    applied[:] = 0
    rows, spread, turning = np.empty((size, n)), np.empty((size, n)), np.empty((3, n))
    force, free, smooth = np.empty(size), np.empty(n), np.empty(n)
    bias, passive = _reals(board.qfrc_bias, n), _reals(board.qfrc_passive, n)
    for j in range(n):
        smooth[j] = passive[j] - bias[j]
    _solve_mass(model, data, free.ctypes, smooth.ctypes, types.int32(1))
    s = board.stabilisation
    for k in range(board.wheels):
        if not _find(board, k):
            board.lost += 1
            return
        board.found += 1
        here, velocity, gamma = _motion(board, k, model, data, rows[3 * k : 3 * k + 3], turning)
        for i in range(3):
            total = gamma[i] + s * s * here.gap * here.normal[i] + 2 * s * velocity[i]
            for j in range(n):
                total += rows[3 * k + i, j] * free[j]
            force[3 * k + i] = -total
    _solve_mass(model, data, spread.ctypes, rows.ctypes, types.int32(size))
    schur = rows @ spread.T
    factorise(schur, size)
    solve_factorised(schur, force, size)
    for i in range(size):
        board.force[i // 3, i % 3] = force[i]
        for j in range(n):
            applied[j] += rows[i, j] * force[i]
