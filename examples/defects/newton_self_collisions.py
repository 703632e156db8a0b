"""A ball that Newton 1.8 lets fall through the ground of its own MJCF file when it is asked to ignore self-collisions.

Needs newton, mujoco and mujoco-warp. The exit status is 1 as long as the defect is there, 0 once it is cured.

``add_mjcf(..., enable_self_collisions=False)`` is meant for robots whose links must not touch each other. The importer
leaves out every pair of geoms of the file, pairs with the geoms of ``<worldbody>`` itself included, which belong to no
robot. A model with its ground in the same file has no ground any more, without a message. Pairs in ``<contact>``
remain.
"""

# Newton is an optional library; MuJoCo's compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import sys

import mujoco
import newton
import warp

RADIUS, DURATION = 0.1, 0.5  # [m], [s]
BALL = f"""<mujoco>
<worldbody>
  <geom name="ground" type="plane" size="0 0 1"/>
  <body name="ball" pos="0 0 {RADIUS}"><freejoint/><geom name="ball" type="sphere" size="{RADIUS}" mass="1"/></body>
</worldbody>
</mujoco>"""


def drop_ball(enable_self_collisions: bool) -> float:
    """Return the height of the ball's centre at the end, in the model that Newton's solver for MuJoCo makes [m]."""
    warp.config.log_level = warp.LOG_ERROR
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z)
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.add_mjcf(BALL, enable_self_collisions=enable_self_collisions)
    model = newton.solvers.SolverMuJoCo(builder.finalize(device="cpu"), use_mujoco_cpu=True).mj_model
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=round(DURATION / model.opt.timestep))
    return float(data.qpos[2])


def main() -> int:
    """Print where the ball lies and the verdict; return the exit status."""
    print(f"Newton {newton.__version__}, a ball of {RADIUS:g} m that lies on the ground, after {DURATION:g} s")
    heights = {asked: drop_ball(asked) for asked in (True, False)}
    for asked, height in heights.items():
        print(f"enable_self_collisions={asked!s:5} height of its centre {height:+.4f} m")
    # A resting ball sinks by far less than its radius; a falling one is 1.2 m lower.
    if heights[False] > 0.9 * RADIUS:
        print("cured: the ball lies on the ground with and without self-collisions")
        return 0
    print("defect: without self-collisions there is no ground; declare its contacts as <pair>")
    return 1


if __name__ == "__main__":
    sys.exit(main())
