"""Compiled callbacks that MuJoCo calls inside its step: knife-edge contacts, and forces in place of contacts.

A wheel is a circle of radius r about the z axis of its geom. Its contact with the ground z = f(x, y) is the
closest approach of the two (`velodrome.reference.kernels.contact`). The material point of the rim there has

    velocity      v = Jp q'
    acceleration  Jp q'' + gamma,    gamma = Jp' q' + w x (r a' t)

where Jp' is the derivative for the material point and r a' t is the velocity of the contact along the rim. MuJoCo's
contact rows prescribe J q'' = aref, aref = -b J q' - k gap, as if gamma were zero; `correct_reference` subtracts gamma.

`press` does not use MuJoCo's contacts. It solves, for the constrained force components on all wheels,

    Jp M^-1 Jp^T F = -(Jp a + gamma + s^2 gap n + 2 s v),    M a = all forces but those of contacts

and adds Jp^T F to MuJoCo's passive forces. The stabilisation rate s contributes nothing where the constraints hold.

`_assess_solution` assesses the solution of MuJoCo's solver when the next evaluation begins, the first moment after the
solution at which a callback is called (the criterion is in `convergence`).

MuJoCo has one control callback and one collision function per process. `control` and `touch` serve up to
`BOARD_COUNT` states at once: each has a `BLACKBOARD`, which holds numbers and the addresses of arrays that keep their
place while the state exists, and `header` leads to all of them. Compiled code gets the header's address from a function
that the linker resolves, so that the code can be cached on disk. `control` calls the user's own control callback first.
All callbacks are in one file because numba renews its cache when that file changes.
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
from ...reference.kernels.vector import add, cross, dot, scale
from ...reference.kernels.wheel import contact_run
from .library import announce_collision

BOARD_COUNT = 64  # largest number of states at once
WHEEL_COUNT = 64  # largest number of wheels on a blackboard
# What a blackboard is for: wheels in MuJoCo's contacts, wheels under forces of rolling, or MuJoCo's solver alone.
CONTACTS, ROLLING, WATCHING = 1, 2, 3
# Rows whose own share in the constraint space, a pivot relative to its diagonal, is smaller count as redundant.
DEPENDENT = 1e-8
# Largest number of refinements of forces in redundant rows; each reduces the residual by `DEPENDENT` over that share.
REFINEMENTS = 30
REFINED = 1e-13  # residual of the refinement, relative to the accelerations: some hundred roundings
# A wheel whose centre is less than this above its contact counts as lying flat [m].
FLAT = 1e-4

_ADDRESS = np.uintp
BLACKBOARD = np.dtype(
    [
        # The callbacks act on one state of one model and ignore all others.
        ("model", _ADDRESS),
        ("data", _ADDRESS),
        ("kind", np.int64),
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
        ("qfrc_smooth", _ADDRESS),
        ("qfrc_constraint", _ADDRESS),
        ("M", _ADDRESS),
        ("M_rownnz", _ADDRESS),
        ("M_rowadr", _ADDRESS),
        ("M_colind", _ADDRESS),
        ("M_entries", np.int64),
        # Inertia of the last evaluation, whose solution is assessed when the next evaluation begins.
        ("kept_M", _ADDRESS),
        ("kept_smooth", _ADDRESS),
        ("smooth_kept", np.int64),
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
        ("nefc_at", np.int64),
        ("efc_type_at", np.int64),
        ("contact_at", np.int64),
        ("efc_aref_at", np.int64),
        ("efc_R_at", np.int64),
        ("efc_KBIP_at", np.int64),
        ("contact_size", np.int64),
        ("dist_at", np.int64),
        ("frame_at", np.int64),
        ("margin_at", np.int64),
        ("friction_at", np.int64),
        ("geom_at", np.int64),
        ("row_at", np.int64),
        ("pyramidal_type", np.int64),  # mjCNSTR_CONTACT_PYRAMIDAL
        ("stabilisation", np.float64),
        # The wheels.
        ("wheels", np.int64),
        ("ground", np.int64, WHEEL_COUNT),
        ("geom", np.int64, WHEEL_COUNT),
        ("body", np.int64, WHEEL_COUNT),
        ("radius", np.float64, WHEEL_COUNT),
        ("place", np.float64, (WHEEL_COUNT, 3)),  # xi, eta, angle of the contacts
        ("gap", np.float64, WHEEL_COUNT),  # of the last evaluation; nan without a contact point
        ("force", np.float64, (WHEEL_COUNT, 3)),
        ("normal", np.float64, (WHEEL_COUNT, 3)),  # of the ground, where forces of rolling act
        ("constrained", np.int64, (WHEEL_COUNT, 3)),  # whether to constrain the lateral, forward and normal velocity
        ("touched", np.int64, WHEEL_COUNT),  # 1: MuJoCo has asked for the contact in this evaluation; 2: it was found
        ("expected", np.int64),  # number of wheels with a contact at the present positions
        ("lost", np.int64),  # number of searches that found no contact point
        ("found", np.int64),  # number of contacts found since the callbacks were installed
        # Numbers of evaluations in which forces could not be right.
        ("skipped", np.int64),  # MuJoCo left out a wheel's contact or its rows
        ("crowded", np.int64),  # MuJoCo's own constraints acted beside the forces of rolling
        ("strange", np.int64),  # another state of the same model
        ("push", np.float64),  # largest normal force of rolling on a wheel [N]
        ("pull", np.float64),  # largest one that holds a wheel down [N]
        ("contradiction", np.float64),  # largest residual of the forces of rolling, relative to the accelerations
    ],
    align=True,
)
HEADER = np.dtype(
    [
        ("boards", _ADDRESS),
        ("count", np.int64),  # number of boards that may be in use
        ("control", _ADDRESS),  # the control callback of this module
        ("control_at", _ADDRESS),  # where MuJoCo keeps its control callback
        ("control_before", _ADDRESS),  # the user's control callback, or 0
        ("collision", _ADDRESS),  # MuJoCo's own collision function for planes and cylinders
    ]
)

boards = np.zeros(BOARD_COUNT, BLACKBOARD)
header = np.zeros(1, HEADER)
header["boards"] = boards.ctypes.data
_HEADER_ADDRESS = header.ctypes.data
_HEADER_SYMBOL = "velodrome_mujoco_header"


# Compiled anew in every process, because it contains an address.
@cfunc(types.uintp())
def _return_header_address():
    return _HEADER_ADDRESS


llvm.add_symbol(_HEADER_SYMBOL, _return_header_address.address)
announce_collision("mj_jac", "mj_jacDot", "mj_solveM", "mj_fwdActuation", "mj_fwdAcceleration")

_pointer = types.voidptr
_numbers = types.CPointer(types.float64)
_get_header_address = types.ExternalFunction(_HEADER_SYMBOL, types.uintp())
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
_CONTROL = types.FunctionType(CONTROL)


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
def _find_header():
    return carray(_pointer_at(_get_header_address()), (1,), HEADER)[0]


@jit
def _blackboards(head):
    return carray(_pointer_at(head.boards), (BOARD_COUNT,), BLACKBOARD)


@jit
def _find_board(head, table, model, data):
    """Return the number of a state's blackboard; -1 if it has none."""
    for i in range(head.count):
        if table[i].data == _address_of(data) and table[i].model == _address_of(model):
            return i
    return -1


