"""Faults that an engine may have, planted: the examination fails, and its diagnosis names the fault and no other."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from planting import (
    Fault,
    Planted,
    changed,
    mapped,
    mirrored,
    mirrored_back,
    plant,
    reported,
    same,
    scaled_rate,
)
from scipy.interpolate import CubicSpline

from velodrome.engines.engine import REFERENCE, Problem, Trajectory
from velodrome.engines.registry import load_engine
from velodrome.reference.dae import dynamics
from velodrome.reference.kinematics import COORDINATES
from velodrome.reference.surface import Plane
from velodrome.testing import ConformanceError, ConformanceReport, check_engine, examine_engine

pytestmark = pytest.mark.once  # the examination's judgement; `test_conformance` examines every engine

ENGINES = (REFERENCE, "exudyn")
ANGLES = np.arange(9) >= 3


def diagnoses(report: ConformanceReport) -> set[str]:
    """What is said to look like something, such as "yaw looks mirrored"."""
    words = " ".join(str(line) for check in report.failed for line in check.found)
    return set(re.findall(r"([a-z_]+(?: and [a-z_]+)?) looks? (mirrored|swapped|scaled|to be in|stale)", words))


def failed(report: ConformanceReport) -> set[str]:
    return {check.name.split(" on ")[0] for check in report.failed}


def said(report: ConformanceReport) -> str:
    return "\n".join(line for check in report.failed for line in check.found)


# Mirrored, these lift the wheels off the ground or press them into it.
LIFTING = ("lean", "pitch", "steer")


@pytest.mark.parametrize("name", LIFTING)
def test_an_engine_that_refuses_a_mirrored_start_says_why(name: str) -> None:
    assert "of the rolling joint" in (text := said(examine_engine(plant("exudyn", mirrored(name)))))
    assert " starts " in text


@pytest.mark.parametrize(
    ("engine", "name"),
    [
        (engine, name)
        for engine in ENGINES
        for name in COORDINATES
        if name not in ("x", "z") and not (engine != REFERENCE and name in LIFTING)
    ],
)
def test_a_mirrored_coordinate_is_named(engine: str, name: str) -> None:
    report = examine_engine(plant(engine, mirrored(name)))
    assert f"{name} looks mirrored: " in said(report)
    assert {what for what, _ in diagnoses(report)} == {name}
    # On the way in the state leaves the constraints: engines move it, or cannot ride.
    assert failed(report) <= {"maps", "start", "ride"}
    assert failed(report) >= {"maps"}


@pytest.mark.parametrize("engine", ENGINES)
def test_both_spins_mirrored_are_named_together(engine: str) -> None:
    report = examine_engine(plant(engine, mirrored("rear_angle", "front_angle")))
    assert {what for what, _ in diagnoses(report)} == {"rear_angle and front_angle"}


@pytest.mark.parametrize("name", COORDINATES)
def test_a_coordinate_mirrored_on_the_way_back_alone_is_named(name: str) -> None:
    report = examine_engine(plant(REFERENCE, mirrored_back(name)))
    assert {what for what, _ in diagnoses(report)} == {name}
    assert failed(report) == {"maps", "start"}
    assert "looks mirrored" in said(report)


SWAP = np.arange(9)
SWAP[[4, 6]] = 6, 4


def swapped_back(trajectory: Trajectory, _problem: Problem, _step: float) -> dict[str, Any]:
    return {"q": trajectory.q[:, SWAP], "qd": trajectory.qd[:, SWAP]}


def rates_late(share: float) -> Fault:
    """Rates of a time before the coordinates', by a share of a step."""

    def change(trajectory: Trajectory, _problem: Problem, step: float) -> dict[str, Any]:
        qd = CubicSpline(trajectory.time, trajectory.qd)(trajectory.time - share * step)
        return {"qd": np.concatenate([trajectory.qd[:1], qd[1:]])}

    return reported(change)


def sample_before(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values[:1], values[:-1]])


def moved_frame(trajectory: Trajectory, problem: Problem, _step: float) -> dict[str, Any]:
    """The rear frame's position given by D."""
    position = trajectory.body_position.copy()
    position[:, 0] = trajectory.q[:, :3]
    return {"body_position": position}


def samples_late(trajectory: Trajectory, _problem: Problem, step: float) -> dict[str, Any]:
    q = trajectory.q.copy()
    q[1:] -= step * trajectory.qd[1:]
    return {"q": q}


@dataclass(frozen=True)
class Told:
    """A fault, the checks that it fails, and what must be said."""

    fault: Fault
    checks: set[str]
    words: str


