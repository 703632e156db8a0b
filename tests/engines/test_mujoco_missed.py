"""What blocks of wheels in MuJoCo must notice or refuse: repeated stages, missed evaluations, changed forces."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

import copy
import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Any

import mujoco
import numpy as np
import pytest

from velodrome.engines.engine import EngineError
from velodrome.engines.mujoco.edge_contacts import EdgeContacts
from velodrome.engines.mujoco.knife_edge import knife_edges, rolling_forces, stiffen
from velodrome.reference.surface import Paraboloid, Plane

WHEELS = {"wheel": "ground"}
PAIR = """<contact><pair geom1="ground" geom2="wheel" condim="3" friction="2 2 0 0 0" solref="0.05 1"
  solimp="0.9999 0.9999 0.001 0.5 2" margin="1e-3" gap="1e9"/></contact>"""
KINDS = pytest.mark.parametrize("kind", ["contacts", "forces"])
STABILISATION, SPEED, RADIUS = 20.0, 3.0, 0.3
Change = tuple[str, str]
PLANAR = (
    "<freejoint/>",
    '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>',
)


@pytest.fixture(autouse=True)
def no_callback_left() -> Iterator[None]:
    yield
    mujoco.set_mjcb_control(None)


def make_roller(kind: str, *changes: Change) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return a wheel in a frame, with a motor on its axle, that rolls along x and turns."""
    xml = f"""<mujoco><option timestep="0.001" integrator="Euler" cone="elliptic"/>
      <default><geom contype="0" conaffinity="0"/></default><worldbody>
      <geom name="ground" type="plane" size="0 0 1"/>
      <body name="frame" pos="0 0 {RADIUS}"><freejoint/><inertial pos="0 0 0" mass="3" diaginertia=".2 .2 .1"/>
      <body><joint name="axle" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia=".02 .04 .02"/>
      <geom name="wheel" type="cylinder" size="{RADIUS} 0.001" zaxis="0 1 0"/></body></body></worldbody>
      <actuator><motor joint="axle"/></actuator>{PAIR if kind == "contacts" else ""}</mujoco>"""
    for before, after in changes:
        assert before in xml
        xml = xml.replace(before, after)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    if model.nv == 7:
        data.qvel[0], data.qvel[6], data.qvel[5] = SPEED, SPEED / RADIUS, 0.5
    if kind == "contacts":
        stiffen(model, WHEELS, 1e-5)
    return model, data


def open_block(
    kind: str, model: mujoco.MjModel, data: mujoco.MjData, **options: Any
) -> AbstractContextManager[EdgeContacts]:
    if kind == "contacts":
        return knife_edges(model, data, options.get("surface", Plane()), WHEELS)
    return rolling_forces(
        model, data, **{"surface": Plane(), "wheels": WHEELS, "stabilisation": STABILISATION} | options
    )


# ------------------------------------------------------------------------------------ stages that MuJoCo keeps