@jit
def _keep_control(head):
    """Put the control callback back in its place if the user has set another, which is called first from now on."""
    place = carray(_pointer_at(head.control_at), (1,), np.uintp)
    if place[0] != head.control:
        head.control_before = place[0]
        place[0] = head.control


@jit
def _wheel_pose(board, k):
    """Return the centre and the axle of wheel k."""
    geom = board.geom[k]
    at, turn = _real_array(board.geom_xpos, 3 * geom + 3), _real_array(board.geom_xmat, 9 * geom + 9)
    i, j = 3 * geom, 9 * geom
    return (at[i], at[i + 1], at[i + 2]), (turn[j + 2], turn[j + 5], turn[j + 8])


@jit
def _evaluate_contact(board, k):
    """Return the centre of wheel k and its contact at the contact parameters stored on the blackboard."""
    centre, axle = _wheel_pose(board, k)
    x, z = level_axes(axle)
    function = _function_at(board.surface, _SURFACE)
    xi, eta, angle = board.place[k, 0], board.place[k, 1], board.place[k, 2]
    parameters = _real_array(board.parameters, board.parameter_count)
    here = contact.equations(centre, x, z, board.radius[k], xi, eta, angle, function, parameters)
    return centre, here


@jit
def _find_contact(board, k):
    """Find the contact of wheel k from its pose alone and store it.

    Returns whether the wheel has a contact point with the ground, its centre, and the contact.
    """
    centre, axle = _wheel_pose(board, k)
    x, z = level_axes(axle)
    radius, function = board.radius[k], _function_at(board.surface, _SURFACE)
    parameters = _real_array(board.parameters, board.parameter_count)
    ground = RimSearch(
        board.curved != 0, _real_array(board.bends, board.bend_count), board.bend_width, board.detail, board.samples
    )
    xi, eta, angle, found = find_contact(centre, x, z, radius, ground, function, parameters)
    board.place[k, 0], board.place[k, 1], board.place[k, 2] = xi, eta, angle
    here = contact.equations(centre, x, z, radius, xi, eta, angle, function, parameters)
    # NaN gives False here. Where the contact is above the centre, the search went round the rim.
    found = bool(found) and bool(dot(here.arm, here.normal) < -FLAT) and bool(np.isfinite(here.gap))
    return found, centre, here


