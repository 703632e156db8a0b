"""Compiled callbacks that MuJoCo calls inside its step: knife-edge contacts, and forces in place of contacts.

A wheel is a circle of radius r about the z axis of its geom. Its contact with the ground z = f(x, y) is the
closest approach of the two (`velodrome.reference.kernels.contact`). The material point of the rim there has

    velocity      v = Jp q'
    acceleration  Jp q'' + gamma,    gamma = Jp' q' + w x (r a' t)

where Jp' is the derivative for the material point and r a' t is the velocity of the contact along the rim. MuJoCo's
contact rows prescribe J q'' = aref, aref = -b J q' - k gap, as if gamma were zero; `_correct_reference` subtracts
gamma.

`_press` does not use MuJoCo's contacts. It solves, for the constrained force components on all wheels,

    Jp M^-1 Jp^T F = -(Jp a + gamma + s^2 gap n + 2 s v),    M a = all forces but those of contacts

and adds Jp^T F to MuJoCo's passive forces. The stabilisation rate s contributes nothing where the constraints hold.

MuJoCo may keep reference accelerations and passive forces from the last evaluation (``mj_forwardSkip``); both functions
see that and correct them once. MuJoCo's counters tell how often it has solved without the callback (`_count_missed`),
and its sum of forces whether these have changed since the callback (`_compare_forces`).

`_assess_solution` assesses the solution of MuJoCo's solver when the next evaluation or inverse dynamics begins, the
first moment after the solution at which a callback is called (the criterion is in `convergence`).

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
from ...reference.kernels.arrays import copy_array
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
# Rows of rolling, scaled to the same size, are independent if the smallest eigenvalue of their Gram matrix is above
# `INDEPENDENT`, half the squared angle of two of them: 0.25 degrees. Below `REDUNDANT`, a thousand roundings, they say
# the same. Forces that keep rows between the two apart would grow as the inverse angle; no vehicle is built for them.
INDEPENDENT = 1e-5
REDUNDANT = 1e-12
# A row whose square is smaller than this, relative to the largest row's, is one that no motion of the model changes.
VANISHING = 1e-24
# Forces of rolling belong to all other forces up to this share of the largest; round-off is a millionth of it.
SAME_FORCES = 1e-9
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
        ("efc_vel_at", np.int64),
        ("efc_pos_at", np.int64),
        ("efc_margin_at", np.int64),
        # Offsets of MuJoCo's counters of solutions and of inverse dynamics, each of which contains a solution.
        ("solutions_at", np.int64),
        ("inverses_at", np.int64),
        ("solved", np.int64),  # number of solutions when the callback was last called
        # Addresses of options and what they must not contain; no addresses where nobody asks.
        ("disableflags", _ADDRESS),
        ("enableflags", _ADDRESS),
        ("solver", _ADDRESS),
        ("noslip_iterations", _ADDRESS),
        ("never_disabled", np.int64),
        ("never_enabled", np.int64),
        ("refused_solver", np.int64),  # -1 if there is none
        ("most_noslip", np.int64),
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
        ("missed", np.int64),  # MuJoCo solved without having called the callback
        ("altered", np.int64),  # an option was one that is refused
        ("changed", np.int64),  # MuJoCo's other forces were not those that the forces of rolling belong to
        ("infinite", np.int64),  # the forces of rolling were not finite
        ("unreached", np.int64, WHEEL_COUNT),  # a wheel under forces of rolling had no contact point
        ("push", np.float64),  # largest normal force of rolling on a wheel [N]
        ("pull", np.float64),  # largest one that holds a wheel down [N]
        ("contradiction", np.float64),  # largest residual of the forces of rolling, relative to the accelerations
        ("contradicting", np.float64, WHEEL_COUNT),  # shares of the wheels in its square
        ("dependence", np.float64),  # first eigenvalue between `REDUNDANT` and `INDEPENDENT`; 0 if there is none
        ("dependent", np.float64, WHEEL_COUNT),  # shares of the wheels in its eigenvector
        # Arrays (n,): passive forces without and with those of rolling; all forces that these belong to.
        ("passive_before", _ADDRESS),
        ("passive_after", _ADDRESS),
        ("smooth_after", _ADDRESS),
        (
            "pressed",
            np.int64,
        ),  # 1: forces of rolling are in the passive forces, and nobody has looked at what became of them
        ("smooth_size", np.float64),  # largest of all forces in the last evaluation
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
            # Inverse dynamics asks for contacts too, and overwrites the solution without calling the other callback.
            _assess_solution(board)
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
def _is_corrected(board, base, first_row, aref, kbip, along, shift):
    """Return whether rows have been corrected before, in an evaluation that keeps MuJoCo's velocities.

    Of MuJoCo's own definition, aref = -b v - k d (pos - margin), and the corrected one the nearer decides. They differ
    by the correction: where that is lost in round-off, so is what depends on the answer.
    """
    count = first_row + len(along)
    speed = _real_array(_read_pointer(base + types.uintp(board.efc_vel_at)), count)
    place = _real_array(_read_pointer(base + types.uintp(board.efc_pos_at)), count)
    margin = _real_array(_read_pointer(base + types.uintp(board.efc_margin_at)), count)
    plain, corrected = 0.0, 0.0
    for i in range(len(along)):
        row = first_row + i
        defined = -kbip[4 * row + 1] * speed[row] - kbip[4 * row] * kbip[4 * row + 2] * (place[row] - margin[row])
        plain += (aref[row] - defined) ** 2
        corrected += (aref[row] + along[i] + shift[i] - defined) ** 2
    return corrected < plain


@jit
def _correct_rows(board, base, contact_at, pyramidal, first_row, aref, kbip, along):
    """Subtract gamma along each row, and the effect of the margin, from one contact's reference accelerations."""
    margin = _real_array(contact_at + board.margin_at, 1)[0]
    # MuJoCo keeps a wheel at the distance of its margin; subtracting this makes it touch.
    stiffness = kbip[4 * first_row] * kbip[4 * first_row + 2]
    shift = np.zeros(len(along))
    for i in range(len(along)):
        if i == 0 or pyramidal:
            shift[i] = stiffness * margin
    if _is_corrected(board, base, first_row, aref, kbip, along, shift):
        return
    for i in range(len(along)):
        aref[first_row + i] -= along[i]
        aref[first_row + i] -= shift[i]


