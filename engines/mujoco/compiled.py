"""Compiled callbacks that MuJoCo calls inside its step: knife-edge contacts, and forces in place of contacts.

A wheel is a circle of radius r about the z axis of its geom. Its contact with the ground z = f(x, y) is the
closest approach of the two (`velodrome.reference.kernels.contact`). The material point of the rim there has

    velocity      v = Jp q'
    acceleration  Jp q'' + gamma,    gamma = Jp' q' + w x (r a' t)

where Jp' is the derivative for the material point and r a' t is the velocity of the contact along the rim. MuJoCo's
contact rows prescribe J q'' = aref, aref = -b J q' - k gap, as if gamma were zero; `correct_reference` subtracts gamma.

`press` does not use MuJoCo's contacts. It solves, for the six force components on two wheels,

    Jp M^-1 Jp^T F = -(Jp a + gamma + s^2 gap n + 2 s v),    M a = passive - bias + held

and applies Jp^T F + held, with ``held`` the generalised forces that were applied when the callback was installed. The
stabilisation rate s contributes nothing where the constraints hold.

`watch_iterations` only observes: it assesses the solution of MuJoCo's solver when the next evaluation begins, the first
moment after the solution at which a callback is called (the criterion is in `convergence`). `correct_reference` does
so too.

The callbacks of a process share one `BLACKBOARD`, which holds numbers and the addresses of arrays that keep their
place while a model exists. Compiled code gets the blackboard's own address from a function that the linker resolves,
so that the code can be cached on disk. All callbacks are in one file because numba renews its cache when that file
changes.
"""

# numba passes a typing context to an intrinsic and infers the result types itself.
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

WHEEL_COUNT = 8  # largest number of wheels on a blackboard
# A wheel whose centre is less than this above its contact counts as lying flat [m].
FLAT = 1e-4

_ADDRESS = np.uintp
BLACKBOARD = np.dtype(
    [
        # The callbacks act on one state of one model and ignore all others.
        ("model", _ADDRESS),
        ("data", _ADDRESS),
        ("collision", _ADDRESS),  # MuJoCo's own collision function for planes and cylinders
        ("surface", _ADDRESS),
        ("parameters", _ADDRESS),
        ("parameter_count", np.int64),
        # Resolution of the search along the rims, `velodrome.reference.kernels.rim.RimSearch`.
        ("curved", np.int64),
        ("bends", _ADDRESS),
        ("bend_count", np.int64),
        ("bend_width", np.float64),
        ("detail", np.float64),
        ("samples", np.int64),
        ("speeds", np.int64),
        # Arrays of the state whose addresses are constant.
        ("qvel", _ADDRESS),
        ("geom_xpos", _ADDRESS),
        ("geom_xmat", _ADDRESS),
        ("qacc", _ADDRESS),
        ("qacc_smooth", _ADDRESS),
        ("qacc_warmstart", _ADDRESS),
        ("qfrc_bias", _ADDRESS),
        ("qfrc_passive", _ADDRESS),
        ("qfrc_applied", _ADDRESS),
        ("held", _ADDRESS),  # applied forces that `press` adds to those of rolling
        ("qfrc_smooth", _ADDRESS),
        ("qfrc_constraint", _ADDRESS),
        ("M", _ADDRESS),
        ("M_rownnz", _ADDRESS),
        ("M_rowadr", _ADDRESS),
        ("M_colind", _ADDRESS),
        ("M_entries", np.int64),
        # Inertia of the last evaluation, whose solution is assessed when the next evaluation begins.
        ("kept_M", _ADDRESS),
        ("pending", np.int64),
        # Counters: evaluations since the last step that Python has reported, and steps left unconverged.
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
        # Offsets of mjData's pointers to arrays that move, and of the fields of mjContact [bytes].
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
        ("lost", np.int64),  # number of searches that found no contact point
        ("found", np.int64),  # number of contacts found since the callbacks were installed
    ],
    align=True,
)

board = np.zeros(1, BLACKBOARD)
_BOARD_ADDRESS = board.ctypes.data
_BOARD_SYMBOL = "velodrome_mujoco_blackboard"


# Compiled anew in every process, because it contains an address.
@cfunc(types.uintp())
def _return_board_address():
    return _BOARD_ADDRESS


llvm.add_symbol(_BOARD_SYMBOL, _return_board_address.address)
announce_collision("mj_jac", "mj_jacDot", "mj_solveM", "mj_fwdActuation", "mj_fwdAcceleration")