@jit
def _contact_motion(board, k, model, data, centre, here, rows, turning):
    """Fill the Jacobian (3, n) of the contact point's velocity; return the velocity and gamma.

    ``turning`` (3, n) is a work array for the Jacobian of the angular velocity.
    """
    point, rate = np.empty(3), np.empty((6, board.speeds))
    for i in range(3):
        point[i] = centre[i] + here.arm[i]
    body = types.int32(board.body[k])
    _jac(model, data, rows.ctypes, turning.ctypes, point.ctypes, body)
    _jac_dot(model, data, rate[:3].ctypes, rate[3:].ctypes, point.ctypes, body)
    qvel = _real_array(board.qvel, board.speeds)
    sums = np.zeros((3, 3))
    for i in range(3):
        for j in range(board.speeds):
            sums[0, i] += rows[i, j] * qvel[j]
            sums[1, i] += turning[i, j] * qvel[j]
            sums[2, i] += rate[i, j] * qvel[j]
    velocity, spin = (sums[0, 0], sums[0, 1], sums[0, 2]), (sums[1, 0], sums[1, 1], sums[1, 2])
    run = contact_run(here, board.radius[k], velocity, spin)
    return velocity, add((sums[2, 0], sums[2, 1], sums[2, 2]), cross(spin, run))


@jit
def _find_wheel(board, geom, ground):
    for k in range(board.wheels):
        if board.geom[k] == geom and board.ground[k] == ground:
            return k
    return -1


@compile_callback(COLLISION, error_model="numpy")
def touch(model, data, made, ground, geom, margin):
    """Collision callback for a plane and a cylinder: the contact of a knife edge with the true ground.

    Planes and cylinders that are not on a blackboard, and other states, get MuJoCo's own function. A wheel without a
    contact point makes no contact and is counted.
    """
    head = _find_header()
    table = _blackboards(head)
    at = _find_board(head, table, model, data)
    if at >= 0:
        board = table[at]
        k = _find_wheel(board, geom, ground)
        if k >= 0:
            _keep_control(head)
            found, centre, here = _find_contact(board, k)
            if not found:
                board.lost += 1
                board.touched[k], board.gap[k] = 1, np.nan
                return types.int32(0)
            board.found += 1
            board.touched[k], board.gap[k] = 2, here.gap
            out = _real_array(_address_of(made), 10)
            out[0] = here.gap
            for i in range(3):
                out[1 + i] = centre[i] + here.arm[i]
                out[4 + i] = here.normal[i]
                out[7 + i] = here.tangent[i]
            return types.int32(1)
    return _function_at(head.collision, _COLLISION)(model, data, made, ground, geom, margin)