@jit
def _store_inertia(board):
    """Store this evaluation's inertia, which the assessment needs and MuJoCo will overwrite."""
    inertia, stored = _real_array(board.M, board.M_entries), _real_array(board.kept_M, board.M_entries)
    for i in range(board.M_entries):
        stored[i] = inertia[i]
    board.pending, board.smooth_kept = 1, 0


@jit
def _count_solutions(board):
    """Return how often MuJoCo has solved the equations of motion of the state, inverse dynamics left out."""
    solutions = _read_integer(board.data + types.uintp(board.solutions_at))
    return solutions - _read_integer(board.data + types.uintp(board.inverses_at))


@jit
def _count_missed(board, solutions):
    """Count solutions since the callback was last called, but for the one that followed it."""
    if solutions > board.solved + 1:
        board.missed += solutions - board.solved - 1
        board.solved, board.pressed = solutions - 1, 0


@jit
def _compare_forces(board, solutions):
    """Count the last evaluation if MuJoCo solved with other forces than those that the forces of rolling belong to."""
    if board.pressed == 0 or solutions != board.solved + 1:
        return
    board.pressed = 0
    smooth, expected = _real_array(board.qfrc_smooth, board.speeds), _real_array(board.smooth_after, board.speeds)
    difference, reset = 0.0, True
    for i in range(board.speeds):
        difference = max(difference, abs(smooth[i] - expected[i]))
        reset = reset and smooth[i] == 0
    if difference > SAME_FORCES * board.smooth_size and not reset:
        board.changed += 1


@jit
def judge(board):
    """Assess the last evaluation of a blackboard (1,) unless a later evaluation has done so."""
    entry = board[0]
    _assess_solution(entry)
    if entry.kind != WATCHING and entry.data != 0:
        solutions = _count_solutions(entry)
        _count_missed(entry, solutions)
        _compare_forces(entry, solutions)


