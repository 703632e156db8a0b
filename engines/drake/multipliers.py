"""Build Drake's tree and integrator under the exact forces of rolling."""

# Drake is not among the suite's own dependencies.
# pyright: reportMissingImports=false

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder

from ..engine import Problem
from .ride import DrakeRig
from .rolling_forces import RollingForces
from .settings import DrakeMultiplierSettings
from .tree import add_bicycle_tree, set_plant_state


def build_rolling_plant(problem: Problem, settings: DrakeMultiplierSettings) -> DrakeRig:
    """Build a plant with continuous dynamics, driven by the forces of rolling, at the start of a problem.

    Raises
    ------
    EngineError
        If Drake refuses the bicycle.
    """
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    tree = add_bicycle_tree(plant, problem.bicycle)
    plant.Finalize()
    rolling = builder.AddSystem(RollingForces(tree, problem, settings.stabilisation))
    builder.Connect(plant.get_state_output_port(), rolling.state_port)
    builder.Connect(rolling.force_port, plant.get_applied_generalized_force_input_port())
    simulator = Simulator(builder.Build())
    # A ride asks for the end of one step at a time, which bounds the step. With the step itself as the largest one,
    # Drake takes two steps wherever the difference of two such times is longer by a rounding.
    ResetIntegratorFromFlags(simulator, settings.integrator, 1.5 * settings.step).set_fixed_step_mode(True)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    set_plant_state(tree, context, problem.bicycle, problem.q, problem.qd)

    def forces() -> np.ndarray:
        rolling.solve(plant.GetPositionsAndVelocities(context))
        return rolling.force

    # The forces search the contacts themselves, in every evaluation.
    return DrakeRig(simulator, tree, context, follow=lambda steps: None, forces=forces)