@jit
def _row_axes(board, contact_at, pyramidal):
    """Return the directions (3 or 4, 3) of one contact's rows: normal and tangents, or the edges of a pyramid."""
    frame, friction = _real_array(contact_at + board.frame_at, 9), _real_array(contact_at + board.friction_at, 2)
    axes = np.empty((4 if pyramidal else 3, 3))
    for j in range(3):
        if pyramidal:
            for i in range(2):
                for side in range(2):
                    axes[2 * i + side, j] = frame[j] + (1 - 2 * side) * friction[i] * frame[3 * (i + 1) + j]
        else:
            for i in range(3):
                axes[i, j] = frame[3 * i + j]
    return axes


@jit
def _correct_rows(board, contact_at, pyramidal, first_row, aref, kbip, along):
    """Subtract gamma along each row, and the effect of the margin, from one contact's reference accelerations."""
    margin = _real_array(contact_at + board.margin_at, 1)[0]
    # MuJoCo keeps a wheel at the distance of its margin; subtracting this makes it touch.
    stiffness = kbip[4 * first_row] * kbip[4 * first_row + 2]
    for i in range(len(along)):
        aref[first_row + i] -= along[i]
        if i == 0 or pyramidal:
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

    Residuals that are not finite are skipped: other checks find them. So are evaluations whose results somebody has
    replaced meanwhile, by copying or resetting the state.
    """
    if board.pending == 0:
        return
    board.pending = 0
    if board.smooth_kept:
        smooth = _real_array(board.qacc_smooth, board.speeds)
        kept = _real_array(board.kept_smooth, board.speeds)
        for i in range(board.speeds):
            if smooth[i] != kept[i]:
                return
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
    board.pending, board.smooth_kept = 1, 0


@jit
def judge(board):
    """Assess the last evaluation of a blackboard (1,) unless a later evaluation has done so."""
    _assess_solution(board[0])


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
    kept, board.smooth_kept = _real_array(board.kept_smooth, n), 1
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
        start[j] = kept[j] = smooth[j]
        for i in range(size):
            start[j] += spread[i, j] * force[i]


@jit
def _count_skipped(board, contacts):
    """Count an evaluation in which MuJoCo has left out a wheel; ``contacts`` is the number of the wheels' contacts."""
    asked, found = 0, 0
    for k in range(board.wheels):
        asked += board.touched[k] > 0
        found += board.touched[k] > 1
        board.touched[k] = 0
    # An evaluation that keeps the positions of the last one keeps its contacts too, and asks for none.
    if asked > 0:
        board.expected = found
    if 0 < asked < board.wheels or contacts < board.expected or board.found + board.lost == 0:
        board.skipped += 1


