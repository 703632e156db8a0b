"""The exact forces of rolling as a system of Drake's, connected to the plant that they act on.

With M and h the plant's mass matrix and bias, J the Jacobian of the wheels' material points at the contacts and b the
contacts' own acceleration beside J' v, the forces F of rolling without slip solve

    M v' + h = Q + J^T F,      J v' + b + s^2 gap n + 2 s J v = 0

in every evaluation of the plant's derivatives. The rate s brings gaps and slip that the integrator leaves back to zero.
"""

# Drake is not among the suite's own dependencies.
# pyright: reportMissingImports=false

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import LeafSystem

from ...reference.kinematics import STEER
from ..engine import EngineError, Problem
from .contacts import WheelContactFinder
from .tree import DrakeTree, input_torques, read_wheel_motions


class RollingForces(LeafSystem):
    """A system from the plant's state to the generalised forces of rolling, with the problem's inputs.

    Parameters
    ----------
    tree : DrakeTree
        Its plant is finalised.
    problem : Problem
    stabilisation : float
        Rate s [1/s].

    Attributes
    ----------
    force : ndarray, shape (2, 3)
        Contact forces on the wheels of the last evaluation, inertial axes [N].
    """

    def __init__(self, tree: DrakeTree, problem: Problem, stabilisation: float) -> None:
        super().__init__()
        self._tree, self._rate = tree, stabilisation
        self._context = tree.plant.CreateDefaultContext()
        self._finder = WheelContactFinder(problem.bicycle, problem.surface)
        self._torques, self._damping = input_torques(tree, problem.inputs), problem.inputs.steer_damping
        self._steer = tree.hinges[STEER].velocity_start()
        self.force = np.zeros((2, 3))
        plant = tree.plant
        self.state_port = self.DeclareVectorInputPort("state", plant.num_multibody_states())
        self.force_port = self.DeclareVectorOutputPort(
            "generalized_force", plant.num_velocities(), self._evaluate_output, {self.all_input_ports_ticket()}
        )

    def _evaluate_output(self, context: Any, output: Any) -> None:
        output.SetFromVector(self.solve(self.state_port.Eval(context)))

    def solve(self, state: np.ndarray) -> np.ndarray:
        """Solve for the contact forces at a state (nq + nv,); return all generalised forces (nv,).

        Raises
        ------
        EngineError
            If a wheel lies flat or has no contact, or the forces are not determined.
        """
        plant, context, finder = self._tree.plant, self._context, self._finder
        plant.SetPositionsAndVelocities(context, state)
        read_wheel_motions(self._tree, context, finder.motion)
        finder.find()
        applied = self._torques.copy()
        applied[self._steer] -= self._damping * plant.GetVelocities(context)[self._steer]
        smooth = applied + plant.CalcGravityGeneralizedForces(context) - plant.CalcBiasTerm(context)
        rows, rest = self._constrain()
        try:
            moved = np.linalg.solve(plant.CalcMassMatrix(context), np.column_stack([rows.T, smooth]))
            force = np.linalg.solve(rows @ moved[:, :-1], -rest - rows @ moved[:, -1])
        except np.linalg.LinAlgError as error:
            raise EngineError("the rolling constraints are singular") from error
        self.force[:] = force.reshape(2, 3)
        return applied + rows.T @ force

    def _constrain(self) -> tuple[np.ndarray, np.ndarray]:
        """Return J (6, nv) and what J v' is to balance (6,) at the context's state."""
        plant, context, finder = self._tree.plant, self._context, self._finder
        world, speeds = plant.world_frame(), JacobianWrtVariable.kV
        rows, rest = [], []
        arms = finder.point - finder.motion.position
        for k, wheel in enumerate(self._tree.wheels):
            at = (speeds, wheel.body_frame(), np.zeros(3), world, world)
            jacobian = plant.CalcJacobianSpatialVelocity(context, *at)
            bias = plant.CalcBiasSpatialAcceleration(context, *at)
            across = _cross_matrix(arms[k])
            # The point moves with c' + w x d, and its acceleration is c'' + w' x d + b.
            rows.append(jacobian[3:] - across @ jacobian[:3])
            rest.append(bias.translational() - across @ bias.rotational())
        drift = finder.acceleration + self._rate**2 * finder.gap[:, None] * finder.frames[:, 2]
        drift += 2 * self._rate * finder.velocity
        return np.concatenate(rows), np.concatenate(rest) + drift.reshape(6)


def _cross_matrix(d: np.ndarray) -> np.ndarray:
    """Return the matrix of the product d x (...)."""
    return np.array([[0.0, -d[2], d[1]], [d[2], 0.0, -d[0]], [-d[1], d[0], 0.0]])
