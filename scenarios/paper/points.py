"""Section 4.2: the points Q1 and Q2, their spectra, and what they show about D."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...reference.circular import CircularMotion
from ...reference.kinematics import rotations
from ...reference.stability import Linearisation, linearise
from ...reference.surface import Paraboloid
from .configurations import circular_command_line, named_motion, own_errors, solved_point
from .evidence import Evidence
from .ledger import LedgerLine, SelfCheck, above, below, claim_line, figure_line, source, untestable_line

_STATES = (("x", "D's x in the heading frame"), ("y", "D's y"), ("lean", "lean"), ("steer", "steer"))


def point_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    """Yield the lines on Q1 and Q2."""
    for name in ("Q1", "Q2"):
        motion, printed = named_motion(evidence, name), evidence.figures[name]
        errors = own_errors(evidence, name, motion)
        values = {"x": motion.position[0], "y": motion.position[1], "lean": motion.lean, "steer": motion.steer}
        for (field, what), text in zip(_STATES, printed["v"], strict=False):
            yield figure_line(
                "4.2", f"{name}: {what}", text, float(values[field]), errors[field], solved_point(evidence, name)
            )
        yield from _spectrum_lines(evidence, name, motion)
        why = "the text lacks the matrix; its eigenvalues are tested above"
        yield untestable_line("4.2", f"{name}: the 7 x 7 Jacobian as printed", why, "number")
    yield from _stability_lines(evidence)


def _spectrum_lines(evidence: Evidence, name: str, motion: CircularMotion) -> Iterator[LedgerLine]:
    surface = Paraboloid(evidence.figures[name]["alpha"])
    reduced = linearise(evidence.bicycle, surface, *motion.state())
    error = eigenvalue_errors(reduced)
    computed = source(
        "eigenvalues of the reduced Jacobian at the motion",
        linearise,
        eigenvalue_errors,
        command=circular_command_line(evidence, name),
    )
    for real, imaginary in evidence.figures[name]["eigenvalues"]:
        target = complex(float(real), float(imaginary))
        i = int(np.abs(reduced.eigenvalues - target).argmin())
        value = complex(reduced.eigenvalues[i])
        if target == 0:
            yield claim_line(
                section="4.2",
                claim=f"{name}: an eigenvalue is zero",
                thresholds=[below("smallest size of an eigenvalue", abs(value), 1e-9, "1/s")],
                measured=f"smallest {abs(value):.0e}",
                source=computed,
                checks=[SelfCheck("its own error", float(error[i]), 1e-9)],
                kind="number",
                printed="0",
            )
            continue
        claim = f"{name}: eigenvalue {_format_complex(real, imaginary)}"
        yield figure_line("4.2", f"{claim}, real part", real, value.real, float(error[i]), computed)
        if target.imag:
            yield figure_line("4.2", f"{claim}, imaginary part", imaginary, abs(value.imag), float(error[i]), computed)


def _format_complex(real: str, imaginary: str) -> str:
    return real if float(imaginary) == 0 else f"{real} +- {imaginary} i"


def eigenvalue_errors(reduced: Linearisation) -> np.ndarray:
    """Estimate the error of each eigenvalue, shape (7,): 1e-14 of the Jacobian's norm times the condition number."""
    values, right = np.linalg.eig(reduced.jacobian)
    left = np.linalg.inv(right)
    condition = np.linalg.norm(right, axis=0) * np.linalg.norm(left, axis=1)
    order = [int(np.abs(values - value).argmin()) for value in reduced.eigenvalues]
    return 1e-14 * np.linalg.norm(reduced.jacobian) * condition[order]


def _stability_lines(evidence: Evidence) -> Iterator[LedgerLine]:
    for name, stable, forward in (("Q1", False, True), ("Q2", True, False)):
        motion, point = named_motion(evidence, name), evidence.figures[name]
        surface = Paraboloid(point["alpha"])
        reduced = linearise(evidence.bicycle, surface, *motion.state())
        rest = np.delete(reduced.eigenvalues, int(np.abs(reduced.eigenvalues).argmin()))
        growth = float(np.real(rest).max())
        field = SelfCheck("largest of X at the motion", float(np.abs(reduced.field).max()), 1e-9)
        sense, bar = ("anticlockwise", "forward") if forward else ("clockwise", "reversed")
        command = circular_command_line(evidence, name)
        half, than = np.pi / 2, (above, below) if forward else (below, above)
        yield claim_line(
            section="4.2",
            claim=f"{name} rides {sense}, handlebar {bar}",
            thresholds=[
                than[0]("yaw rate", motion.yaw_rate, 0.0, "rad/s"),
                than[1]("steer", motion.steer, half, "rad"),
            ],
            measured=f"yaw rate {motion.yaw_rate:.4f}, steer {motion.steer:.4f}",
            source=solved_point(evidence, name),
            checks=[field],
        )
        what = "largest real part of the six other eigenvalues"
        yield claim_line(
            section="4.2",
            claim=f"{name} is {'Lyapunov stable, not asymptotically' if stable else 'Lyapunov unstable'}",
            thresholds=[(below if stable else above)(what, growth, 0.0, "1/s")],
            measured=f"{what} {growth:.6f}",
            source=source("eigenvalues of the reduced Jacobian at the motion", linearise, command=command),
            checks=[
                field,
                SelfCheck("own error over its size", float(eigenvalue_errors(reduced).max()) / abs(growth), 1e-3),
            ],
            kind="stability",
        )
    yield _reference_point_line(evidence)


def _reference_point_line(evidence: Evidence) -> LedgerLine:
    """Make the line on D: at another height of the steering axis D would have other x and y than the printed ones."""
    worst, other = 0.0, np.inf
    for name in ("Q1", "Q2"):
        motion, printed = named_motion(evidence, name), evidence.figures[name]["v"][:2]
        off = np.abs(motion.position[:2] - [float(text) for text in printed])
        worst = max(worst, float(off.max()))
        # D moved along the steering axis to the height of the rear axle, in the heading frame.
        q, _ = motion.state()
        bicycle = evidence.bicycle
        rise = (bicycle.rear_wheel_radius - bicycle.front_wheel_radius) / bicycle.steer_axis[2]
        shift = rotations(bicycle, q[None])[0, 0] @ (rise * bicycle.steer_axis)
        other = min(other, float(np.abs(motion.position[:2] + shift[:2] - [float(t) for t in printed]).max()))
    return claim_line(
        section="2.1",
        claim="D is the point of the steering axis at the height of the front axle",
        thresholds=[
            below("largest distance from the printed x and y, to half a unit of their last digit,", worst, 0.005, "m"),
            above("the same for a D at the rear axle's height", other, 0.005, "m"),
        ],
        measured=f"the printed x and y of Q1 and Q2 then agree to {worst:.4f} m, at the rear axle's height to "
        f"{other:.4f} m",
        source=source(
            "D of Q1 and Q2 for two readings of its place",
            named_motion,
            rotations,
            command=" && ".join(circular_command_line(evidence, name) for name in ("Q1", "Q2")),
        ),
        checks=[SelfCheck("largest residual", max(named_motion(evidence, n).residual for n in ("Q1", "Q2")), 1e-12)],
    )
