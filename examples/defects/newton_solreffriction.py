"""Contact pairs that Newton 1.8 imports from MJCF with softer friction, on a ball that is held by friction.

Needs newton, mujoco and mujoco-warp. The exit status is 1 as long as the defect is there, 0 once it is cured.

In MJCF a ``<pair>`` without ``solreffriction`` has friction rows with the ``solref`` of its normal row: MuJoCo's
default is (0, 0), "as solref". Newton's importer fills in (0.02, 1), the default of ``solref``, for the friction rows
alone. With a stiffer ``solref`` of the pair the friction is softer than the model says, without a message.

A row of time constant T brings its velocity to zero at the rate b = 2 / (d T), d its largest impedance. A force along
the plane, smaller than what friction can bear, makes it creep with a speed in proportion to T: with solref 0.004 the
imported model creeps five times as fast.
"""

# Newton is an optional library; MuJoCo's compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import sys

import mujoco
import newton
import warp

TIME_CONSTANT = 0.004  # [s]
PUSH, DURATION = 1.0, 2.0  # [N], and hundreds of time constants [s]
BALL = f"""<mujoco>
<option timestep="0.002" integrator="implicitfast" cone="elliptic"/>
<worldbody>
  <geom name="ground" type="plane" size="0 0 1" contype="0" conaffinity="0"/>
  <body name="ball" pos="0 0 0.1">
    <joint name="x" type="slide" axis="1 0 0"/>
    <joint name="y" type="slide" axis="0 1 0"/>
    <joint name="z" type="slide" axis="0 0 1"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <geom name="ball" type="sphere" size="0.1" contype="0" conaffinity="0"/>
  </body>
</worldbody>
<contact><pair geom1="ground" geom2="ball" condim="3" friction="1 1 0 0 0" solref="{TIME_CONSTANT} 1"/></contact>
</mujoco>"""
# Newton keeps the model in single precision, and the creep is that of some thousand steps.
ACCURACY = 1e-3


def import_model() -> mujoco.MjModel:
    """Return the model that Newton's solver for MuJoCo makes of the ball."""
    warp.config.log_level = warp.LOG_ERROR
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z)
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.add_mjcf(BALL)
    return newton.solvers.SolverMuJoCo(builder.finalize(device="cpu"), use_mujoco_cpu=True).mj_model


def measure_creep(model: mujoco.MjModel) -> float:
    """Return the speed along the plane in MuJoCo's C library at the end [m/s]."""
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = PUSH
    mujoco.mj_step(model, data, nstep=round(DURATION / model.opt.timestep))
    return float(data.qvel[0])


def main() -> int:
    """Print both models' friction rows, their creep and the verdict; return the exit status."""
    creeps = []
    print(f"Newton {newton.__version__}, MuJoCo {mujoco.__version__}: a ball pushed along the plane")
    for name, model in (("MuJoCo", mujoco.MjModel.from_xml_string(BALL)), ("Newton's import", import_model())):
        normal, friction = (rows[0].round(9).tolist() for rows in (model.pair_solref, model.pair_solreffriction))
        creeps.append(measure_creep(model))
        print(f"{name:16} solref {normal}, solreffriction {friction}, creep {creeps[-1]:.4e} m/s")
    if abs(creeps[1] - creeps[0]) < ACCURACY * creeps[0]:
        print("cured: friction rows without solreffriction have their pair's solref")
        return 0
    times = creeps[1] / creeps[0]
    print(f"defect: the imported ball creeps {times:.2f} times as fast; write solreffriction in every pair")
    return 1


if __name__ == "__main__":
    sys.exit(main())