FAULTS = {
    "x, y, z, w": Told(
        changed("body_quaternion", by=lambda given: given[..., [1, 2, 3, 0]]),
        {"bodies"},
        "quaternions look to be in the order (x, y, z, w); the suite's is (w, x, y, z)",
    ),
    "conjugate quaternions": Told(
        changed("body_quaternion", by=lambda given: given * [1, -1, -1, -1]),
        {"bodies"},
        "quaternions look to turn inertial axes to the body's",
    ),
    "bodies 1 mm high": Told(
        changed("body_position", by=lambda given: given + np.array([0, 0, 1e-3])),
        {"bodies"},
        "all bodies look shifted by (0, 0, 0.001) m",
    ),
    "the frame by another point": Told(reported(moved_frame), {"bodies"}, "the rear frame looks given by a point"),
    "bodies in another order": Told(
        changed("body_position", by=lambda given: given[:, [1, 0, 2, 3]]),
        {"bodies"},
        "bodies look to be in the order front frame, rear frame, rear wheel, front wheel",
    ),
    "rear rate by 1.001": Told(
        scaled_rate("rear_angle", 1.001, both=False),
        {"start", "rates"},
        "the rate of rear_angle looks scaled by 1.001",
    ),
    "rear rate by 1.001, both ways": Told(
        scaled_rate("rear_angle", 1.001, both=True),
        {"start", "rates", "order"},
        "the rate of rear_angle looks scaled by 1.001: the wheels slip by as much",
    ),
    "degrees": Told(
        mapped(np.ones(9), np.where(ANGLES, 180 / np.pi, 1), np.ones(9), np.where(ANGLES, 180 / np.pi, 1)),
        {"start", "maps"},
        "every angle looks to be in degrees",
    ),
    "lean and steer swapped": Told(reported(swapped_back), {"start", "maps", "bodies"}, "lean looks swapped with"),
    "rates half a step late": Told(rates_late(0.5), {"rates"}, "s late"),
    "samples a step late": Told(reported(samples_late), {"clock", "order"}, "its samples look"),
    "forces on the ground": Told(changed("contact_force", by=lambda force: -force), {"forces"}, "with the wrong sign"),
    "forces of the other wheel": Told(
        changed("contact_force", by=lambda force: force[:, ::-1].copy()), {"forces"}, "of the other wheel"
    ),
    "forces in kilonewtons": Told(
        changed("contact_force", by=lambda force: force / 1000), {"forces"}, "in kilonewtons"
    ),
    "forces by 1.01": Told(changed("contact_force", by=lambda force: 1.01 * force), {"forces"}, "scaled by 1.01"),
    "forces without friction": Told(
        changed("contact_force", by=lambda force: force * [0, 0, 1]), {"forces"}, "without their tangential part"
    ),
    "stale energies": Told(
        changed("kinetic_energy", "potential_energy", by=sample_before),
        {"reports"},
        "kinetic energy looks stale, that of the sample before",
    ),
    "another datum": Told(
        changed("potential_energy", by=lambda energy: energy - 100.0),
        {"reports"},
        "potential energy looks shifted by -100 J",
    ),
    "contact points of the other wheel": Told(
        changed("contact_point", by=lambda point: point[:, ::-1].copy()),
        {"reports"},
        "contact point looks swapped between the rear and the front wheel",
    ),
}
# Those that an engine of lower order must tell too; its start is not put back on the constraints.
IN_EXUDYN = {
    "x, y, z, w": set(),
    "bodies 1 mm high": set(),
    "rear rate by 1.001": set(),
    "rear rate by 1.001, both ways": {"start"},
    "rates half a step late": set(),
    # A lag of a step vanishes with the step.
    "samples a step late": {"order"},
    "forces on the ground": set(),
    "forces by 1.01": set(),
    "stale energies": set(),
}
CASES = [(REFERENCE, what, set()) for what in FAULTS] + [("exudyn", what, less) for what, less in IN_EXUDYN.items()]


@pytest.mark.parametrize(("engine", "what", "less"), CASES, ids=[f"{engine}: {what}" for engine, what, _ in CASES])
def test_a_planted_fault_is_named(engine: str, what: str, less: set[str]) -> None:
    report = examine_engine(plant(engine, FAULTS[what].fault))
    assert failed(report) == FAULTS[what].checks - less, report
    assert FAULTS[what].words in said(report)


@pytest.mark.parametrize("engine", ENGINES)
def test_wrapped_angles_are_fine(engine: str) -> None:
    def wrapped(trajectory: Trajectory, _problem: Problem, _step: float) -> dict[str, Any]:
        return {"q": np.where(ANGLES, (trajectory.q + np.pi) % (2 * np.pi) - np.pi, trajectory.q)}

    turned = plant(engine, reported(wrapped))
    assert check_engine(turned).passed


def test_the_lag_of_rates_is_measured() -> None:
    report = examine_engine(plant("exudyn", rates_late(0.5)))
    line = next(line for line in report["rates on plane"].found if line.startswith("its rates look"))
    # Half of 1 ms, fitted by differences over output intervals of 12 ms: to (12 ms rate)^2 / 6 of rates of some 5 1/s.
    assert float(line.split()[3]) == pytest.approx(5e-4, rel=1e-2)


