"""Wrong contact forces of Exudyn at any step, and their cures: `python examples/exudyn_contact_forces.py`.

Plain Exudyn and numpy. The script shows two defects, each on a model whose forces are known exactly.

Initial accelerations. A constraint on velocities, W(q) q' = 0, has W q'' = -(W q')_q q'. The solver puts 0 on
the right (CSolverImplicitSecondOrderTimeInt::InitializeSolverInitialConditions; NumericalConstraintJacobian-
TimesVector omits objects on velocity level). A disc in steady precession on the level plane rolls on
ObjectJointRollingDisc: its first contact force is wrong. The trapezoidal rule with index 2 keeps
this error: its forces alternate about the right ones with the initial error, at any step. Generalized alpha with a
spectral radius below 1 loses it within some steps. Right accelerations, imported by SetODE2Coordinates_tt
with computeInitialAccelerations=False, cure both.

First steps. Generalized alpha with constraints on positions needs start values a_0 = q''(D h), D = alpha_m -
alpha_f, and velocities shifted by O(h^2) off the constraints, to have second order in the multipliers from the
first step (Arnold, Bruels, Cardona 2015). The solver starts from a_0 = q''(0) and the given velocities. A
pendulum's reaction is then wrong by O(h) until the spectral radius has damped that out.
"""

from __future__ import annotations

import math
from importlib.metadata import version
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorObject
from exudyn.rigidBodyUtilities import InertiaCylinder

GRAVITY, RADIUS, LEAN, DISTANCE = 9.81, 0.3, 0.5, 2.0
DISC: Any = InertiaCylinder(density=2700, length=0.02, outerRadius=RADIUS, axis=1)
SOLVERS: Any = exu.DynamicSolverType


def new_system() -> tuple[Any, Any]:
    """Return a container, which must be kept alive, and its system."""
    container: Any = exu.SystemContainer()
    return container, container.AddSystem()


def precession() -> tuple[float, float, np.ndarray]:
    """Return the rates of the circle and of the spin, and the constant force (lateral, forward, normal) on the disc.

    The disc's contact runs on a circle of radius r at the rate W, and its plane leans to the centre by L. The moments
    about its centre require W^2 cos L ((I - J) sin L + J r / a + m a (r - a sin L)) = m g a sin L.
    """
    across, axial = DISC.InertiaCOM()[0, 0], DISC.InertiaCOM()[1, 1]
    circle = DISTANCE - RADIUS * math.sin(LEAN)
    resistance = (across - axial) * math.sin(LEAN) + axial * DISTANCE / RADIUS + DISC.Mass() * RADIUS * circle
    rate = math.sqrt(DISC.Mass() * GRAVITY * RADIUS * math.tan(LEAN) / resistance)
    force = DISC.Mass() * np.array([rate**2 * circle, 0.0, GRAVITY])
    return rate, rate * DISTANCE / RADIUS, force


def disc_force(
    solver: Any, step: float, duration: float, spectral_radius: float = 1.0, right_start: bool = False
) -> np.ndarray:
    """Return the relative error of the contact force in every step, including the start."""
    _container, mbs = new_system()
    rate, spin, force = precession()
    up, left = (
        np.array([-math.sin(LEAN), 0, math.cos(LEAN)]),
        np.array([-math.cos(LEAN), 0, -math.sin(LEAN)]),
    )
    forward, vertical = np.array([0.0, 1, 0]), np.array([0.0, 0, 1])
    omega = rate * vertical + spin * left
    disc = mbs.CreateRigidBody(
        inertia=DISC,
        referencePosition=DISTANCE * np.array([1.0, 0, 0]) + RADIUS * up,
        referenceRotationMatrix=np.column_stack([forward, left, up]),
        initialVelocity=np.cross(omega, RADIUS * up),
        initialAngularVelocity=omega,
        gravity=[0, 0, -GRAVITY],
        nodeType=exu.NodeType.RotationEulerParameters,
        show=False,
    )
    joint = mbs.CreateRollingDisc(
        bodyNumbers=[mbs.CreateGround(), disc],
        axisPosition=[0, 0, 0],
        axisVector=[0, 1, 0],
        discRadius=RADIUS,
        show=False,
    )
    sensor = watch(mbs, joint, exu.OutputVariableType.ForceLocal)
    mbs.Assemble()
    settings = simulation_settings(step, duration, spectral_radius)
    if right_start:
        circle = DISTANCE - RADIUS * math.sin(LEAN)
        linear, angular = np.array([-(rate**2) * circle, 0, 0]), np.cross(rate * vertical, spin * left)
        import_accelerations(mbs, settings, linear, omega, angular)
    mbs.SolveDynamic(settings, solverType=solver)
    found = mbs.GetSensorStoredData(sensor)[:, 1:]
    return np.linalg.norm(found - force, axis=1) / np.linalg.norm(force)


