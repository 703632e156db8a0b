"""Sections 2 and 3.1: coordinates, constraints, equations, symmetries, and conditions of a circular motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.circular import Steady
from ...reference.dae import consistent_state, dynamics, mass_matrix, residual
from ...reference.families import FAMILIES
from ...reference.kernels.steady import STEP
from ...reference.kinematics import COORDINATES, YAW, angular_velocities, body_velocities, rotations
from ...reference.surface import Paraboloid
from .brackets import growth
from .evidence import Evidence
from .ledger import LedgerLine, SelfCheck, below, claim_line, count_line, equals, source

CONTACT_ROWS, GAP_ROWS, ROLLING_ROWS = slice(9, 15), slice(15, 17), slice(17, 21)
_BODIES, _HINGES = 4, 3
_UNCHANGED = 1e-10  # of accelerations of order 10 to 100: round-off times the condition of the mass matrix, 1e3
_ROUND_OFF = 1e-9  # relative to the largest singular value: smaller ones are zero to round-off
# A generic state: leaning, steered, all three free rates different from zero.
_PLACE, _LEAN, _STEER, _RATES = (1.3, -2.1), 0.2, 0.4, (0.3, -0.5, 12.0)


def structure_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the lines on sections 2 and 3.1."""
    printed, bicycle, surface = evidence.figures["counts"], evidence.bicycle, Paraboloid(0.2)
    q, qd = consistent_state(bicycle, surface, _PLACE, _LEAN, _STEER, _RATES)
    yield from _body_lines(printed, bicycle, q)
    yield from _constraint_lines(printed, bicycle, surface, q, qd)
    yield from _equation_lines(printed, bicycle, surface, q, qd)
    yield from _symmetry_lines(printed, bicycle, surface, q, qd)
    yield from _constant_lines(printed, evidence)


def rank(matrix: np.ndarray) -> tuple[int, float]:
    """Return the rank and the smallest singular value that counts, relative to the largest."""
    values = np.linalg.svd(matrix, compute_uv=False)
    many = int(np.sum(values > _ROUND_OFF * values[0]))
    return many, float(values[many - 1] / values[0])


def _check_rank(smallest: float) -> SelfCheck:
    """Check that no singular value is near the limit of the rank."""
    return SelfCheck("limit of round-off over the smallest singular value that counts", _ROUND_OFF / smallest, 1e-3)


def _body_lines(printed: dict[str, int], bicycle: Bicycle, q: np.ndarray) -> Iterator[LedgerLine]:
    names = [f.name for f in fields(bicycle) if f.name != "gravity"]
    yield count_line(
        section="2.1",
        claim="the bicycle has 25 geometric and mass parameters",
        printed=printed["parameters"],
        value=len(names),
        measured=f"{len(names)} parameters, and gravity",
        source=source("number of the bicycle's parameters, gravity aside", Bicycle),
    )
    unit = np.eye(9)
    many = np.repeat(q[None], 9, axis=0)
    motion = np.concatenate([body_velocities(bicycle, many, unit), angular_velocities(bicycle, many, unit)], axis=2)
    free, smallest = rank(motion.reshape(9, -1))
    hinged = SelfCheck("4 x 6 - 3 x 5 less the rank", abs(6 * _BODIES - 5 * _HINGES - free), 0.0)
    yield count_line(
        section="2.1",
        claim="without contacts the bicycle has nine coordinates: 4 x 6 - 3 x 5",
        printed=printed["coordinates"],
        value=free,
        measured=f"velocities of {_BODIES} bodies under the {len(COORDINATES)} rates: rank {free}",
        source=source("rank of the bodies' velocities under unit rates", body_velocities, angular_velocities, rank),
        checks=[_check_rank(smallest), hinged],
    )
    product = _turn_matrix(2, q[3]) @ _turn_matrix(0, q[4]) @ _turn_matrix(1, q[5])
    error = float(np.abs(product - rotations(bicycle, q[None])[0, 0]).max())
    yield claim_line(
        section="2.1",
        claim="the rear frame's angles are yaw, lean, pitch, in the order 3-1-2",
        thresholds=[below("largest entry of the difference", error, 1e-14)],
        measured=f"product of the three turns: off by {error:.0e}",
        source=source("the frame's rotation against the product of three turns", rotations),
        checks=[SelfCheck("lean at which the order is tested, negated (must not be zero)", -abs(q[4]), -0.1)],
    )


def _turn_matrix(axis: int, angle: float) -> np.ndarray:
    matrix, (i, j) = np.eye(3), [k for k in range(3) if k != axis]
    sign = -1 if axis == 1 else 1
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[i, j], matrix[j, i] = -sign * np.sin(angle), sign * np.sin(angle)
    return matrix