@jit
def _multiply_by_transpose(rows, spread):
    """Return A B^T (m, m) of A and B (m, n); BLAS takes longer to be called than this for the few rows of wheels."""
    size, n = rows.shape
    product = np.empty((size, size))
    for i in range(size):
        for j in range(size):
            total = 0.0
            for k in range(n):
                total += rows[i, k] * spread[j, k]
            product[i, j] = total
    return product


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
    schur = _multiply_by_transpose(rows, spread)
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
        kbip = _real_array(_read_pointer(base + types.uintp(board.efc_KBIP_at)), 4 * (first + each))
        softness = _real_array(_read_pointer(base + types.uintp(board.efc_R_at)), first + each)
        centre, here = _evaluate_contact(board, k)
        _, gamma = _contact_motion(board, k, model, data, centre, here, velocities, turning)
        axes, along = _row_axes(board, contact_at, pyramidal), np.empty(each)
        for row in range(each):
            axis = axes[row, 0], axes[row, 1], axes[row, 2]
            along[row] = dot(axis, gamma)
            for j in range(n):
                rows[used + row, j] = dot(axis, (velocities[0, j], velocities[1, j], velocities[2, j]))
        _correct_rows(board, base, contact_at, pyramidal, first, aref, kbip, along)
        for row in range(each):
            numbers[0, used + row], numbers[1, used + row] = softness[first + row], aref[first + row]
        used += each
    _count_skipped(board, seen)
    if used > 0:
        _start_sticking(board, model, data, rows[:used], numbers[0, :used], numbers[1, :used])


@jit
def _add_least_forces(values, vectors, weight, left, force):
    """Add to forces (n,) the smallest ones whose accelerations are ``left`` (n,), as far as there are any."""
    size = len(force)
    for k in range(size):
        if values[k] > INDEPENDENT:
            along = 0.0
            for i in range(size):
                along += vectors[i, k] * weight[i] * left[i]
            for i in range(size):
                force[i] += weight[i] * vectors[i, k] * along / values[k]


@jit
def solve_independent_rows(schur, target, size):
    """Overwrite ``target`` (n,) with the forces F, S F = target, if the rows are independent; return whether they are.

    They are if each row's own share beside the rows before it, a pivot of S relative to its diagonal, is above
    `INDEPENDENT`.
    """
    largest, smallest, least = 0.0, np.inf, 1.0
    for i in range(size):
        largest, smallest = max(largest, schur[i, i]), min(smallest, schur[i, i])
    if not smallest > VANISHING * largest:
        return False
    factors = schur.copy()
    factorise(factors, size)
    for i in range(size):
        least = min(least, factors[i, i] / schur[i, i])
    if not least > INDEPENDENT:
        return False
    solve_factorised(factors, target, size)
    return True


@jit
def _reduce_forces(values, vectors, weight, cost, force):
    """Reduce forces (n,) to the ones of least cost, sum of c_i F_i^2, among those with the same accelerations."""
    size, count = len(force), 0
    free = np.empty((size, size))
    for k in range(size):
        if -0.5 < values[k] <= INDEPENDENT:
            for i in range(size):
                free[count, i] = weight[i] * vectors[i, k]
            count += 1
    if count == 0:
        return
    normal, right = np.zeros((count, count)), np.zeros(count)
    for k in range(count):
        for i in range(size):
            right[k] -= free[k, i] * cost[i] * force[i]
            for j in range(count):
                normal[k, j] += free[k, i] * cost[i] * free[j, i]
    factorise(normal, count)
    solve_factorised(normal, right, count)
    for k in range(count):
        for i in range(size):
            force[i] += right[k] * free[k, i]


