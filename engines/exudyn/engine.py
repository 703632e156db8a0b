"""Engines in Exudyn: rigid bodies and revolute joints of the library, with different ways to roll on the ground.

`exudyn` rolls by true constraints, `exudyn-plane-normal` by the library's rolling disc with a plane that follows
the contact, `exudyn-builtin` by that disc without changes, on the level plane only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...reference.inputs import NO_INPUTS
from ...reference.kinematics import quaternions
from ...reference.simulate import steps_per_output
from ...reference.surface import is_level
from ..engine import EngineError, Problem, Progress, Trajectory, UnsuitableProblem
from ..releases import LibraryReach
from .releases import DISCS, INPUTS, JOINT
from .settings import ExudynSettings, SolverSettings

if TYPE_CHECKING:
    from .model import Model
    from .solve import Integration, IntegrationOutcome
    from .wheels import PutOnGround


@dataclass(frozen=True)
class ExudynEngine:
    """An engine in Exudyn; the library is imported when a problem is run.

    Attributes
    ----------
    name : str
    settings : type
        Model of the engine's settings.
    description : str
        The engine in one line.
    put_on_ground : callable
        Imports and returns the function that puts the wheels on the ground.
    reach : LibraryReach
        The releases of Exudyn with which it rides.
    level_only : bool
        Whether it rolls on the level plane only.
    """

    name: str
    settings: type[SolverSettings]
    description: str
    put_on_ground: Callable[[], PutOnGround]
    reach: LibraryReach
    level_only: bool = False
    takes_inputs = True
    packages = ("exudyn",)
    settings_source = (
        "the suite's own choice: Exudyn's generalized alpha at 1 ms with a spectral radius of 0.8, and tolerances of "
        "Newton's method that leave no visible error; the settings' descriptions give the reasons"
    )
    gives = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")

    @property
    def version(self) -> str:
        """Version of the library."""
        return self.reach.version

    def check(self, problem: Problem, settings: SolverSettings) -> None:
        """Refuse releases of Exudyn without what is needed, unsuitable ground and output times; see `Engine.check`.

        The step must divide the interval of the output times.
        """
        refusal = self.reach.find_refusal(self.name, settings)
        if refusal is None and problem.inputs != NO_INPUTS and not self.reach.has(INPUTS):
            refusal = self.reach.name_need("a ride with inputs", INPUTS, "CreateTorsionalSpringDamper")
        if refusal is not None:
            raise UnsuitableProblem(refusal)
        if self.level_only and not is_level(problem.surface):
            raise UnsuitableProblem("it rolls on the level plane only; exudyn rides on any surface")
        steps_per_output(problem.times, settings.step)

    def step_noise(self, settings: SolverSettings) -> float:
        """Return what Newton's method may leave unconverged in a step; see `velodrome.engines.engine.Engine`.

        Its residual decreases by the tolerance from the bodies' weights, which are about 1 kN. The remaining error is
        the tolerance times the forces, and as many metres of gap, and of slip in a step, on a motion of some metres.
        """
        return settings.newton_relative_tolerance

    def simulate(self, problem: Problem, settings: SolverSettings, progress: Progress) -> Trajectory:
        """Run a problem; see `velodrome.engines.engine.Engine.simulate`.

        Raises
        ------
        UnsuitableProblem
            If the ground is unsuitable for the engine.
        ValueError
            If the output times are not a uniform grid from 0, or the step does not divide its interval.
        EngineError
            If the engine does not accept the initial state.
        """
        from .model import build_model
        from .solve import integrate, no_progress
        from .watch import make_looks

        self.check(problem, settings)
        with no_progress():
            model = build_model(problem, settings, self.put_on_ground())
            look = make_looks(model, problem)
            outcome = integrate(model.system, _make_integration(problem, settings, model), progress, look)
        trajectory = self._trajectory(problem, settings, model, outcome)
        ending = outcome.ending
        return trajectory if ending is None else replace(trajectory.until(ending.time), fall=ending.fall)

    def _trajectory(
        self, problem: Problem, settings: SolverSettings, model: Model, outcome: IntegrationOutcome
    ) -> Trajectory:
        from .model import read_motion
        from .results import measure_contacts, read_coordinates, read_energies, weights

        motion = read_motion(model)
        contacts = measure_contacts(problem, model, motion)
        if not np.all(np.isfinite(contacts.gap[0])):
            raise EngineError(f"{self.name} could not start: a wheel has no contact point")
        q, qd = read_coordinates(problem, motion)
        kinetic, potential = read_energies(problem.bicycle, motion)
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(mode="json") | self.reach.list_adaptations(),
            time=motion.time,
            q=q,
            qd=qd,
            body_position=motion.position,
            body_quaternion=quaternions(motion.rotation),
            contact_point=contacts.point,
            contact_force=contacts.force,
            gap=contacts.gap,
            slip=contacts.slip,
            kinetic_energy=kinetic,
            potential_energy=potential,
            steps=outcome.steps,
            cpu_time=outcome.cpu_time,
            ended=outcome.ended,
            unconverged_steps=outcome.unconverged_steps,
            largest_residual=outcome.largest_residual / float(np.linalg.norm(weights(problem.bicycle))),
        )


def _make_integration(problem: Problem, settings: SolverSettings, model: Model) -> Integration:
    from .solve import Integration

    intervals = len(problem.times) - 1
    corrected = (
        isinstance(settings, ExudynSettings)
        and settings.start == "second-order"
        and settings.solver == "generalized-alpha"
    )
    return Integration(
        end=float(problem.times[-1]),
        steps=intervals * steps_per_output(problem.times, settings.step),
        samples=intervals,
        settings=settings,
        slip_equations=model.rolling.slip_equations(model.system) if corrected else None,
    )


def _import_constrain() -> PutOnGround:
    from .wheels import constrain

    return constrain


def _import_roll_discs_on_tangents() -> PutOnGround:
    from .wheels import roll_discs_on_tangents

    return roll_discs_on_tangents


def _import_roll_discs() -> PutOnGround:
    from .wheels import roll_discs

    return roll_discs


ENGINE = ExudynEngine(
    "exudyn", ExudynSettings, "Exudyn with true knife-edge rolling joints on any surface", _import_constrain, JOINT
)
PLANE_NORMAL = ExudynEngine(
    "exudyn-plane-normal",
    SolverSettings,
    "Exudyn with its own rolling discs on moving tangent planes",
    _import_roll_discs_on_tangents,
    DISCS,
)
BUILTIN = ExudynEngine(
    "exudyn-builtin",
    SolverSettings,
    "Exudyn with its own rolling discs on the level plane, as it is",
    _import_roll_discs,
    DISCS,
    level_only=True,
)