@KINDS
@pytest.mark.parametrize("stage", ["VEL", "POS"])
def test_evaluations_that_keep_stages_change_nothing(kind, stage) -> None:
    """Corrections are made once, however often MuJoCo solves with the rows and passive forces that it has."""
    model, data = make_roller(kind)
    with open_block(kind, model, data) as contacts:
        mujoco.mj_step(model, data, 50)
        mujoco.mj_forward(model, data)
        expected, force = data.qacc.copy(), contacts.forces()
        for _ in range(3):
            mujoco.mj_forwardSkip(model, data, getattr(mujoco.mjtStage, f"mjSTAGE_{stage}"), 0)
            # The same computation, but for where the solver starts.
            np.testing.assert_allclose(data.qacc, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
            np.testing.assert_allclose(contacts.forces(), force, rtol=0, atol=1e-12 * np.abs(force).max())
        assert contacts.standing()


def test_corrected_rows_are_known_in_a_state_that_was_copied_back() -> None:
    model, data = make_roller("contacts")
    kept = mujoco.MjData(model)
    with open_block("contacts", model, data) as contacts:
        mujoco.mj_step(model, data, 50)
        mujoco.mj_forward(model, data)
        mujoco.mj_copyData(kept, model, data)
        expected = data.qacc.copy()
        mujoco.mj_step(model, data, 50)
        mujoco.mj_copyData(data, model, kept)
        mujoco.mj_forwardSkip(model, data, mujoco.mjtStage.mjSTAGE_VEL, 0)
        np.testing.assert_allclose(data.qacc, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        assert contacts.standing()


@KINDS
def test_derivative_by_the_control_is_that_of_steps(kind) -> None:
    """Euler's step is linear in the control, so differences have no error but round-off over their interval."""
    model, data = make_roller(kind)
    with open_block(kind, model, data) as contacts:
        mujoco.mj_step(model, data, 50)
        found, interval = np.zeros((2 * model.nv, 1)), 1e-6
        mujoco.mjd_transitionFD(model, data, interval, 1, None, found, None, None)
        size, kind_of_state = (
            mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION),
            (mujoco.mjtState.mjSTATE_INTEGRATION),
        )
        state, speeds = np.empty(size), []
        mujoco.mj_getState(model, data, state, kind_of_state)
        for sign in (1, -1):
            mujoco.mj_setState(model, data, state, kind_of_state)
            data.ctrl[0] = sign * interval
            mujoco.mj_step(model, data)
            speeds.append(data.qvel.copy())
        expected = (speeds[0] - speeds[1]) / (2 * interval)
        assert np.abs(expected).max() > 1e-3
        round_off = 2.0**-52 * np.abs(speeds[0]).max() / interval
        np.testing.assert_allclose(found[model.nv :, 0], expected, rtol=0, atol=10 * round_off)
        assert contacts.standing()


@KINDS
def test_inverse_dynamics_inside_the_block_is_no_fault(kind) -> None:
    model, data = make_roller(kind)
    again_model, again = make_roller(kind)
    with open_block(kind, model, data) as contacts, open_block(kind, again_model, again):
        for _ in range(5):
            mujoco.mj_step(model, data)
            mujoco.mj_inverse(model, data)
            mujoco.mj_step(again_model, again)
        assert contacts.standing()
    np.testing.assert_array_equal(data.qpos, again.qpos)


# ---------------------------------------------------------------------------------------- missed evaluations


def step_copy(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    mujoco.mj_step(copy.copy(model), data)


def step_without_actuation(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    mujoco.mj_step(model, data)
    model.opt.disableflags = 0


def evaluate_by_stages(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    for stage in ("Position", "Velocity", "Actuation", "Acceleration", "Constraint"):
        getattr(mujoco, f"mj_fwd{stage}")(model, data)


@KINDS
@pytest.mark.parametrize("evaluate", [step_copy, step_without_actuation, evaluate_by_stages])
@pytest.mark.parametrize("after", [0, 1])
def test_evaluations_without_the_callback_are_counted(kind, evaluate: Callable[..., None], after) -> None:
    """Whether the callback is called again or not."""
    model, data = make_roller(kind)

    def ride() -> None:
        with open_block(kind, model, data) as contacts:
            mujoco.mj_step(model, data)
            assert contacts.standing()
            evaluate(model, data)
            evaluate(model, data)
            if after:
                mujoco.mj_step(model, data)
            assert not contacts.standing()

    with pytest.raises(EngineError, match="solved 2 evaluations of this state without"):
        ride()


def test_check_sees_a_callback_that_was_replaced() -> None:
    model, data = make_roller("forces")
    block = open_block("forces", model, data)
    contacts = block.__enter__()
    mujoco.mj_step(model, data)
    contacts.check()
    mujoco.set_mjcb_control(lambda model, data: None)
    with pytest.raises(EngineError, match="control callback was replaced inside the block"):
        contacts.check()
    with pytest.raises(EngineError, match="control callback was replaced inside the block"):
        block.__exit__(None, None, None)


def test_states_may_be_reset_and_copied_back_under_rolling_forces() -> None:
    model, data = make_roller("forces")
    kept = mujoco.MjData(model)
    with open_block("forces", model, data) as contacts:
        mujoco.mj_step(model, data, 10)
        mujoco.mj_copyData(kept, model, data)
        mujoco.mj_step(model, data, 10)
        first = data.qpos.copy()
        mujoco.mj_copyData(data, model, kept)
        mujoco.mj_step(model, data, 10)
        np.testing.assert_array_equal(data.qpos, first)
        mujoco.mj_resetData(model, data)
        mujoco.mj_step(model, data)
        assert contacts.standing()


# -------------------------------------------------------------------------------------------- changed forces


def set_control(data: mujoco.MjData) -> None:
    data.ctrl[0] += 0.5


def set_force(data: mujoco.MjData) -> None:
    data.qfrc_applied[0] += 0.5


def set_wrench(data: mujoco.MjData) -> None:
    data.xfrc_applied[1, 1] += 0.5


@pytest.mark.parametrize("change", [set_control, set_force, set_wrench])
def test_forces_that_change_between_halves_of_a_step_are_an_error(change: Callable[..., None]) -> None:
    model, data = make_roller("forces")

    def ride() -> None:
        with open_block("forces", model, data):
            for _ in range(2):
                mujoco.mj_step1(model, data)
                change(data)
                mujoco.mj_step2(model, data)
            mujoco.mj_step(model, data)

    with pytest.raises(
        EngineError, match="control callback in 2 evaluations, so that the wheels' do not belong to them"
    ):
        ride()


def test_forces_may_change_between_steps() -> None:
    model, data = make_roller("forces")
    with open_block("forces", model, data) as contacts:
        for change in (set_control, set_force, set_wrench):
            change(data)
            mujoco.mj_step1(model, data)
            mujoco.mj_step2(model, data)
            change(data)
            mujoco.mj_step(model, data)
            assert contacts.standing()


@KINDS
def test_slip_that_implicit_damping_leaves(kind) -> None:
    """Of the guide: h J M^-1 D q" / (2 s), or / b, b = 2 / time constant = 40 1/s = 2 s. It lags by 1 / (2 s) = 25 ms.

    A planar wheel: J = (1, 0, -r), and q" changes at the rate c / (r^2 m) of the ride, 0.3 1/s: a share of 0.8 %.
    """
    damping, inertia = 0.1, 0.04
    model, data = make_roller(kind, PLANAR, ('name="axle"', f'name="axle" damping="{damping}"'))
    data.qvel[:] = [SPEED, 0, SPEED / RADIUS]
    with open_block(kind, model, data, constrained={"wheel": (False, True, True)}) as contacts:
        mujoco.mj_step(model, data, 500)
        slip = data.qvel[0] - RADIUS * data.qvel[2]
        law = model.opt.timestep * RADIUS * damping / inertia * data.qacc[2] / (2 * STABILISATION)
        assert slip == pytest.approx(law, rel=0.02)
        assert contacts.standing()


# ------------------------------------------------------------------------------------ changes inside the block


def set_noslip(model: mujoco.MjModel) -> None:
    model.opt.noslip_iterations = 3


def set_pgs(model: mujoco.MjModel) -> None:
    model.opt.solver = mujoco.mjtSolver.mjSOL_PGS


def set_sleep(model: mujoco.MjModel) -> None:
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        ("contacts", set_noslip, "noslip_iterations"),
        ("contacts", set_pgs, "the solver is PGS"),
        ("contacts", set_sleep, "sleep"),
        ("forces", set_sleep, "sleep"),
    ],
)
def test_options_are_watched_inside_the_block(kind, change: Callable[..., None], message) -> None:
    model, data = make_roller(kind)
    before = {name: getattr(model.opt, name) for name in ("noslip_iterations", "solver", "enableflags")}

    def ride() -> None:
        with open_block(kind, model, data) as contacts:
            mujoco.mj_step(model, data)
            contacts.check()
            change(model)
            with pytest.raises(EngineError, match=f"inside the block, .*{message}"):
                contacts.check()
            mujoco.mj_step(model, data)
            for name, value in before.items():
                setattr(model.opt, name, value)

    with pytest.raises(EngineError, match="options were changed inside the block, for 1 evaluations"):
        ride()


@KINDS
def test_radius_must_not_change_inside_the_block(kind) -> None:
    model, data = make_roller(kind)

    def ride() -> None:
        with open_block(kind, model, data):
            mujoco.mj_step(model, data)
            model.geom_size[model.geom("wheel").id, 0] = 0.25
            mujoco.mj_step(model, data)

    with pytest.raises(EngineError, match=r"radius of the wheel 'wheel' was changed inside the block, .* with 0.3 m"):
        ride()


# ------------------------------------------------------------------------------------------ wheels and models


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_planar_wheel_has_no_force_where_nothing_can_move(turn) -> None:
    """Newton's law for the frame and the wheel, and a force along the axle that no equation determines."""
    along, axle = (math.cos(turn), math.sin(turn), 0.0), (-math.sin(turn), math.cos(turn), 0.0)
    model, data = make_roller(
        "forces",
        PLANAR,
        ('axis="1 0 0"', f'axis="{along[0]!r} {along[1]!r} 0"'),
        ('name="axle" axis="0 1 0"', f'name="axle" axis="{axle[0]!r} {axle[1]!r} 0"'),
        ('zaxis="0 1 0"', f'zaxis="{axle[0]!r} {axle[1]!r} 0"'),
    )
    with open_block("forces", model, data) as contacts:
        data.qvel[:], data.ctrl[0] = [SPEED, 0, SPEED / RADIUS], 0.6
        mujoco.mj_forward(model, data)
        inertia = 4.0 * RADIUS**2 + 0.02 + 0.02 * math.cos(turn) ** 2
        acceleration = 0.6 * RADIUS / inertia
        np.testing.assert_allclose(data.qacc, [acceleration, 0, acceleration / RADIUS], rtol=0, atol=1e-12)
        expected = 4.0 * (acceleration * np.array(along) + [0, 0, 9.81])
        np.testing.assert_allclose(contacts.forces()[0], expected, rtol=0, atol=1e-11)
        assert contacts.standing()


def test_straight_ride_without_loads_is_no_contradiction() -> None:
    """All accelerations of the rows are round-off: redundant ones then differ by as much as they are."""
    model, data = make_roller("forces", PLANAR, ('cone="elliptic"', 'gravity="0 0 0"'))
    with open_block("forces", model, data) as contacts:
        data.qvel[:] = [SPEED, 0, SPEED / RADIUS]
        mujoco.mj_step(model, data, 100)
        assert contacts.find_fault() is None


def test_infinite_forces_are_named() -> None:
    model, data = make_roller("forces")

    def ride() -> None:
        with open_block("forces", model, data):
            data.qfrc_applied[0] = np.nan
            mujoco.mj_forward(model, data)

    with pytest.raises(EngineError, match="forces of rolling were not finite in 1 evaluations"):
        ride()


@KINDS
def test_wheel_that_no_joint_moves_is_refused(kind) -> None:
    model, data = make_roller(
        kind,
        ("<freejoint/>", ""),
        ('name="frame"', 'name="frame" mocap="true"'),
        ('<joint name="axle" axis="0 1 0"/>', ""),
        ('<actuator><motor joint="axle"/></actuator>', ""),
    )
    with (
        pytest.raises(ValueError, match="'wheel' must belong to a body that moves by a joint"),
        open_block(kind, model, data),
    ):
        pass


def test_wheel_without_a_contact_point_is_told_and_leaves_the_others_alone() -> None:
    second = (
        '<body pos="0 5 0.3"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia=".02 .04 .02"/>'
        '<geom name="flat" type="cylinder" size="0.3 0.001" zaxis="0 1 0"/></body></worldbody>'
    )
    model, data = make_roller("forces", ("</worldbody>", second))
    alone_model, alone = make_roller("forces")
    data.qvel[:7] = alone.qvel
    data.qpos[11:15] = [math.sqrt(0.5), math.sqrt(0.5), 0, 0]  # its axle is vertical

    def ride() -> None:
        with (
            open_block("forces", alone_model, alone) as expected,
            rolling_forces(model, data, Plane(), WHEELS | {"flat": "ground"}, STABILISATION) as contacts,
        ):
            mujoco.mj_step(model, data, 10)
            mujoco.mj_step(alone_model, alone, 10)
            np.testing.assert_allclose(data.qpos[:8], alone.qpos, rtol=0, atol=1e-13)
            np.testing.assert_allclose(contacts.forces()[0], expected.forces()[0], rtol=0, atol=1e-11)
            np.testing.assert_array_equal(contacts.forces()[1], 0)
            assert not contacts.standing()

    with pytest.raises(EngineError, match="the wheel 'flat' had no contact point with the ground in 10 evaluations"):
        ride()


# ----------------------------------------------------------------------------------------------- arguments


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"wheels": {"weel": "ground"}}, "the model has no geom 'weel'; its geoms are 'ground', 'wheel'"),
        ({"wheels": {"wheel": "floor"}}, "the model has no geom 'floor'"),
        ({"surface": None}, "surface must be one of"),
        ({"stabilisation": float("nan")}, "stabilisation must be a finite rate of 0 or more"),
        ({"stabilisation": -20.0}, "stabilisation must be a finite rate of 0 or more"),
        ({"stabilisation": "fast"}, "stabilisation must be a finite rate of 0 or more"),
        ({"stabilisation": 900.0}, "at steps of 0.001 s gaps or slip grow from 828.4 1/s on"),
        ({"constrained": {"wheel": (True, True)}}, r"constrained\['wheel'\] must be three truth values"),
        ({"constrained": {"wheel": True}}, r"constrained\['wheel'\] must be three truth values"),
        ({"constrained": {"wheel": (0.5, 2, 1)}}, r"constrained\['wheel'\] must be three truth values"),
    ],
)
def test_bad_arguments_are_refused(options, message) -> None:
    model, data = make_roller("forces")
    with pytest.raises(ValueError, match=message), open_block("forces", model, data, **options):
        pass


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
@pytest.mark.parametrize(("factor", "grows"), [(0.9, False), (1.1, True)])
def test_limit_of_the_stabilisation_is_that_of_the_integrator(integrator, factor, grows) -> None:
    """A wheel 1 um below the ground that slips by 1 um/s: beyond the limit one of the two grows."""
    limit = {"Euler": 828.4, "RK4": 1392.5}[integrator]
    model, data = make_roller("forces", ('integrator="Euler"', f'integrator="{integrator}"'))
    data.qvel[:], data.qpos[2] = 0, RADIUS - 1e-6
    data.qvel[1] = 1e-6
    # The limit is checked at the start alone.
    model.opt.timestep = 1e-6
    with open_block("forces", model, data, stabilisation=factor * limit) as contacts:
        model.opt.timestep = 1e-3
        mujoco.mj_step(model, data, 20)
        assert (max(abs(contacts.gaps()[0]), abs(data.qvel[1])) > 1e-6) == grows