@jit
def solve_dependent_rows(schur, target, cost, share):
    """Overwrite ``target`` (n,) with forces F, S F = target; return the largest |S F - target| and a dependence.

    The eigenvalues of D S D decide, D = diag(S)^(-1/2). Those above `INDEPENDENT` determine the accelerations; of the
    forces with these accelerations F is the smallest, in the sum of c_i F_i^2 with the ``cost`` c (n,) of each row.
    Redundant rows share a force, rows that no motion changes have none, and rows that contradict each other leave a
    residual. The smallest eigenvalue between `REDUNDANT` and `INDEPENDENT` is returned as the dependence, 0 if there is
    none: such rows neither say the same nor differ. ``share`` (2, n) gets the share of each row in the square of the
    residual, and of the dependence's eigenvector.
    """
    size = len(target)
    share[:] = 0.0
    weight, scaled, largest = np.zeros(size), np.empty((size, size)), 0.0
    for i in range(size):
        largest = max(largest, schur[i, i])
        for j in range(size):
            if not np.isfinite(schur[i, j]):
                return np.nan, 0.0
    for i in range(size):
        if schur[i, i] > VANISHING * largest:
            weight[i] = 1 / np.sqrt(schur[i, i])
    for i in range(size):
        for j in range(size):
            # Half of both triangles, which round otherwise.
            scaled[i, j] = weight[i] * weight[j] * (schur[i, j] + schur[j, i]) / 2
        if weight[i] == 0:
            scaled[i, i] = -1.0  # apart from all others
    values, vectors = np.linalg.eigh(scaled)
    force, left, residual, dependence = np.zeros(size), target.copy(), 0.0, 0.0
    for _ in range(2):  # the second time removes what rounding has left
        _add_least_forces(values, vectors, weight, left, force)
        for i in range(size):
            left[i] = target[i]
            for j in range(size):
                left[i] -= schur[i, j] * force[j]
    for i in range(size):
        residual = max(residual, abs(left[i]))
        share[0, i] = left[i] ** 2
    for k in range(size - 1, -1, -1):
        if REDUNDANT < values[k] < INDEPENDENT:
            dependence = values[k]
            for i in range(size):
                share[1, i] = vectors[i, k] ** 2
    _reduce_forces(values, vectors, weight, cost, force)
    copy_array(force, target)
    return residual, dependence


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
def _take_back(board):
    """Take the forces of rolling out of passive forces that MuJoCo has kept from the last evaluation."""
    passive = _real_array(board.qfrc_passive, board.speeds)
    before, after = _real_array(board.passive_before, board.speeds), _real_array(board.passive_after, board.speeds)
    for i in range(board.speeds):
        if passive[i] != after[i]:
            return
    copy_array(before, passive)


@jit
def _row_owners(board, size):
    """Return the wheel of each row (n,): wheels without a contact point have none."""
    owner, first = np.empty(size, np.int64), 0
    for k in range(board.wheels):
        if np.isfinite(board.gap[k]):
            for i in range(3):
                if board.constrained[k, i]:
                    owner[first], first = k, first + 1
    return owner


@jit
def _find_scale(board, model, data, rows, owner, free):
    """Return the size of the terms that make up the accelerations of rows (m, n), which may cancel to round-off.

    Gamma's terms are of the size w^2 r, w the wheel's angular velocity.
    """
    s, qvel, largest = board.stabilisation, _real_array(board.qvel, board.speeds), 0.0
    moving, turning = np.empty((3, board.speeds)), np.empty((3, board.speeds))
    for row in range(len(owner)):
        k = owner[row]
        centre, here = _evaluate_contact(board, k)
        _contact_motion(board, k, model, data, centre, here, moving, turning)
        squared, total = 0.0, 0.0
        for i in range(3):
            spin = 0.0
            for j in range(board.speeds):
                spin += turning[i, j] * qvel[j]
            squared += spin * spin
        for j in range(board.speeds):
            total += abs(rows[row, j] * free[j]) + 2 * s * abs(rows[row, j] * qvel[j])
        largest = max(largest, total + squared * board.radius[k] + s * s * abs(here.gap))
    return largest


@jit
def _press_dependent(board, model, data, rows, schur, force, free):
    """Solve rows (m, n) that are not all independent for their forces (m,), and record how far they agree."""
    size = len(rows)
    share, owner, cost = np.empty((2, size)), _row_owners(board, size), np.zeros(size)
    # One for the rows of a wheel, so that the smallest forces do not depend on the directions of the axes.
    for i in range(size):
        for j in range(size):
            if owner[i] == owner[j]:
                cost[i] += schur[j, j]
    residual, dependence = solve_dependent_rows(schur, force[:size], cost, share)
    if dependence > 0 and board.dependence == 0:
        board.dependence = dependence
        for i in range(size):
            board.dependent[owner[i]] += share[1, i]
    scale_of = _find_scale(board, model, data, rows, owner, free)
    # Without any acceleration there is no residual either.
    if residual > board.contradiction * scale_of:
        board.contradiction, total = residual / scale_of, 0.0
        board.contradicting[:] = 0.0
        for i in range(size):
            total += share[0, i]
        for i in range(size):
            board.contradicting[owner[i]] += share[0, i] / total