def import_accelerations(mbs: Any, settings: Any, linear: np.ndarray, omega: np.ndarray, angular: np.ndarray) -> None:
    """Set one body's initial accelerations: theta' = 1/2 omega theta as quaternions, differentiated once more."""
    theta = mbs.systemData.GetODE2CoordinatesTotal()[3:]
    rates = product(0.5 * omega, theta)
    second = product(0.5 * angular, theta) + product(0.5 * omega, rates)
    mbs.systemData.SetODE2Coordinates_tt([*linear, *second], exu.ConfigurationType.Initial)
    settings.timeIntegration.generalizedAlpha.computeInitialAccelerations = False


def product(vector: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Return the quaternion product of (0, vector) and theta."""
    return np.array([-vector @ theta[1:], *(theta[0] * vector + np.cross(vector, theta[1:]))])


def pendulum_force(step: float, duration: float, spectral_radius: float) -> np.ndarray:
    """Return the relative error of a swinging bar's reaction in every step, including the start."""
    _container, mbs = new_system()
    length, angle, rate = 0.5, 0.3, 8.0
    bar: Any = InertiaCylinder(density=1000, length=0.1, outerRadius=0.1, axis=1)
    arm = length * np.array([math.sin(angle), 0, -math.cos(angle)])
    omega = np.array([0, -rate, 0])
    body = mbs.CreateRigidBody(
        inertia=bar,
        referencePosition=arm,
        initialVelocity=np.cross(omega, arm),
        initialAngularVelocity=omega,
        gravity=[0, 0, -GRAVITY],
        nodeType=exu.NodeType.RotationEulerParameters,
        show=False,
    )
    joint = mbs.CreateSphericalJoint(itemNumbers=[mbs.CreateGround(), body], position=[0, 0, 0], show=False)
    sensor = watch(mbs, joint, exu.OutputVariableType.Force)
    mbs.Assemble()
    mbs.SolveDynamic(simulation_settings(step, duration, spectral_radius))
    found = np.linalg.norm(mbs.GetSensorStoredData(sensor)[:, 1:], axis=1)
    exact = swing(bar, length, angle, rate, step, len(found))
    return np.abs(found - exact) / exact.max()


def swing(bar: Any, length: float, angle: float, rate: float, step: float, count: int) -> np.ndarray:
    """Return the reaction at ``count`` times: J angle'' = -m g l sin(angle), by Runge-Kutta's method."""
    mass = bar.Mass()
    pull = mass * GRAVITY * length / (bar.InertiaCOM()[1, 1] + mass * length**2)

    def slope(state: np.ndarray) -> np.ndarray:
        return np.array([state[1], -pull * math.sin(state[0])])

    state, force = np.array([angle, rate]), np.empty(count)
    for i in range(count):
        radial = mass * (length * state[1] ** 2 + GRAVITY * math.cos(state[0]))
        across = mass * (length * slope(state)[1] + GRAVITY * math.sin(state[0]))
        force[i] = math.hypot(radial, across)
        for _ in range(4):  # four substeps: an error of (k h / 4)^4 is negligible here
            h = step / 4
            k1 = slope(state)
            k2 = slope(state + h / 2 * k1)
            k3 = slope(state + h / 2 * k2)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(state + h * k3))
    return force


def watch(mbs: Any, item: Any, kind: Any) -> Any:
    """Add a sensor of an object."""
    return mbs.AddSensor(
        SensorObject(objectNumber=item, outputVariableType=kind, storeInternal=True, writeToFile=False)
    )


def simulation_settings(step: float, duration: float, spectral_radius: float) -> Any:
    """Return settings with fixed steps, each of them sampled, and Newton's method to 1e-10."""
    settings: Any = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = step
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.numberOfSteps = round(duration / step)
    settings.timeIntegration.endTime = duration
    settings.timeIntegration.generalizedAlpha.spectralRadius = spectral_radius
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    return settings


def main() -> None:
    """Print both defects and their cures."""
    print(f"Exudyn {version('exudyn')}")
    _, _, force = precession()
    print(f"disc in steady precession: its contact force is {np.linalg.norm(force):.1f} N, all the time")
    print(f"{'relative error of the contact force':44} {'step':>7} {'first':>9} {'at 0.1 s':>9} {'at 1 s':>9}")
    for name, solver, radius, right in (
        ("trapezoidal rule, index 2", SOLVERS.TrapezoidalIndex2, 1.0, False),
        ("generalized alpha, spectral radius 0.8", SOLVERS.GeneralizedAlpha, 0.8, False),
        ("trapezoidal rule, imported accelerations", SOLVERS.TrapezoidalIndex2, 1.0, True),
    ):
        for step in (4e-3, 1e-3):
            error = disc_force(solver, step, 1.0, radius, right)
            late = error[round(0.1 / step)], error[-2:].max()
            first = "-" if right else f"{error[0]:9.1e}"  # imported accelerations come without multipliers
            print(f"{name:44} {step:7g} {first:>9} {late[0]:9.1e} {late[1]:9.1e}")
    print("pendulum: largest relative error of the reaction in the first ten steps, and after 1 s")
    for radius in (0.9, 0.6):
        for step in (4e-3, 2e-3, 1e-3):
            error = pendulum_force(step, 1.0, radius)
            print(f"spectral radius {radius}, step {step:g}: {error[:11].max():.1e} {error[-2:].max():.1e}")


if __name__ == "__main__":
    main()