@jit
def _correct_reference(board, model, data):
    """Subtract the contacts' own acceleration from MuJoCo's reference accelerations, and start its solver."""
    base, n = _address_of(data), board.speeds
    used, seen = 0, 0
    contacts = _read_pointer(base + types.uintp(board.contact_at))
    velocities, turning = np.empty((3, n)), np.empty((3, n))
    rows, numbers = np.empty((4 * board.wheels, n)), np.empty((2, 4 * board.wheels))
    for i in range(_read_integer(base + types.uintp(board.ncon_at))):
        contact_at = contacts + types.uintp(i * board.contact_size)
        pair = contact_at + types.uintp(board.geom_at)
        k = _find_wheel(board, _read_integer(pair + types.uintp(4)), _read_integer(pair))
        first = _read_integer(contact_at + types.uintp(board.row_at))
        if k < 0:
            continue
        seen += 1
        if first < 0:
            near = _real_array(contact_at + board.dist_at, 1)[0] < _real_array(contact_at + board.margin_at, 1)[0]
            board.skipped += near
            continue
        kind = _read_integer(_read_pointer(base + types.uintp(board.efc_type_at)) + types.uintp(4 * first))
        pyramidal = kind == board.pyramidal_type
        each = 4 if pyramidal else 3
        aref = _real_array(_read_pointer(base + types.uintp(board.efc_aref_at)), first + each)
        kbip = _real_array(_read_pointer(base + types.uintp(board.efc_KBIP_at)), 4 * first + 4)
        softness = _real_array(_read_pointer(base + types.uintp(board.efc_R_at)), first + each)
        centre, here = _evaluate_contact(board, k)
        _, gamma = _contact_motion(board, k, model, data, centre, here, velocities, turning)
        axes = _row_axes(board, contact_at, pyramidal)
        _correct_rows(board, contact_at, pyramidal, first, aref, kbip, axes @ np.array(gamma))
        rows[used : used + each] = axes @ velocities
        numbers[0, used : used + each], numbers[1, used : used + each] = softness[first:], aref[first:]
        used += each
    _count_skipped(board, seen)
    if used > 0:
        _start_sticking(board, model, data, rows[:used], numbers[0, :used], numbers[1, :used])


@jit
def solve_rows(schur, target, size):
    """Overwrite ``target`` (n,) with forces F, S F = target, and return the largest |S F - target| over |target|.

    Redundant rows make S singular. Then F is refined from zero with S + d diag(S), d = `DEPENDENT`, in place of S:
    F += (S + d diag(S))^-1 (target - S F). That converges to the F of least size sum of S_ii F_i^2 without a decision
    on how many rows are redundant. Rows that contradict each other leave a residual.
    """
    factors, least = schur.copy(), 1.0
    factorise(factors, size)
    for i in range(size):
        least = min(least, factors[i, i] / schur[i, i])
    if least > DEPENDENT:
        solve_factorised(factors, target, size)
        return 0.0
    factors[:] = schur
    for i in range(size):
        factors[i, i] *= 1 + DEPENDENT
    factorise(factors, size)
    force, left, size_of, largest = np.zeros(size), target.copy(), 0.0, 0.0
    for i in range(size):
        size_of = max(size_of, abs(target[i]))
    for _ in range(REFINEMENTS):
        solve_factorised(factors, left, size)
        for i in range(size):
            force[i] += left[i]
        largest = 0.0
        for i in range(size):
            left[i] = target[i]
            for j in range(size):
                left[i] -= schur[i, j] * force[j]
            largest = max(largest, abs(left[i]))
        if largest <= REFINED * size_of:
            break
    target[:size] = force
    return largest / size_of if size_of > 0 else 0.0


@jit
def _fill_row(row, axis, velocities, demand, free):
    """Fill a row (n,) with a velocity along an axis, and return the acceleration along it that forces must undo."""
    total = dot(axis, demand)
    for j in range(len(free)):
        row[j] = axis[0] * velocities[0, j] + axis[1] * velocities[1, j] + axis[2] * velocities[2, j]
        total += row[j] * free[j]
    return total


