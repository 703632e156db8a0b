"""The rolling joint as a piece of its own: in the example's disc, in any model, and what it refuses."""

from __future__ import annotations

import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import SensorBody
from exudyn.rigidBodyUtilities import InertiaCylinder

from velodrome.engines.exudyn.joint import CreateRollingJointOnSurface
from velodrome.engines.exudyn.sensor import CreateRollingJointSensor
from velodrome.engines.exudyn.solve import no_progress
from velodrome.reference.bowls import Sphere
from velodrome.reference.surface import Paraboloid, Plane, evaluate

EXAMPLE = SimpleNamespace(
    **runpy.run_path(str(Path(__file__).parents[2] / "examples" / "rolling_disc_in_bowl.py"), run_name="example")
)
MOTION = EXAMPLE.steady_precession(2.0, 0.5)
STEP = 2e-3
# Halving the step divides an error C h^2 (1 + k h + ...) by 4 (1 +- k h), k the fastest rate: the disc's spin.
NEXT_ORDER = MOTION.spin * STEP


@pytest.fixture(scope="module")
def kicked() -> list[Any]:
    with no_progress():
        return [EXAMPLE.ride(MOTION, step, 1.0, kick=0.5) for step in (STEP, STEP / 2)]


def drift(ride: Any) -> float:
    return float(np.abs(ride.energy / ride.energy[0] - 1).max())


@pytest.mark.parametrize("surface", [EXAMPLE.BOWL, Plane(), Sphere(2.6)])
def test_steady_precession_is_kept_with_order_two(surface) -> None:
    """Centre and contact force of the example's equations, which ask for the circle only, not for the surface."""
    with no_progress():
        rides = [EXAMPLE.ride(MOTION, step, 1.0, surface=surface) for step in (STEP, STEP / 2)]
    coarse, fine = (EXAMPLE.errors(MOTION, ride) for ride in rides)
    assert coarse[0] / fine[0] == pytest.approx(4, rel=NEXT_ORDER)
    # The error constant of a turn by k h a step, over the angle that the disc spins in a second.
    assert fine[0] < (MOTION.spin * STEP / 2) ** 2 / 12 * MOTION.spin * EXAMPLE.RADIUS
    # Without the corrected start the multipliers have first order until that dies out: k h.
    assert fine[1] < MOTION.spin * STEP / 2


def test_a_system_solved_again_does_the_same() -> None:
    """What the joint remembers of a run is a matter of speed only."""
    container: Any = exu.SystemContainer()
    mbs = container.AddSystem()
    disc = EXAMPLE.add_disc(mbs, MOTION, 0.5, EXAMPLE.BOWL)
    joint = CreateRollingJointOnSurface(
        mbs, bodyNumbers=[disc], axisVector=[0, 1, 0], discRadius=EXAMPLE.RADIUS, surface=EXAMPLE.BOWL
    )
    sensor = CreateRollingJointSensor(mbs, joint, "ContactForce")
    mbs.Assemble()
    settings: Any = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = 20, 0.02
    seen = []
    with no_progress():
        for _ in range(2):
            mbs.SolveDynamic(settings)
            seen.append(mbs.GetSensorStoredData(sensor).copy())
    assert len(seen[0]) > 1
    np.testing.assert_array_equal(*seen)


def test_energy_is_conserved_with_order_two(kicked) -> None:
    assert drift(kicked[0]) / drift(kicked[1]) == pytest.approx(4, rel=NEXT_ORDER)
    assert drift(kicked[1]) < (MOTION.spin * STEP / 2) ** 2


def test_sensors_see_the_edge_on_the_surface(kicked) -> None:
    for ride in kicked:
        ground = evaluate(EXAMPLE.BOWL, ride.point[:, 0], ride.point[:, 1])[:, 0]
        # Differences of coordinates of two metres: a few tens of their round-off.
        assert np.abs(ride.point[:, 2] - ground).max() < 30 * 2 * np.finfo(float).eps
        assert np.abs(ride.gap).max() < 30 * 2 * np.finfo(float).eps
        np.testing.assert_allclose(np.linalg.norm(ride.point - ride.centre, axis=1), EXAMPLE.RADIUS, rtol=1e-12)
        # Newton's method leaves 1e-10 of a residual that starts as forces of the size of the weight.
        assert np.abs(ride.slip).max() < 1e-10 * EXAMPLE.INERTIA.Mass() * EXAMPLE.GRAVITY


def test_force_sensor_gives_what_moves_the_disc(kicked) -> None:
    """m c'' = F - m g: second differences of the centre, with an error of the interval squared."""
    ride = kicked[1]
    interval = ride.time[1] - ride.time[0]
    acceleration = np.diff(ride.centre, 2, axis=0) / interval**2
    force = EXAMPLE.INERTIA.Mass() * (acceleration + np.array([0, 0, EXAMPLE.GRAVITY]))
    size = np.linalg.norm(ride.force, axis=1).max()
    # h^2 / 12 of the fourth derivative, at most the motion's fastest rate twice.
    assert np.abs(force - ride.force[1:-1]).max() < (MOTION.spin * interval) ** 2 / 12 * size


COIN_RADIUS = 0.2


