"""What releases of MuJoCo lack, and what the models do there instead.

The flag ``autoreset`` came with MuJoCo 3.2.1, `mj_jacDot` with 3.2.3, the description of its own structures in the
Python package and energies without a flag with 3.3.0, the rows of the inertia matrix in the model with 3.3.6. The
meaning of a pair's margin and gap changed with 3.9.0, and so did the structure that collision functions fill.
"""

from __future__ import annotations

from ..releases import Adaptation, LibraryReach

# Values of settings that older releases do not know.
_VALUES = {("integrator", "discrete"): "3.13.0"}
RESET = Adaptation(
    name="autoreset",
    since="3.2.1",
    how="left_out",
    text="the flag that keeps MuJoCo from resetting a state that became infinite; the ride ends there all the same",
)
RESIDUAL = Adaptation(
    name="solver_residual",
    since="3.2.3",
    how="left_out",
    text="the residual of the contact solver, and the count of steps that did not converge: both are not known",
)
INERTIA = Adaptation(
    name="inertia",
    since="3.3.6",
    how="replaced",
    text="the inertia matrix, which the residual of the contact solver needs, is read in MuJoCo's older form",
    first="3.2.3",
)
ENERGY = Adaptation(
    name="energy",
    since="3.3.0",
    how="replaced",
    text="the flag energy is set, without which MuJoCo's functions of the energies do nothing",
)
GAP = Adaptation(
    name="gap",
    since="3.9.0",
    how="replaced",
    text="a contact pair's margin contains its gap, as it did before MuJoCo 3.9",
)
CONTACT_FORM = Adaptation(
    name="contact",
    since="3.9.0",
    how="replaced",
    text="contacts are given to MuJoCo as mjContact, whose first fields are those of mjPreContact",
)
# Before, it lacked the motion of the point to which the Jacobian belongs: nothing where wheels roll, but much where
# they slide. The description of the structures, mujoco.introspect, came one release earlier.
_RATE = "mj_jacDot with all its terms"

PLANES = LibraryReach(
    "mujoco",
    "MuJoCo",
    oldest="3.0.0",
    needs="contacts that hold both geoms in one array",
    adaptations=(RESET, RESIDUAL, INERTIA, ENERGY),
    values=_VALUES,
)
EDGES = LibraryReach(
    "mujoco", "MuJoCo", oldest="3.3.1", needs=_RATE, adaptations=(INERTIA, GAP, CONTACT_FORM), values=_VALUES
)
ROLLING = LibraryReach("mujoco", "MuJoCo", oldest="3.3.1", needs=_RATE, values=_VALUES)


def is_present(adaptation: Adaptation) -> bool:
    """Return whether the installed release has what an adaptation stands in for."""
    return PLANES.has(adaptation.since)
