"""A stranger's tandem over the grid of MuJoCo's settings: forces are right, or the block raises an error."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from collections.abc import Callable
from itertools import product
from typing import Any

import mujoco
import numpy as np
import pytest

from velodrome.engines.engine import EngineError
from velodrome.engines.mujoco.knife_edge import knife_edges, rolling_forces, stiffen
from velodrome.engines.mujoco.rolling_disc import steady_state
from velodrome.engines.rolling import observe_wheel
from velodrome.reference.bowls import Sphere, Torus
from velodrome.reference.height_field import HeightField
from velodrome.reference.surface import InclinedPlane, Paraboloid, Plane, Surface, evaluate

BALL_ON_A_BOX = (
    '<body pos="3 2 0.2"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/><geom size=".2"/></body>'
    '<geom type="box" size="1 1 .1" pos="3 2 -.1"/>'
)
WHEELS = {"rear": "ground", "front": "ground"}
GRAVITY, SPEED, RADIUS = 9.81, 4.0, 0.3
STEP, STEPS = 0.002, 150


def write_wheel(name: str, x: float, z: float, jointed: bool) -> str:
    joint = '<joint type="hinge" axis="0 1 0"/>' if jointed else ""
    return (
        f'<body name="{name}" pos="{x} 0 {z}">{joint}<inertial pos="0 0 0" mass="2" diaginertia=".045 .09 .045"/>'
        f'<geom name="{name}" type="cylinder" size="{RADIUS} 0.001" zaxis="0 1 0" contype="0" conaffinity="0"/></body>'
    )


def compile_tandem(
    friction: float = 2.0,
    softness: float = 1e-5,
    more: str = "",
    jointed: bool = True,
    steer: str = "",
    solref: str = "0.05 1",
    **options: Any,
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Two wheels, a frame, a fork, and two riders on springs: six bodies, 28.5 kg. It rolls straight and leans."""
    pairs = "".join(
        f'<pair geom1="ground" geom2="{name}" condim="3" friction="{friction} {friction} 0 0 0" solref="{solref}" '
        'solimp="0.9999 0.9999 0.001 0.5 2" margin="1e-3" gap="1e9"/>'
        for name in WHEELS
    )
    riders = "".join(
        f'<body pos="{x} 0 0.6"><joint type="hinge" axis="1 0 0" stiffness="300"/>'
        '<inertial pos="0 0 0.3" mass="6" diaginertia=".3 .3 .1"/></body>'
        for x in (-0.3, 0.1)
    )
    chosen = {"integrator": "RK4", "cone": "elliptic"} | options
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler inertiafromgeom="false" autolimits="true"/><option timestep="{STEP}" '
        + " ".join(f'{name}="{value}"' for name, value in chosen.items())
        + '><flag energy="enable"/></option><worldbody>'
        '<geom name="ground" type="plane" size="0 0 1" contype="0" conaffinity="0"/><body pos="0 0 0.3"><freejoint/>'
        f'<inertial pos="0 0 0.5" mass="10" diaginertia="1 1.5 1"/>{write_wheel("rear", -0.5, 0, jointed)}'
        f'<body pos="0.4 0 0.2"><joint name="steer" type="hinge" axis="-0.3 0 1" {steer}/>'
        '<inertial pos="0.03 0 0.1" mass="1.5" diaginertia=".05 .05 .01"/>'
        f"{write_wheel('front', 0.15, -0.2, jointed)}</body>{riders}</body>{more}"
        f"</worldbody><contact>{pairs}</contact></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qvel[0], data.qvel[3] = SPEED, 0.1
    # The contacts, not the frame's origin, stay where they are as it begins to lean.
    data.qvel[1] = -0.1 * RADIUS
    for name in WHEELS if jointed else ():
        data.qvel[model.jnt_dofadr[model.body(name).jntadr[0]]] = SPEED / RADIUS
    stiffen(model, WHEELS, softness)
    return model, data


