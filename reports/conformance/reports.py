"""Whether an engine's bodies, contacts and energies agree with its coordinates, with explanations if they do not.

The limits are those of `velodrome.reports.measure.find_mismatches`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from ...engines.coordinates import rotation_matrices
from ...reference.bicycle import BODIES
from ...reference.kinematics import WHEELS
from ..measure import describe_mismatch
from .explain import EXPLAINED, explains, fit_factor, fit_lag
from .report import ConformanceCheck, make_check, skip_check
from .rides import Ride

LIMIT = "error of the start, step_noise and four times the error of the coordinates themselves"
_OF_RATES = ("slip", "kinetic_energy")
_REPORTS = ("contact_point", "gap", "slip", "kinetic_energy", "potential_energy")
_ORDERS = {"(x, y, z, w)": [3, 0, 1, 2], "(z, y, x, w)": [3, 2, 1, 0], "(w, z, y, x)": [0, 3, 2, 1]}


def check_bodies(ride: Ride) -> ConformanceCheck:
    """Check the poses of the four bodies."""
    wrong = []
    for mismatch in ride.mismatch(["body_position", "body_quaternion"]):
        wrong.append(describe_mismatch(mismatch.as_json()))
        wrong += _explain_positions(ride) if mismatch.quantity == "body_position" else _explain_quaternions(ride)
    return make_check(
        f"bodies on {ride.motion.name}", "its bodies are where its coordinates put them", wrong, tolerance=LIMIT
    )


def check_reports(ride: Ride) -> ConformanceCheck:
    """Check the contact points, gaps, slip and energies that the engine gives."""
    name, claim = f"reports on {ride.motion.name}", "contacts and energies that it gives follow from its coordinates"
    given = [field for field in _REPORTS if getattr(ride.trajectory, field) is not None]
    if not given:
        return skip_check(name, claim, "it gives none")
    wrong, observations = [], [f"it gives {', '.join(given)}"]
    if ride.mismatch(["qd"]):
        given = [field for field in given if field not in _OF_RATES]
        observations.append("slip and kinetic energy are not checked: they follow from rates that are wrong")
    for mismatch in ride.mismatch(given):
        wrong.append(describe_mismatch(mismatch.as_json()))
        explanation = _explain_report(ride, mismatch.quantity)
        if explanation is not None:
            wrong.append(explanation)
    return make_check(name, claim, wrong, observations, LIMIT)


def _explain_positions(ride: Ride) -> Iterator[str]:
    given, right = ride.trajectory.body_position, ride.followed.body_position
    off, noise = given - right, 1e-3 * np.abs(given - right).max()
    first = off[0, 0]
    if np.abs(off - first).max() <= noise:
        yield f"all bodies look shifted by {_format(first)} m: another height or origin than the suite's"
        return
    for axis, letter in enumerate("xyz"):
        mirror = np.ones(3)
        mirror[axis] = -1
        if explains(given, mirror * right, right):
            yield f"{letter} of the bodies looks mirrored"
            return
    yield from _explain_body_order(given, right)
    turned = rotation_matrices(ride.followed.body_quaternion)
    inside = np.einsum("nbji,nbj->nbi", turned, off)
    for body, arm in enumerate(inside.mean(axis=0)):
        if np.abs(arm).max() > noise and np.abs(inside[:, body] - arm).max() <= noise:
            yield f"the {_spell(BODIES[body])} looks given by a point that is {_format(arm)} m from its centre of mass"
    lag = fit_lag(given, right, ride.trajectory.time)
    if lag is not None:
        yield f"positions of the bodies look {lag:.3g} s late"


def _explain_quaternions(ride: Ride) -> Iterator[str]:
    given, right = ride.trajectory.body_quaternion, ride.followed.body_quaternion

    def same(guess: np.ndarray) -> bool:
        sign = np.sign(np.sum(guess * right, axis=-1, keepdims=True))
        return explains(sign * guess, right, given)

    for order, index in _ORDERS.items():
        if same(given[..., index]):
            yield f"quaternions look to be in the order {order}; the suite's is (w, x, y, z)"
            return
    if same(given * [1, -1, -1, -1]):
        yield "quaternions look to turn inertial axes to the body's; the suite's turn the body's to inertial axes"
        return
    for axis, letter in enumerate("xyz"):
        mirror = -np.ones(4)
        mirror[[0, 1 + axis]] = 1
        if same(given * mirror):
            yield f"rotations look mirrored in the plane square to {letter}"
            return
    for body, name in enumerate(BODIES):
        length = np.linalg.norm(given[:, body], axis=-1)
        if np.abs(length - 1).max() > 1e-6:
            yield f"quaternions of the {_spell(name)} have lengths of {length.min():.3g} to {length.max():.3g}, not 1"
            return
    sign = np.sign(np.sum(given * right, axis=-1, keepdims=True))
    yield from _explain_body_order(sign * given, right)


def _explain_body_order(given: np.ndarray, right: np.ndarray) -> Iterator[str]:
    for order in permutations(range(4)):
        if list(order) != [0, 1, 2, 3] and explains(given, right[:, list(order)], right):
            names = ", ".join(_spell(BODIES[i]) for i in order)
            yield f"bodies look to be in the order {names}; the suite's is {', '.join(map(_spell, BODIES))}"
            return


def _explain_report(ride: Ride, field: str) -> str | None:
    """Explain how a field differs from the one that follows from the coordinates; None if nothing explains it."""
    given, right = getattr(ride.trajectory, field), getattr(ride.followed, field)
    words = field.replace("_", " ")
    if field.endswith("energy"):
        stale = np.concatenate([right[:1], right[:-1]])
        if explains(given, stale, right):
            return f"its {words} looks stale, that of the sample before"
        offset, factor = float(np.median(given - right)), fit_factor(given, right)
        if explains(given, right + offset, right):
            scaled = "" if factor is None else f", or scaled by {factor:.6g}: another mass or gravity"
            return f"its {words} looks shifted by {offset:.6g} J: another datum than z = 0{scaled}"
    if explains(given, -right, right):
        return f"its {words} looks mirrored"
    if field != "kinetic_energy" and field != "potential_energy":
        if explains(given, right[:, ::-1], right):
            return f"its {words} looks swapped between the {WHEELS[0]} and the {WHEELS[1]} wheel"
        if field == "slip" and explains(given, right[..., ::-1], right):
            return "its slip looks to be (forward, lateral); the suite's is (lateral, forward)"
    factor = fit_factor(given, right)
    if factor is not None and abs(factor) > EXPLAINED:
        return f"its {words} looks scaled by {factor:.6g}"
    lag = fit_lag(given, right, ride.trajectory.time)
    return None if lag is None else f"its {words} looks {lag:.3g} s late"


def _format(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.3g}" for value in np.round(values, 12)) + ")"


def _spell(name: str) -> str:
    return name.replace("_", " ")
