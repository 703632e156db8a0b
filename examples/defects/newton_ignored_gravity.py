"""The gravity and the step of an MJCF file, which Newton 1.8 does not read, on a falling ball.

Needs newton, mujoco and mujoco-warp. The exit status is 1 as long as the defect is there, 0 once it is cured.

``<option gravity>`` says how bodies fall and ``<option timestep>`` in which steps. Newton's importer reads neither: a
model made for the moon falls as on Earth, at 9.81 m/s^2 along the axis that points up, without a message. The builder's
argument ``gravity`` is the only way to say it. The step is that of the call; what the file says remains unknown to
whoever asks the imported model.
"""

# Newton is an optional library; MuJoCo's compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import sys

import mujoco
import newton
import numpy as np
import warp

GRAVITY, STEP = 1.62, 0.0005  # of the moon [m/s^2], [s]
DURATION = 0.5  # [s]
BALL = f"""<mujoco>
<option gravity="0 0 {-GRAVITY}" timestep="{STEP}"/>
<worldbody>
  <body name="ball" pos="0 0 10"><freejoint/><geom name="ball" type="sphere" size="0.1" mass="1"/></body>
</worldbody>
</mujoco>"""
# Newton keeps the model in single precision.
ACCURACY = 1e-5


def import_model() -> mujoco.MjModel:
    """Return the model that Newton's solver for MuJoCo makes of the ball."""
    warp.config.log_level = warp.LOG_ERROR
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z)
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.add_mjcf(BALL)
    return newton.solvers.SolverMuJoCo(builder.finalize(device="cpu"), use_mujoco_cpu=True).mj_model


def measure_fall(model: mujoco.MjModel) -> float:
    """Return the acceleration of the ball in MuJoCo's C library, by its velocity at the end [m/s^2]."""
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=round(DURATION / model.opt.timestep))
    return float(-data.qvel[2] / data.time)


def main() -> int:
    """Print both models' options, how the ball falls and the verdict; return the exit status."""
    models = {"MuJoCo": mujoco.MjModel.from_xml_string(BALL), "Newton's import": import_model()}
    print(f"Newton {newton.__version__}, MuJoCo {mujoco.__version__}: a ball that falls at {GRAVITY} m/s^2")
    for name, model in models.items():
        print(f"{name:16} falls at {measure_fall(model):.4f} m/s^2, timestep {model.opt.timestep:g} s")
    right, found = models.values()
    same_gravity = np.allclose(found.opt.gravity, right.opt.gravity, rtol=ACCURACY)
    if same_gravity and np.isclose(found.opt.timestep, right.opt.timestep, rtol=ACCURACY):
        print("cured: gravity and timestep are those of the file")
        return 0
    lost = "timestep" if same_gravity else "gravity"
    print(f"defect: the file's {lost} is not read; give it to ModelBuilder and to the solver's step")
    return 1


if __name__ == "__main__":
    sys.exit(main())