class Watched:
    """What a ride on the plane showed: sums of normal forces over the weight, energies, gaps and friction's share."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, friction: float, steps: int = STEPS) -> None:
        weight, rows = GRAVITY * float(model.body_mass.sum()), []
        with knife_edges(model, data, Plane(), WHEELS) as contacts:
            for _ in range(steps):
                mujoco.mj_forward(model, data)
                force = contacts.forces()
                share = np.linalg.norm(force[:, :2], axis=1) - friction * force[:, 2]
                rows.append((force[:, 2].sum() / weight, data.energy.sum(), np.abs(contacts.gaps()).max(), share.max()))
                mujoco.mj_step(model, data)
            self.standing = contacts.standing()
        self.load, self.energy, gap, share = np.array(rows).T
        self.gap, self.excess = float(gap.max()), float(share.max()) / weight


GRID = list(
    product(("Newton", "CG"), ("elliptic", "pyramidal"), (0.5, 1.0, 2.0), (1.0, 10.0, 100.0), (1e-5, 1e-2, 1.0))
)


@pytest.mark.parametrize(("solver", "cone", "friction", "impratio", "softness"), GRID)
def test_rolling_is_right_whatever_the_settings(solver, cone, friction, impratio, softness) -> None:
    """It begins to fall with 0.1 rad/s at sqrt(g / h) = 3.5 1/s or less, for 0.3 s: 0.05 rad and 0.3 rad/s.

    So its mass centre, at 0.85 m or less, is accelerated by less than h (lean rate^2 + lean g / h): the load is the
    weight within a few per cent. Energy is kept up to the rows' damping of small gaps, and friction stays in its cone.
    """
    model, data = compile_tandem(friction, softness, solver=solver, cone=cone, impratio=impratio)
    found = Watched(model, data, friction)
    assert found.standing
    assert np.abs(found.load - 1).max() < 0.85 * (0.3**2 + 0.05 * 3.5**2 * 0.3) / GRAVITY + 0.01
    assert np.ptp(found.energy) < 1e-4 * abs(found.energy[0])
    # R F / k, R = 1e-4 softness / (2 kg) and k = 1 / (0.05 s)^2, both within a factor of two; the start settles.
    assert found.gap < 1e-4 * softness * 300 * 2 / 400 + 1e-5
    assert found.excess < 1e-6


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
def test_integrators_agree(integrator) -> None:
    """One-step methods are of first order: half the step, half the distance to RK4."""

    def ride(kind: str, step: float) -> np.ndarray:
        model, data = compile_tandem(integrator=kind)
        model.opt.timestep = step
        with knife_edges(model, data, Plane(), WHEELS):
            mujoco.mj_step(model, data, round(0.2 / step))
        return data.qpos.copy()

    exact = ride("RK4", 0.0005)
    errors = [np.abs(ride(integrator, step) - exact).max() for step in (0.002, 0.001)]
    if integrator == "RK4":
        assert errors[0] < 1e-8
    else:
        assert errors[0] < 0.01
        assert 1.7 < errors[0] / errors[1] < 2.3


def kick_sideways(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    data.qvel[1] = 2.0


def spin_wheel(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    data.qvel[model.jnt_dofadr[model.body("rear").jntadr[0]]] *= 1.5


def drop(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    data.qpos[2] += 0.05


def topple(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    data.qvel[3] = 2.0


Start = Callable[[mujoco.MjModel, mujoco.MjData], None]


def watch_or_raise(start: Start, friction: float, softness: float, steps: int, **options: Any) -> Watched | None:
    model, data = compile_tandem(friction, softness, **options)
    start(model, data)
    try:
        return Watched(model, data, friction, steps)
    except EngineError as error:
        if "stopped unconverged" not in str(error):
            raise
        return None


@pytest.mark.parametrize("softness", [1e-5, 1.0])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize("start", [kick_sideways, spin_wheel, drop, topple])
def test_newton_is_right_where_wheels_slide_fly_and_fall(start, cone, softness) -> None:
    """Energy is lost by friction, never won but by RK4's error where a force sets in; friction stays in its cone."""
    found = watch_or_raise(start, 0.7, softness, 250, cone=cone, impratio=10)
    assert found is not None
    assert found.load.min() >= 0
    assert np.diff(found.energy).max() < 1e-3 * abs(found.energy[0])
    assert found.energy[-1] < found.energy[0]
    # Contacts that land at 1 m/s stop within the time constant; those that turn over, a little harder.
    assert found.load.max() < 12
    # A pyramid's edges have the friction of their directions; the cone is softened by the rows.
    assert found.excess < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("start", [kick_sideways, spin_wheel, drop, topple])
@pytest.mark.parametrize("softness", [1e-5, 1.0])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_conjugate_gradients_are_right_or_raise(start, cone, softness) -> None:
    newton, found = (
        watch_or_raise(start, 0.7, softness, 100, cone=cone, impratio=10, solver=solver) for solver in ("Newton", "CG")
    )
    assert newton is not None
    if found is not None:
        # Both within 1 % of the forces in every evaluation, whose sum the motion hands on.
        np.testing.assert_allclose(found.load, newton.load, atol=0.05 * newton.load.max())