def derivatives(bicycle: Bicycle, surface: Paraboloid, q: np.ndarray, qd: np.ndarray) -> dict[str, np.ndarray]:
    """Differentiate the 21 equations by q, qd, qdd, contact parameters and forces, by the complex step."""
    now = dynamics(bicycle, surface, q, qd)
    arguments = {"q": q, "qd": qd, "qdd": now.acceleration, "p": now.contact.ravel(), "force": now.force.ravel()}
    out = {}
    for name, values in arguments.items():
        columns = []
        for k in range(len(values)):
            varied = {key: value.astype(complex) for key, value in arguments.items()}
            varied[name][k] += 1j * STEP
            columns.append(np.imag(residual(bicycle, surface, *varied.values())) / STEP)
        out[name] = np.array(columns).T
    return out


def _constraint_lines(
    printed: dict[str, int], bicycle: Bicycle, surface: Paraboloid, q: np.ndarray, qd: np.ndarray
) -> Iterator[LedgerLine]:
    slopes = derivatives(bicycle, surface, q, qd)
    ranked = source("rank of the constraints' derivatives at a state with nothing special about it", derivatives, rank)

    def line(claim: str, key: str, value: int, measured: str, smallest: float) -> LedgerLine:
        return count_line("2.2", claim, printed[key], value, measured, ranked, [_check_rank(smallest)])

    contact = slopes["p"][CONTACT_ROWS]
    solved, smallest = rank(contact)
    text = f"derivative of the contact equations by the contact parameters: rank {solved}"
    claim = "three contact parameters a wheel, solved from three contact equations of regular Jacobian"
    yield line(claim, "contact_equations", solved, text, smallest)
    gaps = slopes["q"][GAP_ROWS] - slopes["p"][GAP_ROWS] @ np.linalg.solve(contact, slopes["q"][CONTACT_ROWS])
    closed, smallest = rank(gaps)
    text = f"gaps after elimination of the contact parameters: rank {closed}"
    claim = "of four geometric equations a contact leaves one holonomic constraint: two in all"
    yield line(claim, "holonomic", closed, text, smallest)
    rolling = slopes["qd"][ROLLING_ROWS]
    rolls, smallest = rank(rolling)
    claim = "pure rolling gives four independent velocity constraints"
    yield line(claim, "nonholonomic", rolls, f"rolling rows: rank {rolls}", smallest)
    both, smallest = rank(np.vstack([gaps, rolling]))
    text = f"{len(COORDINATES)} rates less {both} independent constraints"
    claim = "the bicycle has three degrees of freedom in velocity"
    yield line(claim, "velocity_freedoms", len(COORDINATES) - both, text, smallest)
    reached, smallest = growth(bicycle, surface, q)
    yield claim_line(
        section="2.2",
        claim="the four rolling constraints are nonholonomic",
        thresholds=[equals("dimensions that are reached", reached[-1], printed["independent_coordinates"])],
        measured=f"velocities, their brackets, brackets of those span {', '.join(map(str, reached))} dimensions: "
        "none of the four integrates",
        source=source("rank of the velocity fields and of their Lie brackets, by central differences", growth),
        checks=[SelfCheck("1e-4 over the smallest singular value that counts", 1e-4 / smallest, 0.1)],
    )


def _equation_lines(
    printed: dict[str, int], bicycle: Bicycle, surface: Paraboloid, q: np.ndarray, qd: np.ndarray
) -> Iterator[LedgerLine]:
    now = dynamics(bicycle, surface, q, qd)
    rows = residual(bicycle, surface, q, qd, now.acceleration, now.contact.ravel(), now.force.ravel())
    parts = {
        "differential_equations": (rows[: CONTACT_ROWS.start], "equations of motion"),
        "algebraic": (rows[CONTACT_ROWS.start : GAP_ROWS.stop], "contact equations and gaps"),
        "nonholonomic": (rows[ROLLING_ROWS], "rolling constraints"),
    }
    left = SelfCheck("largest residual of the 21 equations at the solved state", float(np.abs(rows).max()), 1e-11)
    counted = source("number of equations and unknowns of the DAE, solved at a state", residual, dynamics)
    for name, (part, what) in parts.items():
        text = f"{len(part)} {what}"
        yield count_line("2.3", f"the DAE has {printed[name]} {what}", printed[name], len(part), text, counted, [left])
    unknown = len(COORDINATES) + now.contact.size + now.force.size
    text = f"{len(COORDINATES)} coordinates, {now.contact.size} contact parameters, {now.force.size} multipliers"
    yield count_line("2.3", "21 unknowns", printed["unknowns"], unknown, text, counted, [left])
    slopes = derivatives(bicycle, surface, q, qd)
    regular, smallest = rank(slopes["force"][:9])
    condition = float(np.linalg.cond(mass_matrix(bicycle, q)))
    yield claim_line(
        section="2.3",
        claim="with initial conditions the equations determine the motion",
        thresholds=[
            equals("rank of the forces on the bicycle", regular, now.force.size),
            below("condition of the mass matrix", condition, 1e8),
        ],
        measured=f"mass matrix of condition {condition:.1e}, forces on the bicycle of rank {regular}: accelerations "
        "and multipliers follow from one regular system",
        source=source("condition of the mass matrix, rank of the forces", mass_matrix, derivatives, rank),
        checks=[_check_rank(smallest), left],
    )


