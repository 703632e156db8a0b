"""How a rolling joint starts in Exudyn: the first contact forces, and the starts that are refused."""

from __future__ import annotations

import math
import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import SensorObject
from exudyn.rigidBodyUtilities import InertiaCylinder

from velodrome.engines.exudyn.joint import CreateRollingJointOnSurface
from velodrome.engines.exudyn.sensor import CreateRollingJointSensor
from velodrome.engines.exudyn.solve import no_progress
from velodrome.reference.surface import Paraboloid, Plane

EXAMPLE = SimpleNamespace(
    **runpy.run_path(str(Path(__file__).parents[2] / "examples" / "rolling_disc_in_bowl.py"), run_name="example")
)
MOTION = EXAMPLE.steady_precession(2.0, 0.5)
LIBRARY: Any = exu
NODES = LIBRARY.NodeType
SOLVERS = LIBRARY.LinearSolverType
FORCE = np.linalg.norm(MOTION.force)
RADIUS, STEP = 0.3, 1e-3


def new_system() -> tuple[Any, Any]:
    """A container, which must be kept alive, and its system."""
    container: Any = exu.SystemContainer()
    return container, container.AddSystem()


def settings(steps: int, index_2: bool = False) -> Any:
    options: Any = exu.SimulationSettings()
    options.solution.file.write = False
    options.solution.sensors.writePeriod = STEP
    options.timeIntegration.verboseMode = options.staticSolver.verboseMode = 0
    options.timeIntegration.numberOfSteps, options.timeIntegration.endTime = steps, steps * STEP
    options.timeIntegration.generalizedAlpha.useNewmark = index_2
    options.timeIntegration.generalizedAlpha.useIndex2Constraints = index_2
    options.timeIntegration.newton.relativeTolerance = 1e-11
    return options


def add_precessing_disc(mbs: Any, node: Any) -> Any:
    """The example's disc, on nodes of any kind."""
    sine, cosine = math.sin(MOTION.lean), math.cos(MOTION.lean)
    axes = np.column_stack([[0.0, 1.0, 0.0], [-cosine, 0.0, -sine], [-sine, 0.0, cosine]])
    spin = MOTION.rate * np.array([0.0, 0.0, 1.0]) + MOTION.spin * axes[:, 1]
    arm = EXAMPLE.RADIUS * axes[:, 2]
    height = EXAMPLE.BOWL.parameters[0] * MOTION.distance**2
    return mbs.CreateRigidBody(
        inertia=EXAMPLE.INERTIA,
        referencePosition=np.array([MOTION.distance, 0.0, height]) + arm,
        referenceRotationMatrix=axes,
        initialVelocity=np.cross(spin, arm),
        initialAngularVelocity=spin,
        gravity=[0, 0, -EXAMPLE.GRAVITY],
        nodeType=node,
        show=False,
    )


def force_errors(node: Any, options: Any) -> np.ndarray:
    """Relative errors of the size of the contact force, which is constant, in every step."""
    _container, mbs = new_system()
    joint = CreateRollingJointOnSurface(
        mbs,
        bodyNumbers=[add_precessing_disc(mbs, node)],
        axisVector=[0, 1, 0],
        discRadius=EXAMPLE.RADIUS,
        surface=EXAMPLE.BOWL,
    )
    sensor = CreateRollingJointSensor(mbs, joint, "ContactForce")
    mbs.Assemble()
    with no_progress():
        mbs.SolveDynamic(options)
    return np.linalg.norm(mbs.GetSensorStoredData(sensor)[:, 1:], axis=1) / FORCE - 1


@pytest.mark.parametrize("linear_solver", ["EXUdense", "EigenSparse"])
@pytest.mark.parametrize("node", ["RotationEulerParameters", "RotationRotationVector"])
def test_initial_forces_are_right(node, linear_solver) -> None:
    """The engine's differences of 1e-9 leave their round-off, 1e-16 of the rows' numbers below 10, over 1e-9."""
    options = settings(1)
    options.linearSolver.solverType = getattr(SOLVERS, linear_solver)
    assert abs(force_errors(getattr(NODES, node), options)[0]) < 10 * 10 * np.finfo(float).eps / 1e-9


