"""Accelerations of the bicycle by `pinocchio.constraintDynamics`, with contacts that move with the wheels.

Each wheel has a 3D contact between its rim point and the ground, which constrains the acceleration of the material
point that is there. A wheel that rolls brings other points to the ground, with the velocity u of the contact along the
rim. Rolling without slip for more than an instant, v = c' + w x d = 0 with d' = w x d + u, therefore requires

    c'' + w' x d + w x (w x d) = -w x u

The left side is the acceleration of the material point, which a contact without further data keeps at zero. The right
side has to be given to Pinocchio. `RigidConstraintModel.desired_contact_acceleration` is meant for it, but
`constraintDynamics` of Pinocchio 4.1 does not read it: it reads ``RigidConstraintData.contact_acceleration_desired``.
"""

# pinocchio is an optional library whose compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ...reference.bicycle import BODIES
from ..engine import Problem
from .contacts import MovingContacts
from .settings import ConstraintSettings
from .tree import JOINTS, REAR_RATE, STEER_RATE, build_pinocchio_model

WHEEL_JOINTS = [JOINTS[BODIES.index(name)] for name in ("rear_wheel", "front_wheel")]
_INERTIAL = pin.LOCAL_WORLD_ALIGNED


class NoAccelerationError(Exception):
    """Raised with the reason where a state has no accelerations."""


class ConstrainedBicycle:
    """The bicycle's tree and its two contacts.

    Parameters
    ----------
    problem : Problem
    settings : ConstraintSettings

    Attributes
    ----------
    model, data : pinocchio.Model, pinocchio.Data
    contacts : MovingContacts
        Those of the last evaluation.
    force : ndarray, shape (2, 3)
        Contact forces on the wheels of the last evaluation, inertial axes [N].
    residual : float
        Change of the forces in the solver's last iteration of the last evaluation [N]; their error is smaller.
    converged : bool
        Whether it met the accuracy.
    """

    def __init__(self, problem: Problem, settings: ConstraintSettings) -> None:
        self.model = build_pinocchio_model(problem.bicycle)
        self.data = self.model.createData()
        self.contacts = MovingContacts(problem)
        self.force = np.zeros((2, 3))
        self.residual, self.converged = 0.0, True
        self._inputs = problem.inputs
        self._torque = np.zeros(self.model.nv)
        self._models = pin.StdVec_RigidConstraintModel()
        self._datas = pin.StdVec_RigidConstraintData()
        corrector = pin.BaumgarteCorrectorParameters(settings.baumgarte_kp, settings.baumgarte_kd)
        for joint in WHEEL_JOINTS:
            contact = pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, self.model, joint, _INERTIAL)
            contact.m_baumgarte_parameters = corrector
            self._models.append(contact)
            self._datas.append(contact.createData())
        pin.initConstraintDynamics(self.model, self.data, self._models, self._datas)
        # The absolute residual of Pinocchio 4.1 lacks the free acceleration and is some 10 m/s^2 at the exact solution.
        self._solver = pin.ProximalSettings(0.0, settings.accuracy, settings.regularisation, settings.iterations)

    def observe_contacts(self, configuration: np.ndarray, velocity: np.ndarray) -> None:
        """Compute the contacts at a state: configuration (10,) and velocity (9,).

        Raises
        ------
        NoAccelerationError
            If a wheel has none.
        """
        pin.forwardKinematics(self.model, self.data, configuration, velocity)
        contacts = self.contacts
        for k, joint in enumerate(WHEEL_JOINTS):
            place = self.data.oMi[joint]
            motion = pin.getVelocity(self.model, self.data, joint, _INERTIAL)
            contacts.centre[k], contacts.axle[k] = place.translation, place.rotation[:, 1]
            contacts.velocity[k], contacts.spin[k] = motion.linear, motion.angular
        if not contacts.update():
            raise NoAccelerationError("a wheel lies flat or has no contact point with the surface")

    def accelerate(self, configuration: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the derivative (9,) of the velocity at a state, and keep forces and residual of the solver.

        Raises
        ------
        NoAccelerationError
            If a wheel has no contact point, or the solver's result is not finite.
        """
        self.observe_contacts(configuration, velocity)
        contacts = self.contacts
        for k, joint in enumerate(WHEEL_JOINTS):
            contact, place = self._models[k], self.data.oMi[joint]
            # With axes parallel to the inertial ones, forces and accelerations have inertial components.
            turned = place.rotation.T
            contact.joint1_placement = pin.SE3(turned, turned @ (contacts.point[k] - contacts.centre[k]))
            contact.joint2_placement = pin.SE3(np.eye(3), contacts.foot[k])
            self._datas[k].contact_acceleration_desired = pin.Motion(contacts.acceleration[k], np.zeros(3))
        self._torque[STEER_RATE] = self._inputs.steer_torque - self._inputs.steer_damping * velocity[STEER_RATE]
        self._torque[REAR_RATE] = self._inputs.rear_wheel_torque
        rates = pin.constraintDynamics(
            self.model, self.data, configuration, velocity, self._torque, self._models, self._datas, self._solver
        )
        if not np.all(np.isfinite(rates)):
            raise NoAccelerationError("Pinocchio's accelerations became infinite")
        for k in range(2):
            self.force[k] = self._datas[k].contact_force.linear
        self.residual = self._solver.relative_residual  # relative to the iteration before, in newtons
        self.converged = self.residual <= self._solver.relative_accuracy
        return rates.copy()