def _symmetry_lines(
    printed: dict[str, int], bicycle: Bicycle, surface: Paraboloid, q: np.ndarray, qd: np.ndarray
) -> Iterator[LedgerLine]:
    here = dynamics(bicycle, surface, q, qd)

    def change(turned: np.ndarray, rates: np.ndarray, back: np.ndarray) -> float:
        other = dynamics(bicycle, surface, turned, rates)
        moved = other.acceleration.copy()
        moved[:3] = back @ moved[:3]
        return float(np.abs(moved - here.acceleration).max())

    spun = q.copy()
    spun[7:] += (1.0, -2.0)
    by_wheels = below("change of the accelerations", change(spun, qd, np.eye(3)), _UNCHANGED)
    turn = _turn_matrix(2, 0.7)
    turned, rates = q.copy(), qd.copy()
    turned[:3], rates[:3], turned[YAW] = turn @ q[:3], turn @ qd[:3], q[YAW] + 0.7
    by_yaw = below("change of the accelerations, turned back,", change(turned, rates, turn.T), _UNCHANGED)
    lean = q.copy()
    lean[4] += 1e-3
    # Accelerations are of order 10 to 100.
    moved = SelfCheck("change by a lean of 1e-3, negated (must be seen)", -change(lean, qd, np.eye(3)), -1e-3)
    changed = source("accelerations at a state and at the turned one", dynamics)
    yield claim_line(
        section="3.1",
        claim="the wheels' angles do not appear in the equations",
        thresholds=[by_wheels],
        measured=f"accelerations change by {by_wheels.value:.0e} when the wheels are turned",
        source=changed,
        checks=[moved],
    )
    yield claim_line(
        section="3.1",
        claim="on a surface of revolution the equations are invariant under turns: yaw is cyclic",
        thresholds=[by_yaw],
        measured=f"accelerations, turned back, change by {by_yaw.value:.0e}",
        source=changed,
        checks=[moved],
    )
    cyclic = int(by_wheels.met) * 2 + int(by_yaw.met)
    six = len(COORDINATES) - cyclic
    text = f"{len(COORDINATES)} coordinates less {cyclic} cyclic ones"
    yield count_line("3.1", "six coordinates are not cyclic", printed["noncyclic_coordinates"], six, text, changed)


def _constant_lines(printed: dict[str, int], evidence: Evidence) -> Iterator[LedgerLine]:
    residual_check = evidence.residual()
    family = evidence.family(evidence.cases[0], 1)
    motion = family.equations.motion(family.points[0].unknowns)
    angles, rates = (motion.lean, motion.pitch, motion.steer), (motion.yaw_rate, motion.rear_rate, motion.front_rate)
    constants = motion.position.size + len(angles) + len(rates) + motion.contact.size + motion.force.size
    yield count_line(
        section="3.1",
        claim="a circular motion is 21 constants: 9 kinematic, 6 of the contacts, 6 multipliers",
        printed=printed["unknowns"],
        value=constants,
        measured="the 21 equations hold along all families with 21 constants",
        source=source("constants of a motion, residuals along all families", Steady.motion, Steady.residual),
        checks=[residual_check],
    )
    widest, least = 0.0, np.inf
    for alpha in evidence.cases:
        for number in FAMILIES:
            family = evidence.family(alpha, number)
            for point in family.points[:: max(1, len(family.points) // 20)]:
                values = np.linalg.svd(family.equations.jacobian(point.unknowns), compute_uv=False)
                widest, least = max(widest, values[-1] / values[0]), min(least, values[-2] / values[0])
    yield claim_line(
        section="3.1",
        claim="one of the 21 constants is free: circular motions come in one-parameter families",
        thresholds=[below("smallest relative singular value of the equations", widest, 1e-12)],
        measured=f"the equations have rank 20 along all families: smallest relative singular value {widest:.0e}, the "
        f"next >= {least:.0e}",
        source=source("singular values of the equations' Jacobian along all families", Steady.jacobian),
        checks=[SelfCheck("smallest over next singular value", widest / least, 1e-3), residual_check],
    )