def add_coin(mbs: Any, side: float, axle: int, offset: float) -> Any:
    """A leaning coin that rolls along x and turns, its axle the body's axis number ``axle``.

    Its centre is ``offset`` along the axle from the body's reference point.
    """
    inertia = InertiaCylinder(density=2000, length=0.02, outerRadius=COIN_RADIUS, axis=axle)
    forward, left = np.array([1.0, 0.0, 0.0]), np.array([0.0, np.cos(0.1), np.sin(0.1)])
    up = np.cross(forward, left)
    axes = np.roll(np.eye(3), -axle, axis=0)  # the axle and the two that follow it
    spin = 12.0 * left + np.array([0.0, 0.0, 0.5])
    arm = COIN_RADIUS * up - offset * left  # from the contact to the reference point
    return mbs.CreateRigidBody(
        inertia=inertia.Translated(offset * axes[0]),
        referencePosition=arm + np.array([0.0, side, 0.0]),
        referenceRotationMatrix=np.column_stack([left, up, forward]) @ axes,
        initialVelocity=np.cross(spin, arm),
        initialAngularVelocity=spin,
        gravity=[0, 0, -9.81],
        nodeType=exu.NodeType.RotationEulerParameters,
        show=False,
    )


def rolled(axle: int, offset: float, joints: int) -> np.ndarray:
    """Final centres of two coins that roll side by side on the plane, on one joint or on one each."""
    container: Any = exu.SystemContainer()
    mbs = container.AddSystem()
    bodies, centre = [add_coin(mbs, side, axle, offset) for side in (0.0, 1.0)], offset * np.eye(3)[axle]
    for group in [bodies] if joints == 1 else [[coin] for coin in bodies]:
        CreateRollingJointOnSurface(
            mbs,
            bodyNumbers=group,
            axisPosition=centre.tolist(),
            axisVector=(2 * np.eye(3)[axle]).tolist(),
            discRadius=COIN_RADIUS,
            surface=Plane(),
        )
    kind: Any = exu.OutputVariableType.Position
    options: Any = {"localPosition": centre, "outputVariableType": kind, "storeInternal": True, "writeToFile": False}
    sensors = [mbs.AddSensor(SensorBody(bodyNumber=coin, **options)) for coin in bodies]
    mbs.Assemble()
    settings: Any = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = 200, 0.2
    settings.timeIntegration.newton.relativeTolerance = 1e-11
    with no_progress():
        mbs.SolveDynamic(settings)
    return np.stack([mbs.GetSensorStoredData(sensor)[-1, 1:] for sensor in sensors])


def test_body_axes_and_sharing_do_not_matter() -> None:
    plain = rolled(axle=1, offset=0.0, joints=1)
    assert np.linalg.norm(plain[0] - [0, 0, plain[0, 2]]) > 0.4  # it has rolled
    np.testing.assert_allclose(plain[1] - plain[0], [0, 1, 0], atol=1e-10)  # what Newton's method leaves
    np.testing.assert_allclose(rolled(axle=1, offset=0.0, joints=2), plain, atol=1e-10)
    np.testing.assert_allclose(rolled(axle=2, offset=0.0, joints=1), plain, atol=1e-10)
    # Another reference point has other coordinates, hence another error of the method: (k h)^2 of the way.
    np.testing.assert_allclose(rolled(axle=0, offset=0.05, joints=1), plain, atol=(12e-3) ** 2 * 0.5)


def body(mbs: Any) -> Any:
    inertia = InertiaCylinder(density=1000, length=0.1, outerRadius=0.2, axis=1)
    return mbs.CreateRigidBody(inertia=inertia, nodeType=exu.NodeType.RotationEulerParameters, show=False)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"bodyNumbers": []}, "at least one wheel in bodyNumbers"),
        ({"bodyNumbers": 0}, "must be a list, also of a single wheel"),
        ({"surface": None}, "takes a surface"),
        ({"surface": "plane"}, "surface is 'plane'; a rolling joint takes a surface"),
        ({"surface": Plane}, "takes a surface of velodrome.reference.surface, such as Plane()"),
        ({"discRadius": 0.0}, "radius is a positive number"),
        ({"discRadius": "0.2 m"}, "radius is a positive number"),
        ({"discRadius": [0.2, 0.2, 0.2]}, "one radius for all wheels, or one for each of 2"),
        ({"discRadius": [0.2, np.nan]}, "radius"),
        ({"axisVector": [0, 0, 0]}, "not all zero"),
        ({"newmarkRatio": 0.0}, "about 0.5"),
    ],
)
def test_wrong_arguments_are_refused(change, complaint) -> None:
    container: Any = exu.SystemContainer()
    mbs = container.AddSystem()
    arguments = {"bodyNumbers": [body(mbs), body(mbs)], "discRadius": 0.2, "surface": Plane()} | change
    with pytest.raises(ValueError, match=complaint):
        CreateRollingJointOnSurface(mbs, **arguments)


def test_wrong_sensors_are_refused() -> None:
    container: Any = exu.SystemContainer()
    mbs = container.AddSystem()
    joint = CreateRollingJointOnSurface(mbs, bodyNumbers=[body(mbs)], discRadius=0.2, surface=Paraboloid(0.1))
    with pytest.raises(ValueError, match="'Temperature'; there are ContactPoint"):
        CreateRollingJointSensor(mbs, joint, "Temperature")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="no wheel 1"):
        CreateRollingJointSensor(mbs, joint, "Gap", wheel=1)