@pytest.mark.parametrize("node", ["RotationEulerParameters", "RotationRotationVector"])
def test_trapezoidal_rule_keeps_forces_right(node) -> None:
    """Undamped, an error of the initial accelerations would alternate all the time; the rule's own is (k h)^2."""
    errors = force_errors(getattr(NODES, node), settings(100, index_2=True))
    assert np.abs(errors).max() < (MOTION.spin * STEP) ** 2


def add_joint(mbs: Any, height: float, axle: Any = (0, 1, 0), surface: Any = None, name: str = "") -> Any:
    """A disc at rest with its centre above the origin, upright by default."""
    disc = mbs.CreateRigidBody(
        inertia=InertiaCylinder(density=2700, length=0.02, outerRadius=RADIUS, axis=1),
        referencePosition=[0, 0, height],
        gravity=[0, 0, -9.81],
        show=False,
    )
    return disc, CreateRollingJointOnSurface(
        mbs,
        name=name,
        bodyNumbers=[disc],
        axisVector=axle,
        discRadius=RADIUS,
        surface=surface or Plane(),
    )


FALL = 9.80665 / 2 * STEP**2


@pytest.mark.parametrize("initial_accelerations", [True, False])
@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"height": 0.5}, "wheel 0 .body 0. of the rolling joint 'front' starts 200 mm above the ground"),
        ({"height": 0.2}, "starts 100 mm below the ground"),
        ({"height": RADIUS + 1.01 * FALL}, "closing more than 0.0049 mm"),
        ({"height": 0.0, "axle": (0, 0, 1)}, "edge lies flat"),
        ({"height": RADIUS, "surface": Paraboloid(5.0)}, "wheel 0 .body 0. .* the ground"),
    ],
)
def test_starts_off_the_ground_are_refused(change, complaint, initial_accelerations) -> None:
    _container, mbs = new_system()
    add_joint(mbs, name="front", **change)
    mbs.Assemble()
    options = settings(3)
    options.timeIntegration.generalizedAlpha.computeInitialAccelerations = initial_accelerations
    with no_progress(), pytest.raises(ValueError, match=complaint):
        mbs.SolveDynamic(options)


def test_a_gap_within_the_free_fall_is_closed() -> None:
    _container, mbs = new_system()
    disc, _ = add_joint(mbs, RADIUS + 0.99 * FALL)
    mbs.Assemble()
    with no_progress():
        mbs.SolveDynamic(settings(3))
    height = mbs.GetObjectOutputBody(disc, LIBRARY.OutputVariableType.Position, [0, 0, 0])[2]
    # Newton's method leaves 1e-11 of the weight of 150 N as metres.
    assert height == pytest.approx(RADIUS, abs=1e-11 * 150)


@pytest.mark.parametrize("own", [True, False])
def test_the_static_solver_turns_the_sign_of_forces(own) -> None:
    """Of the engine's own disc's as well, so users must know; it carries the weight, held upright by springs."""
    normal = []
    for solver in ("SolveDynamic", "SolveStatic"):
        _container, mbs = new_system()
        ground = mbs.CreateGround()
        disc, joint = add_joint(mbs, RADIUS)
        for axis in np.eye(3):
            mbs.CreateTorsionalSpringDamper(
                itemNumbers=[ground, disc], position=[0, 0, RADIUS], axis=axis, stiffness=1e3, damping=0, show=False
            )
        if own:
            force = CreateRollingJointSensor(mbs, joint, "ContactForce")
        else:
            mbs.SetObjectParameter(joint.objectNumber, "activeConnector", False)
            rolling = mbs.CreateRollingDisc(
                bodyNumbers=[ground, disc], axisPosition=[0, 0, 0], axisVector=[0, 1, 0], discRadius=RADIUS, show=False
            )
            kind = LIBRARY.OutputVariableType.ForceLocal
            force = mbs.AddSensor(
                SensorObject(objectNumber=rolling, outputVariableType=kind, storeInternal=True, writeToFile=False)
            )
        mbs.Assemble()
        with no_progress():
            getattr(mbs, solver)(settings(2))
        normal.append(mbs.GetSensorStoredData(force)[-1, 3])
    weight = InertiaCylinder(density=2700, length=0.02, outerRadius=RADIUS, axis=1).Mass() * 9.81
    # The static solver's default tolerance is 1e-8 of the residual, which begins as the weight.
    np.testing.assert_allclose(normal, [weight, -weight], rtol=1e-7)