def test_what_an_engine_of_low_order_hides_is_said() -> None:
    # Euler's method at 2 ms: its rates and coordinates are half a step apart anyway.
    for fault in (None, rates_late(0.5)):
        engine = load_engine("mujoco-default") if fault is None else plant("mujoco-default", fault)
        check = examine_engine(engine)["rates on plane"]
        assert check.outcome == "passed"
        assert check.found == (
            "rates half a step late, by 0.001 s, could not have been detected: its own error is not smaller",
        )
    # Signs it tells all the same.
    assert "steer looks mirrored" in said(examine_engine(plant("mujoco-default", mirrored_back("steer"))))
    assert "with the wrong sign" in said(examine_engine(plant("mujoco-default", FAULTS["forces on the ground"].fault)))


def test_the_check_says_what_it_would_have_told() -> None:
    assert "would have been detected" in examine_engine("exudyn")["rates on plane"].found[0]


# What is not the engine's own.


def copy(changes: Any = None) -> Planted:
    """An engine that rides, and returns the reference's trajectory."""

    def after(trajectory: Trajectory, problem: Problem, _step: float) -> Trajectory:
        reference = load_engine(REFERENCE)
        taken = reference.simulate(problem, reference.settings(), lambda _: None)
        values = {
            name: getattr(taken, name) for name in ("q", "qd", "body_position", "body_quaternion", "contact_force")
        }
        values |= {name: getattr(taken, name) for name in ("contact_point", "gap", "slip")}
        values |= {name: getattr(taken, name) for name in ("kinetic_energy", "potential_energy")}
        found = replace(trajectory, **values)
        return found if changes is None else replace(found, **changes(found))

    return plant("exudyn", (same, after))


def noisy(trajectory: Trajectory) -> dict[str, Any]:
    rng = np.random.default_rng(0)
    one = np.spacing(np.abs(trajectory.q)) * rng.choice([-1, 1], trajectory.q.shape)
    return {"q": trajectory.q + one}


@pytest.mark.parametrize("changes", [None, noisy])
def test_a_copy_of_the_reference_is_one(changes: Any) -> None:
    report = examine_engine(copy(changes))
    assert "its ride is the reference's" in said(report)
    assert "own work" in failed(report)


def test_forces_taken_from_the_reference_are_told() -> None:
    def taken(trajectory: Trajectory, problem: Problem, _step: float) -> dict[str, Any]:
        states = zip(trajectory.q, trajectory.qd, strict=True)
        return {"contact_force": np.array([dynamics(problem.bicycle, problem.surface, *one).force for one in states])}

    report = examine_engine(plant("exudyn", reported(taken)))
    assert failed(report) == {"own work"}
    assert "its contact forces are the reference's" in said(report)


def test_another_bicycle_is_told_from_a_map() -> None:
    def heavier(problem: Problem) -> Problem:
        return replace(problem, bicycle=replace(problem.bicycle, rear_frame_Ixx=1.01 * problem.bicycle.rear_frame_Ixx))

    report = examine_engine(plant("exudyn", (heavier, lambda trajectory, *_: trajectory)))
    assert "order" in failed(report)
    assert "a mass, an inertia, a length or gravity looks different" in said(report)
    assert not diagnoses(report)


def test_an_engine_that_knows_one_bicycle_only_is_told() -> None:
    def forget(problem: Problem) -> Problem:
        return replace(problem, bicycle=type(problem.bicycle)())

    report = examine_engine(plant("exudyn", (forget, lambda trajectory, *_: trajectory)))
    assert report.failed
    assert all("another bicycle" in check.name for check in report.failed)


def test_ground_that_is_ridden_as_a_plane_is_told() -> None:
    def flat(problem: Problem) -> Problem:
        return replace(problem, surface=Plane())

    report = examine_engine(plant("mujoco-multipliers", (flat, lambda trajectory, *_: trajectory)))
    assert report.failed
    assert all("plane" not in check.name.split(" on ")[-1] for check in report.failed)


def test_the_error_lists_all_that_fails() -> None:
    both = plant("exudyn", changed("contact_force", by=lambda force: -force))
    with pytest.raises(ConformanceError, match="engine 'exudyn' fails 2 of 26 checks") as caught:
        check_engine(both)
    assert isinstance(caught.value, AssertionError)
    assert " ".join(str(caught.value).split()).count("with the wrong sign") == 2
    assert not caught.value.report.passed
    printed = str(examine_engine("exudyn"))
    assert printed.splitlines()[0].endswith("30 passed, 0 failed, 0 skipped")
    assert max(map(len, printed.splitlines())) < 120