@KINDS
def test_tilted_plane_is_refused(kind) -> None:
    model, data = make_roller(kind, ('size="0 0 1"', 'size="0 0 1" zaxis="0.1 0 1"'))
    with (
        pytest.raises(ValueError, match=r"'ground' is tilted by 0.09.* the surface has the slope"),
        open_block(kind, model, data, surface=Paraboloid(0.1)),
    ):
        pass


@KINDS
def test_data_of_another_model_are_refused(kind) -> None:
    model, _ = make_roller(kind)
    _, data = make_roller(kind, ('name="frame"', 'name="frame2"'), ("</worldbody>", "<body/></worldbody>"))
    with pytest.raises(ValueError, match="data belongs to another model"), open_block(kind, model, data):
        pass


@pytest.mark.parametrize("softness", [0, -1.0, float("nan"), float("inf"), "soft"])
def test_bad_softness_is_refused(softness) -> None:
    model, _ = make_roller("contacts")
    with pytest.raises(ValueError, match="softness must be a finite number above 0"):
        stiffen(model, WHEELS, softness)


def test_stiffen_names_a_missing_wheel() -> None:
    model, _ = make_roller("contacts")
    with pytest.raises(ValueError, match="the model has no geom 'weel'"):
        stiffen(model, {"weel": "ground"}, 1e-5)