@jit
def _fill_rows(board, k, model, data, centre, here, rows, turning, free, force, first):
    """Fill the rows of wheel k, and minus the accelerations that its forces must undo.

    Returns the number of the next row. The rows are along the inertial axes if all velocities are constrained.
    """
    s, axes = board.stabilisation, board.constrained
    whole = axes[k, 0] and axes[k, 1] and axes[k, 2]
    velocities = rows[first : first + 3] if whole else np.empty((3, board.speeds))
    velocity, gamma = _contact_motion(board, k, model, data, centre, here, velocities, turning)
    board.gap[k] = here.gap
    for i in range(3):
        board.normal[k, i] = here.normal[i]
    closing = s * s * here.gap
    if whole:
        for i in range(3):
            total = gamma[i] + closing * here.normal[i] + 2 * s * velocity[i]
            for j in range(board.speeds):
                total += velocities[i, j] * free[j]
            force[first + i] = -total
        return first + 3
    demand = add(gamma, add(scale(closing, here.normal), scale(2 * s, velocity)))
    if axes[k, 0]:
        force[first] = -_fill_row(rows[first], cross(here.normal, here.tangent), velocities, demand, free)
        first += 1
    if axes[k, 1]:
        force[first] = -_fill_row(rows[first], here.tangent, velocities, demand, free)
        first += 1
    if axes[k, 2]:
        force[first] = -_fill_row(rows[first], here.normal, velocities, demand, free)
        first += 1
    return first


@jit
def _store_force(board, k, force, first):
    """Store the force on wheel k in inertial axes, from its rows' forces; return the number of the next row."""
    axes = board.constrained
    if axes[k, 0] and axes[k, 1] and axes[k, 2]:
        for i in range(3):
            board.force[k, i] = force[first + i]
        return first + 3
    _, here = _evaluate_contact(board, k)
    total = (0.0, 0.0, 0.0)
    if axes[k, 0]:
        total, first = add(total, scale(force[first], cross(here.normal, here.tangent))), first + 1
    if axes[k, 1]:
        total, first = add(total, scale(force[first], here.tangent)), first + 1
    if axes[k, 2]:
        total, first = add(total, scale(force[first], here.normal)), first + 1
    for i in range(3):
        board.force[k, i] = total[i]
    return first


@jit
def _press(board, model, data):
    """Apply the contact forces of rolling without slip, beside MuJoCo's passive forces."""
    n, most = board.speeds, 3 * board.wheels
    rows, spread, turning, force = np.empty((most, n)), np.empty((most, n)), np.empty((3, n)), np.empty(most)
    # MuJoCo computes the same again after this callback.
    _actuation(model, data)
    _acceleration(model, data)
    free, passive = _real_array(board.qacc_smooth, n), _real_array(board.qfrc_passive, n)
    board.crowded += _read_integer(_address_of(data) + types.uintp(board.nefc_at)) > 0
    size = 0
    for k in range(board.wheels):
        found, centre, here = _find_contact(board, k)
        if not found:
            board.lost += 1
            board.gap[k] = np.nan
            return
        board.found += 1
        size = _fill_rows(board, k, model, data, centre, here, rows, turning, free, force, size)
    _solve_mass(model, data, spread.ctypes, rows.ctypes, types.int32(size))
    residual = solve_rows(rows[:size] @ spread[:size].T, force, size)
    board.contradiction = max(board.contradiction, residual)
    for i in range(size):
        for j in range(n):
            passive[j] += rows[i, j] * force[i]
    first = 0
    for k in range(board.wheels):
        first = _store_force(board, k, force, first)
        along = 0.0
        for i in range(3):
            along += board.force[k, i] * board.normal[k, i]
        board.push, board.pull = max(board.push, along), max(board.pull, -along)


@compile_callback(CONTROL, error_model="numpy")
def control(model, data):
    """Control callback: the user's own, and then what the state's blackboard is for."""
    head = _find_header()
    if head.control_before != 0:
        _function_at(head.control_before, _CONTROL)(model, data)
    table = _blackboards(head)
    at = _find_board(head, table, model, data)
    if at < 0:
        for i in range(head.count):
            if table[i].model == _address_of(model):
                table[i].strange += 1
        return
    board = table[at]
    if board.kind == ROLLING:
        _press(board, model, data)
        return
    _assess_solution(board)
    _store_inertia(board)
    if board.kind == CONTACTS:
        _correct_reference(board, model, data)
