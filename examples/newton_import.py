"""What Newton's importer makes of the bicycle for MuJoCo: `python examples/newton_import.py`.

Needs velodrome, newton and mujoco-warp. Newton's MuJoCo solver rides what the importer hands it, so that a difference
between Newton and MuJoCo may be the model's before it is the solver's. The script imports the plane model of
`mujoco-native`, compares every array and option of the two compiled models, and says what is equal up to single
precision, which Newton stores, and what is not, with what it means for a ride.
"""

# Newton is an optional library; MuJoCo's compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import mujoco
import newton
import numpy as np
import warp

from velodrome.engines.mujoco.model import mjcf
from velodrome.engines.mujoco.native import ENGINE
from velodrome.reference.bicycle import Bicycle

# What is computed from rounded numbers, by the condition of the mass matrix, relative to the largest of its array.
ROUNDING = 100 * 2.0**-24
# Book-keeping, colours and sizes of memory: nothing that moves.
_ASIDE = ("name", "nnames", "narena", "nbuffer", "geom_rgba", "signature", "stat", "text", "vis")
# No number is what the importer would take if it read nothing.
GRAVITY, STEER_DAMPING = 9.7, 0.3  # [m/s^2], [N m s/rad]
SETTINGS: dict[str, Any] = {
    "step": 0.001,
    "integrator": "implicit",
    "impratio": 7.0,
    "friction": 1.7,
    "tolerance": 1e-9,
    "damping_ratio": 1.2,
    "impedance": (0.8, 0.97, 0.002, 0.4, 3.0),
}
# What differences mean for the bicycle. Every other difference is unexpected.
_NOTHING = "changes no ride"
MEANINGS = {
    "pair_solreffriction": "friction rows of 0.02 s whatever solref says: with the time constant of mujoco-native, "
    "0.004 s, five times the creep (examples/defects/newton_solreffriction.py)",
    "opt.gravity": "the file's gravity is not read: every ride is one at 9.81 m/s^2, without a message",
    "opt.timestep": "the file's step is not read; Newton takes the one with which a step is asked for",
    "opt.disableflags": "autoreset is no longer disabled: in C a ride that fails starts again; multiccd is disabled, "
    "which changes no ride",
    "geom_gap": f"of geoms that touch in pairs alone, which have a gap of their own: {_NOTHING}",
    "body_margin": f"a bound for the search for contacts, from the gaps: {_NOTHING}",
    "geom_size": f"the size at which the boundless plane is drawn: {_NOTHING}",
    "jnt_range": f"bounds of hinges that have no limit: {_NOTHING}",
    "jnt_actfrclimited": f"whether motors on a joint have a bound; there are none: {_NOTHING}",
    "jnt_actfrcrange": f"their bounds: {_NOTHING}",
    "eq_active0": f"a constraint between world and frame that is not active: {_NOTHING}",
    "nexclude": f"pairs of bodies whose geoms would not touch anyway: {_NOTHING}",
}

# Those of the equal ones that are named, since a ride hangs on them.
_TOLD = (
    *("body_mass", "body_ipos", "body_pos", "body tensor", "dof_armature", "dof_damping", "dof_frictionloss"),
    *("jnt_axis", "jnt_pos", "qpos0", "pair_dim", "pair_friction", "pair_gap", "pair_margin", "pair_solimp"),
    *("pair_solref", "opt.cone", "opt.impratio", "opt.integrator", "opt.tolerance"),
)


@dataclass(frozen=True)
class ImportedQuantity:
    """A quantity that the import has changed by more than rounding.

    Attributes
    ----------
    name : str
    before, after : ndarray
        In MuJoCo's own compilation, and in the import.
    meaning : str
        For a ride; empty where nobody has looked at it yet.
    """

    name: str
    before: np.ndarray
    after: np.ndarray
    meaning: str


def import_bicycle(text: str) -> mujoco.MjModel:
    """Return the model that Newton's solver for MuJoCo makes of an MJCF text."""
    warp.config.log_level = warp.LOG_ERROR
    with warnings.catch_warnings():
        # It says that it does not know the flag autoreset, and which versions of MuJoCo it was made for.
        warnings.simplefilter("ignore")
        builder = newton.ModelBuilder(up_axis=newton.Axis.Z)
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        builder.add_mjcf(text)
        return newton.solvers.SolverMuJoCo(builder.finalize(device="cpu"), use_mujoco_cpu=True).mj_model


def list_quantities(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """Return the arrays and numbers of a model by name, with whole inertia tensors and names without their paths."""
    found = {}
    for holder, prefix in ((model, ""), (model.opt, "opt.")):
        for name in dir(holder):
            value: Any = getattr(holder, name)
            if not name.startswith(("_", *_ASIDE)) and isinstance(value, int | float | np.ndarray):
                found[prefix + name] = np.asarray(value, dtype=float)
    # Principal axes may be listed in any order.
    turned = np.empty((model.nbody, 9))
    for body in range(model.nbody):
        mujoco.mju_quat2Mat(turned[body], model.body_iquat[body])
    axes = turned.reshape(-1, 3, 3)
    found["body tensor"] = np.einsum("bij,bj,bkj->bik", axes, model.body_inertia, axes)
    return {name: value for name, value in found.items() if name not in ("body_inertia", "body_iquat")}


def compare_models(before: mujoco.MjModel, after: mujoco.MjModel) -> tuple[list[str], list[ImportedQuantity]]:
    """Return the names of the quantities that are equal up to rounding, and those that are not."""
    old, new = list_quantities(before), list_quantities(after)
    equal, changed = [], []
    for name in sorted(old):
        one, other = old[name], new[name]
        same = one.shape == other.shape and np.allclose(
            one, other, rtol=0, atol=ROUNDING * max(float(np.abs(one).max(initial=0.0)), 1e-300)
        )
        if same:
            equal.append(name)
        else:
            changed.append(ImportedQuantity(name, one, other, _find_meaning(name)))
    return equal, changed


def _find_meaning(name: str) -> str:
    family = {"eq": "eq_active0", "neq": "eq_active0", "nemax": "eq_active0", "exclude_signature": "nexclude"}
    return MEANINGS.get(family.get(name.split("_")[0], family.get(name, name)), "")


def measure_bicycle() -> tuple[list[str], list[ImportedQuantity]]:
    """Compare the import of the plane model of `mujoco-native` with MuJoCo's own compilation."""
    text = mjcf(Bicycle(gravity=GRAVITY), ENGINE.settings(**SETTINGS), "plane", STEER_DAMPING)
    return compare_models(mujoco.MjModel.from_xml_string(text), import_bicycle(text))


def _format_values(values: np.ndarray) -> str:
    flat = [f"{value:.7g}" for value in np.unique(values)]
    return " ".join(flat[:6]) + (" ..." if len(flat) > 6 else "") if flat else "none"


def main() -> None:
    """Print both lists."""
    equal, changed = measure_bicycle()
    print(f"Newton {newton.__version__}, MuJoCo {mujoco.__version__}: the plane model of mujoco-native")
    print(f"equal up to single precision: {len(equal)} quantities, among them")
    print("  " + ", ".join(name for name in equal if name in _TOLD))
    print("changed:")
    for quantity in changed:
        values = f"{_format_values(quantity.before)} -> {_format_values(quantity.after)}"
        print(f"  {quantity.name:20} {values}\n  {'':20} {quantity.meaning or 'unexpected: look at it'}")


if __name__ == "__main__":
    main()