_pointer = types.voidptr
_numbers = types.CPointer(types.float64)
_get_board_address = types.ExternalFunction(_BOARD_SYMBOL, types.uintp())
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
    """Return the function of a given type at an address, with the C calling convention."""
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
    """Convert an integer to a pointer."""

    def build(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], cgutils.voidptr_t)

    return _pointer(address), build


@intrinsic
def _address_of(typing, pointer):
    """Convert a pointer to an integer."""

    def build(context, builder, signature, arguments):
        return builder.ptrtoint(arguments[0], context.get_value_type(types.uintp))

    return types.uintp(pointer), build


@jit
def _real_array(address, count):
    return carray(_pointer_at(address), (count,), np.float64)


@jit
def _integer_array(address, count):
    return carray(_pointer_at(address), (count,), np.int32)


@jit
def _read_integer(address):
    return carray(_pointer_at(address), (1,), np.int32)[0]


@jit
def _read_pointer(address):
    return carray(_pointer_at(address), (1,), np.uintp)[0]


@jit
def _blackboard():
    return carray(_pointer_at(_get_board_address()), (1,), BLACKBOARD)[0]


@jit
def _is_watched(board, model, data):
    return _address_of(model) == board.model and _address_of(data) == board.data


@jit
def _wheel_pose(board, k):
    """Return the centre and the axle of wheel k."""
    geom = board.geom[k]
    at, turn = _real_array(board.geom_xpos, 3 * geom + 3), _real_array(board.geom_xmat, 9 * geom + 9)
    i, j = 3 * geom, 9 * geom
    return (at[i], at[i + 1], at[i + 2]), (turn[j + 2], turn[j + 5], turn[j + 8])


@jit
def _evaluate_contact(board, k):
    """Evaluate the contact equations of wheel k at the contact parameters stored on the blackboard."""
    centre, axle = _wheel_pose(board, k)
    x, z = level_axes(axle)
    function = _function_at(board.surface, _SURFACE)
    xi, eta, angle = board.place[k, 0], board.place[k, 1], board.place[k, 2]
    parameters = _real_array(board.parameters, board.parameter_count)
    here = contact.equations(centre, x, z, board.radius[k], xi, eta, angle, function, parameters)
    return centre, axle, here


@jit
def _find_contact(board, k):
    """Find the contact of wheel k from its pose alone and store it; return whether the wheel stands on the ground."""
    centre, axle = _wheel_pose(board, k)
    x, z = level_axes(axle)
    radius, function = board.radius[k], _function_at(board.surface, _SURFACE)
    parameters = _real_array(board.parameters, board.parameter_count)
    ground = RimSearch(
        board.curved != 0, _real_array(board.bends, board.bend_count), board.bend_width, board.detail, board.samples
    )
    xi, eta, angle, found = find_contact(centre, x, z, radius, ground, function, parameters)
    board.place[k, 0], board.place[k, 1], board.place[k, 2] = xi, eta, angle
    if not found:
        return False
    here = contact.equations(centre, x, z, radius, xi, eta, angle, function, parameters)
    # NaN gives False here. Where the contact is above the centre, the search went round the rim.
    return bool(dot(here.arm, here.normal) < -FLAT) and bool(np.isfinite(here.gap))


@jit
def _contact_motion(board, k, model, data, rows, turning):
    """Fill the Jacobian (3, n) of the contact point's velocity; return the contact, the velocity and gamma.

    ``turning`` (3, n) is a work array for the Jacobian of the angular velocity.
    """
    centre, _, here = _evaluate_contact(board, k)
    point, rate = np.empty(3), np.empty((6, board.speeds))
    for i in range(3):
        point[i] = centre[i] + here.arm[i]
    body = types.int32(board.body[k])
    _jac(model, data, rows.ctypes, turning.ctypes, point.ctypes, body)
    _jac_dot(model, data, rate[:3].ctypes, rate[3:].ctypes, point.ctypes, body)
    qvel = _real_array(board.qvel, board.speeds)
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
    """Collision callback for a plane and a cylinder: the contact of a knife edge with the true ground.

    Planes and cylinders that are not on the blackboard, and other models, get MuJoCo's own function. A wheel without a
    contact point makes no contact and is counted.
    """
    board = _blackboard()
    if _is_watched(board, model, data):
        for k in range(board.wheels):
            if board.geom[k] == geom and board.ground[k] == ground:
                if not _find_contact(board, k):
                    board.lost += 1
                    return types.int32(0)
                board.found += 1
                centre, _, here = _evaluate_contact(board, k)
                out = _real_array(_address_of(made), 10)
                out[0] = here.gap
                for i in range(3):
                    out[1 + i] = centre[i] + here.arm[i]
                    out[4 + i] = here.normal[i]
                    out[7 + i] = here.tangent[i]
                return types.int32(1)
    return _function_at(board.collision, _COLLISION)(model, data, made, ground, geom, margin)