@jit
def _store_sums(board, free_forces, passive):
    """Store the passive forces with those of rolling, and the sum of forces that MuJoCo should find."""
    after, expected = _real_array(board.passive_after, board.speeds), _real_array(board.smooth_after, board.speeds)
    before, bias = _real_array(board.passive_before, board.speeds), _real_array(board.qfrc_bias, board.speeds)
    board.pressed, board.smooth_size = 1, 0.0
    for i in range(board.speeds):
        after[i], rolling = passive[i], passive[i] - before[i]
        expected[i] = free_forces[i] + rolling
        # The norms of the parts, so that sums that cancel do not pass for small.
        parts = abs(free_forces[i] + bias[i]) + abs(bias[i]) + abs(before[i]) + abs(rolling)
        board.smooth_size = max(board.smooth_size, parts)


@jit
def _press(board, model, data):
    """Apply the contact forces of rolling without slip, beside MuJoCo's passive forces.

    A wheel without a contact point gets no force and is counted; the others roll on.
    """
    n, most = board.speeds, 3 * board.wheels
    rows, spread, turning, force = np.empty((most, n)), np.empty((most, n)), np.empty((3, n)), np.empty(most)
    _take_back(board)
    # MuJoCo computes the same again after this callback.
    _actuation(model, data)
    _acceleration(model, data)
    free, passive = _real_array(board.qacc_smooth, n), _real_array(board.qfrc_passive, n)
    before = _real_array(board.passive_before, n)
    copy_array(passive, before)
    board.crowded += _read_integer(_address_of(data) + types.uintp(board.nefc_at)) > 0
    size = 0
    for k in range(board.wheels):
        found, centre, here = _find_contact(board, k)
        if not found:
            board.lost += 1
            board.unreached[k] += 1
            board.gap[k] = np.nan
            continue
        board.found += 1
        size = _fill_rows(board, k, model, data, centre, here, rows, turning, free, force, size)
    _solve_mass(model, data, spread.ctypes, rows.ctypes, types.int32(size))
    schur = _multiply_by_transpose(rows[:size], spread[:size])
    if not solve_independent_rows(schur, force, size):
        _press_dependent(board, model, data, rows[:size], schur, force, free)
    for i in range(size):
        if not np.isfinite(force[i]):
            board.infinite += 1
            break
    for i in range(size):
        for j in range(n):
            passive[j] += rows[i, j] * force[i]
    _store_sums(board, _real_array(board.qfrc_smooth, n), passive)
    first = 0
    for k in range(board.wheels):
        if not np.isfinite(board.gap[k]):
            board.force[k, :] = 0.0
            continue
        first = _store_force(board, k, force, first)
        along = 0.0
        for i in range(3):
            along += board.force[k, i] * board.normal[k, i]
        board.push, board.pull = max(board.push, along), max(board.pull, -along)


@jit
def _watch_options(board):
    """Count an evaluation with an option that is refused; it may have been set inside the block."""
    if board.disableflags == 0:
        return
    disabled = _read_integer(board.disableflags) & board.never_disabled
    enabled = _read_integer(board.enableflags) & board.never_enabled
    hidden = _read_integer(board.noslip_iterations) > board.most_noslip
    if disabled != 0 or enabled != 0 or hidden or _read_integer(board.solver) == board.refused_solver:
        board.altered += 1


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
    if board.kind != WATCHING:
        solutions = _count_solutions(board)
        _count_missed(board, solutions)
        _compare_forces(board, solutions)
        board.solved = solutions
        _watch_options(board)
    if board.kind == ROLLING:
        _press(board, model, data)
        return
    _assess_solution(board)
    _store_inertia(board)
    if board.kind == CONTACTS:
        _correct_reference(board, model, data)