@pytest.mark.parametrize(
    ("more", "steer"),
    [
        ("", 'range="-0.01 0.01"'),
        ("", 'frictionloss="0.5"'),
        ("", 'damping="0.3" stiffness="5" armature="0.01"'),
        (BALL_ON_A_BOX, ""),
    ],
)
def test_other_constraints_act_beside_wheels(more, steer) -> None:
    """Joint limits, friction losses and springs, and another vehicle's contacts in the same solver."""
    model, data = compile_tandem(more=more, steer=steer)
    steering = model.joint("steer").dofadr[0]
    data.qvel[steering] = 0.5
    found = Watched(model, data, 2.0)
    assert found.standing
    assert np.diff(found.energy).max() < 1e-4 * abs(found.energy[0])
    if "range" in steer:
        assert np.abs(data.qpos[model.joint("steer").qposadr[0]]) < 0.02


def test_welded_wheels_slide_like_skids_and_hover() -> None:
    """Wheels without joints, far inside the margin: MuJoCo's convex friction lifts what slides.

    At the edge of the cone it adds friction times the tangential residual b v + a to the normal row, which the row's
    stiffness k balances at a gap of mu (b v + a) / k. The load is the weight there, and friction brakes with mu g.
    """
    friction, impedance, time_constant = 0.2, 0.9999, 0.05
    model, data = compile_tandem(friction, jointed=False)
    model.pair_margin[:] = 0.3
    data.qvel[:] = 0
    data.qvel[0] = 3.0
    damping, stiffness = 2 / (impedance * time_constant), 1 / (impedance * time_constant**2)
    with knife_edges(model, data, Plane(), WHEELS) as contacts:
        mujoco.mj_step(model, data, 250)
        mujoco.mj_forward(model, data)
        assert contacts.standing()
        gap, load = contacts.gaps(), contacts.forces()[:, 2].sum()
    expected = friction * (damping * data.qvel[0] + data.qacc[0]) / stiffness
    # The gap follows the speed, which falls at mu g, with two time constants' delay.
    delay = 2 * time_constant * friction * damping / stiffness * friction * GRAVITY
    np.testing.assert_allclose(gap, expected, rtol=0, atol=2 * delay)
    assert delay < 0.1 * expected
    np.testing.assert_allclose(load, GRAVITY * model.body_mass.sum(), rtol=0.02)
    np.testing.assert_allclose(data.qacc[0], -friction * GRAVITY, rtol=0.02)


def test_direct_stiffness_and_damping() -> None:
    """solref of negative numbers: stiffness and damping themselves."""
    model, data = compile_tandem(solref="-400 -40")
    found = Watched(model, data, 2.0)
    assert found.standing
    assert np.abs(found.load - 1).max() < 0.05
    assert found.gap < 1e-5


def test_many_wheels_share_a_model() -> None:
    """Twenty discs on circles of their own, in one solver: each as if alone. There may be 64."""
    count = 20

    def compile_discs(number: int) -> tuple[mujoco.MjModel, mujoco.MjData, dict[str, str]]:
        names = {f"wheel-{k}": "ground" for k in range(number)}
        bodies = "".join(
            f'<body><freejoint/><inertial pos="0 0 0" mass="0.5" diaginertia="0.01125 0.01125 0.0225"/>'
            f'<geom name="{name}" type="cylinder" size="{RADIUS} 0.001"/></body>'
            for name in names
        )
        pairs = "".join(
            f'<pair geom1="ground" geom2="{name}" condim="3" friction="2 2 0 0 0" solref="0.05 1" '
            'solimp="0.9999 0.9999 0.001 0.5 2" margin="1e-3" gap="1e9"/>'
            for name in names
        )
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{STEP}" integrator="RK4" cone="elliptic"/><default><geom contype="0" '
            'conaffinity="0"/></default><worldbody><geom name="ground" type="plane" size="0 0 1"/>'
            f"{bodies}</worldbody><contact>{pairs}</contact></mujoco>"
        )
        stiffen(model, names, 1e-5)
        return model, mujoco.MjData(model), names

    def set_disc(data: mujoco.MjData, k: int, lean: float) -> None:
        data.qpos[7 * k : 7 * k + 7], data.qvel[6 * k : 6 * k + 6], _ = steady_state(lean, 1.0)

    leans = np.linspace(0.1, 0.8, count)
    model, data, names = compile_discs(count)
    for k, lean in enumerate(leans):
        set_disc(data, k, lean)
    with knife_edges(model, data, Paraboloid(0.01), names) as contacts:
        mujoco.mj_step(model, data, 50)
        assert contacts.forces().shape == (count, 3)
    for k in (0, 7, count - 1):
        one_model, one, name = compile_discs(1)
        set_disc(one, 0, leans[k])
        with knife_edges(one_model, one, Paraboloid(0.01), name):
            mujoco.mj_step(one_model, one, 50)
        # The solver of all stops at forces that are off by 1e-6 of their sum at most.
        np.testing.assert_allclose(data.qpos[7 * k : 7 * k + 7], one.qpos, rtol=0, atol=1e-6)
    model, data, names = compile_discs(65)
    with (
        pytest.raises(ValueError, match="there are 65 wheels; there must be 1 to 64"),
        knife_edges(model, data, Plane(), names),
    ):
        pass