@jit
def _find_wheel(board, geom, ground):
    for k in range(board.wheels):
        if board.geom[k] == geom and board.ground[k] == ground:
            return k
    return -1


@jit
def _row_axes(board, contact_at):
    """Return the directions (3 or 4, 3) of one contact's rows: normal and tangents, or the edges of a pyramid."""
    frame, friction = _real_array(contact_at + board.frame_at, 9), _real_array(contact_at + board.friction_at, 2)
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
    """Subtract gamma along each row, and the effect of the margin, from one contact's reference accelerations."""
    margin = _real_array(contact_at + board.margin_at, 1)[0]
    # MuJoCo keeps a wheel at the distance of its margin; subtracting this makes it touch.
    stiffness = kbip[4 * first_row] * kbip[4 * first_row + 2]
    for i in range(len(along)):
        aref[first_row + i] -= along[i]
        if i == 0 or board.pyramidal:
            aref[first_row + i] -= stiffness * margin


@jit
def _stored_inertia(board):
    """Return the inertia matrix (n, n) of the last evaluation."""
    n = board.speeds
    stored, column = _real_array(board.kept_M, board.M_entries), _integer_array(board.M_colind, board.M_entries)
    count, first = _integer_array(board.M_rownnz, n), _integer_array(board.M_rowadr, n)
    mass = np.zeros((n, n))
    for i in range(n):
        for at in range(first[i], first[i] + count[i]):
            mass[i, column[at]] = mass[column[at], i] = stored[at]
    return mass


@jit
def _squared_norm(factors, force, n):
    """Return f^T M^-1 f of a force f (n,) from the factors of M; ``force`` is overwritten."""
    total = 0.0
    for i in range(n):
        for k in range(i):
            force[i] -= factors[i, k] * force[k]
        total += force[i] * force[i] / factors[i, i]
    return total


@jit
def _squared_gradient(board, mass, factors, acceleration):
    """Return |g|^2 of the gradient g = M (a - a_smooth) - qfrc_constraint at an acceleration a (n,)."""
    n = board.speeds
    smooth, force, gradient = _real_array(board.qacc_smooth, n), _real_array(board.qfrc_constraint, n), np.empty(n)
    for i in range(n):
        gradient[i] = -force[i]
        for j in range(n):
            gradient[i] += mass[i, j] * (acceleration[j] - smooth[j])
    return _squared_norm(factors, gradient, n)


@jit
def _relative_residual(board):
    """Return the residual of MuJoCo's solver in the last evaluation, relative to the forces."""
    n = board.speeds
    mass = _stored_inertia(board)
    factors = mass.copy()
    factorise(factors, n)
    smooth, free, constraint = _real_array(board.qacc_smooth, n), _real_array(board.qfrc_smooth, n), np.empty(n)
    scale = 0.0
    for i in range(n):
        constraint[i] = _real_array(board.qfrc_constraint, n)[i]
        scale += smooth[i] * free[i]
    scale = max(scale, _squared_norm(factors, constraint, n))
    if not scale > 0:
        return 0.0
    # After a step of RK4, qacc is the mean of the stages; the last stage's own acceleration is in the warm start.
    residual = min(
        _squared_gradient(board, mass, factors, _real_array(board.qacc, n)),
        _squared_gradient(board, mass, factors, _real_array(board.qacc_warmstart, n)),
    )
    return np.sqrt(residual / scale)


@jit
def _assess_solution(board):
    """Assess the solver's solution of the last evaluation unless that has been done.

    Residuals that are not finite are skipped: other checks find them.
    """
    if board.pending == 0:
        return
    board.pending = 0
    step = board.since_step + board.evaluations // board.evaluations_per_step
    board.evaluations += 1
    residual = _relative_residual(board)
    if not np.isfinite(residual):
        return
    board.largest_residual = max(board.largest_residual, residual)
    if residual > board.converged_below and step != board.last_unconverged:
        board.unconverged += 1
        board.last_unconverged = step
    if residual > board.wrong_above and board.wrong_step < 0:
        board.wrong_step, board.wrong_residual = step, residual


@jit
def _store_inertia(board):
    """Store this evaluation's inertia, which the assessment needs and MuJoCo will overwrite."""
    inertia, stored = _real_array(board.M, board.M_entries), _real_array(board.kept_M, board.M_entries)
    for i in range(board.M_entries):
        stored[i] = inertia[i]
    board.pending = 1


@jit
def judge(boards):
    """Assess the last evaluation of a blackboard (1,) unless a later evaluation has done so."""
    _assess_solution(boards[0])


@compile_callback(CONTROL, error_model="numpy")
def watch_iterations(model, data):
    """Control callback: assess the convergence of MuJoCo's solver and change nothing."""
    board = _blackboard()
    if _is_watched(board, model, data):
        _assess_solution(board)
        _store_inertia(board)


@jit
def _start_sticking(board, model, data, rows, softness, target):
    """Start MuJoCo's solver from the solution with all these rows (k, n) active: no wheel slides or lifts off.

    The starting forces are those of the rows' own softness (k,) and reference accelerations (k,):

        (J M^-1 J^T + R) F = aref - J a,    M a = all forces but the contacts'
    """
    n, size = board.speeds, len(target)
    # MuJoCo computes the same again after this callback.
    _actuation(model, data)
    _acceleration(model, data)
    smooth, start = _real_array(board.qacc_smooth, n), _real_array(board.qacc_warmstart, n)
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
    """Control callback: subtract the contacts' own acceleration from MuJoCo's reference accelerations.

    It also gives MuJoCo's solver its starting point and assesses the solution of the last evaluation.
    """
    board = _blackboard()
    if not _is_watched(board, model, data):
        return
    _assess_solution(board)
    _store_inertia(board)
    base, n = _address_of(data), board.speeds
    each, used = 4 if board.pyramidal else 3, 0
    contacts = _read_pointer(base + types.uintp(board.contact_at))
    velocities, turning = np.empty((3, n)), np.empty((3, n))
    rows, numbers = np.empty((each * board.wheels, n)), np.empty((2, each * board.wheels))
    for i in range(_read_integer(base + types.uintp(board.ncon_at))):
        contact_at = contacts + types.uintp(i * board.contact_size)
        pair = contact_at + types.uintp(board.geom_at)
        k = _find_wheel(board, _read_integer(pair + types.uintp(4)), _read_integer(pair))
        first = _read_integer(contact_at + types.uintp(board.row_at))
        if k < 0 or first < 0:
            continue
        aref = _real_array(_read_pointer(base + types.uintp(board.efc_aref_at)), first + each)
        kbip = _real_array(_read_pointer(base + types.uintp(board.efc_KBIP_at)), 4 * first + 4)
        softness = _real_array(_read_pointer(base + types.uintp(board.efc_R_at)), first + each)
        _, _, gamma = _contact_motion(board, k, model, data, velocities, turning)
        axes = _row_axes(board, contact_at)
        _correct_rows(board, contact_at, first, aref, kbip, axes @ np.array(gamma))
        rows[used : used + each] = axes @ velocities
        numbers[0, used : used + each], numbers[1, used : used + each] = softness[first:], aref[first:]
        used += each
    if used > 0:
        _start_sticking(board, model, data, rows[:used], numbers[0, :used], numbers[1, :used])


@compile_callback(CONTROL, error_model="numpy")
def press(model, data):
    """Control callback: apply the contact forces of rolling without slip as external forces."""
    board = _blackboard()
    if not _is_watched(board, model, data):
        return
    n, size = board.speeds, 3 * board.wheels
    applied = _real_array(board.qfrc_applied, n)
    held = _real_array(board.held, n)
    applied[:] = held
    rows, spread, turning = np.empty((size, n)), np.empty((size, n)), np.empty((3, n))
    force, free, smooth = np.empty(size), np.empty(n), np.empty(n)
    bias, passive = _real_array(board.qfrc_bias, n), _real_array(board.qfrc_passive, n)
    for j in range(n):
        smooth[j] = passive[j] - bias[j] + held[j]
    _solve_mass(model, data, free.ctypes, smooth.ctypes, types.int32(1))
    s = board.stabilisation
    for k in range(board.wheels):
        if not _find_contact(board, k):
            board.lost += 1
            return
        board.found += 1
        here, velocity, gamma = _contact_motion(board, k, model, data, rows[3 * k : 3 * k + 3], turning)
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