def test_forces_of_rolling_that_hold_a_wheel_down_are_told() -> None:
    """Gravity upward: only the constraints keep the wheels on the ground."""
    model, data = compile_tandem()
    model.pair_margin[:], model.pair_gap[:] = -1e9, 0.0
    with rolling_forces(model, data, Paraboloid(0.1), WHEELS, 20.0) as contacts:
        mujoco.mj_forward(model, data)
        assert contacts.standing()
    model.opt.gravity[2] = GRAVITY
    with rolling_forces(model, data, Paraboloid(0.1), WHEELS, 20.0) as contacts:
        mujoco.mj_forward(model, data)
        assert contacts.held_down()
        assert not contacts.standing()
        assert contacts.find_fault() is None


def test_state_that_explodes_is_an_error() -> None:
    """MuJoCo resets it without an error of its own."""
    model, data = compile_tandem()

    def explode() -> None:
        with knife_edges(model, data, Plane(), WHEELS):
            data.qfrc_applied[:] = 1e14
            mujoco.mj_step(model, data, 3)

    previous = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        with pytest.raises(EngineError, match="infinite or huge"):
            explode()
    finally:
        mujoco.set_mju_user_warning(previous)


# ------------------------------------------------------------------------------------------------- grounds


def bumps() -> HeightField:
    x, y = np.meshgrid(np.arange(-4.0, 4.01, 0.25), np.arange(-4.0, 4.01, 0.25), indexing="ij")
    return HeightField((0.05 * np.sin(x) * np.cos(1.3 * y)).tolist(), spacing=0.25, origin=(-4.0, -4.0))


@pytest.mark.parametrize("kind", ["contacts", "forces"])
@pytest.mark.parametrize(
    "ground",
    [Plane(), InclinedPlane(slope=0.2, direction=0.3), Paraboloid(0.1), Sphere(5.0), Torus(3.0, 9.0), bumps()],
    ids=lambda ground: type(ground).__name__,
)
def test_disc_keeps_its_energy_on_any_ground(ground: Surface, kind) -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="0.001" integrator="RK4" cone="elliptic"><flag energy="enable"/></option>'
        '<default><geom contype="0" conaffinity="0"/></default><worldbody>'
        '<geom name="ground" type="plane" size="0 0 1"/><body><freejoint/><inertial pos="0 0 0" mass="0.5" '
        'diaginertia="0.01125 0.01125 0.0225"/><geom name="wheel" type="cylinder" size="0.3 0.001"/></body></worldbody>'
        + (
            '<contact><pair geom1="ground" geom2="wheel" condim="3" friction="2 2 0 0 0" solref="0.05 1" '
            'solimp="0.9999 0.9999 0.001 0.5 2" margin="1e-3" gap="1e9"/></contact>'
            if kind == "contacts"
            else ""
        )
        + "</mujoco>"
    )
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], _ = steady_state(0.4, 1.0)
    stiffen(model, {"wheel": "ground"}, 1e-5)
    block = (
        knife_edges(model, data, ground, {"wheel": "ground"})
        if kind == "contacts"
        else rolling_forces(model, data, ground, {"wheel": "ground"}, 20.0)
    )
    with block as contacts:
        _set_down(model, data, contacts, ground)
        energies = []
        for _ in range(500):
            mujoco.mj_forward(model, data)
            energies.append(data.energy.sum())
            mujoco.mj_step(model, data)
        assert contacts.standing()
        assert np.abs(contacts.gaps()).max() < 1e-7
    # RK4's local error of the disc's spin of at most 20 rad/s, and the nearly rigid rows' creep.
    assert np.ptp(energies) < 1e-7 * abs(energies[0])


def _set_down(model: mujoco.MjModel, data: mujoco.MjData, contacts: Any, ground: Surface) -> None:
    """Raise the disc until it touches, and give it the velocity with which it rolls at the spin that it has."""
    data.qpos[2] += evaluate(ground, data.qpos[0], data.qpos[1])[..., 0].item()
    for _ in range(30):
        mujoco.mj_forward(model, data)
        data.qpos[2] -= contacts.gaps()[0]
    mujoco.mj_forward(model, data)
    axes = data.xmat[1].reshape(3, 3)
    seen = observe_wheel(ground, RADIUS, data.xpos[1], axes[:, 2], data.qvel[:3], axes @ data.qvel[3:6])
    data.qvel[:3] -= seen.velocity
