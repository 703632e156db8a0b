"""Knife edges in a stranger's program: beside other callbacks, states, threads, options and copies."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from collections.abc import Iterator
from contextlib import ExitStack
from threading import Thread

import mujoco
import numpy as np
import pytest

from velodrome.engines.engine import EngineError
from velodrome.engines.mujoco.knife_edge import knife_edges, rolling_forces, stiffen
from velodrome.engines.mujoco.library import control_slot
from velodrome.engines.mujoco.rolling_disc import MASS, TOUCHING, disc_mjcf, steady_state
from velodrome.reference.surface import Paraboloid, Plane

STABILISATION = 20.0


@pytest.fixture(autouse=True)
def no_callbacks_left() -> Iterator[None]:
    yield
    for kind in ("control", "passive", "contactfilter"):
        getattr(mujoco, f"set_mjcb_{kind}")(None)


def compile_disc(*changes: tuple[str, str], lean: float = 0.4) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return a disc on its circle, which a motor can push along its own x axis: forward at the start."""
    xml = disc_mjcf(0.002).replace("<freejoint/>", '<freejoint/><site name="centre"/>')
    motor = '<actuator><motor site="centre" gear="1 0 0 0 0 0"/></actuator>'
    for before, after in (("</mujoco>", f"{motor}</mujoco>"), *changes):
        assert before in xml
        xml = xml.replace(before, after)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[:7], data.qvel[:6], _ = steady_state(lean, 1.0)
    stiffen(model, TOUCHING, 1e-5)
    return model, data


NO_CONTACT = (("<pair", '<exclude body1="world" body2="disc"/><!--pair'), ('gap="1e9"/>', 'gap="1e9"/-->'))
EULER = ('integrator="RK4"', 'integrator="Euler"')


def push(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    data.ctrl[:] = np.sin(30 * data.time)


def step_by_hand(pushing: bool) -> np.ndarray:
    """Return where the disc is after a hundred steps of Euler's method, pushed without a callback."""
    model, data = compile_disc(EULER)
    with knife_edges(model, data, Plane(), TOUCHING):
        for _ in range(100):
            if pushing:
                push(model, data)
            mujoco.mj_step(model, data)
    return data.qpos.copy()


@pytest.mark.parametrize("when", ["before", "inside"])
def test_control_callback_of_the_user_is_called_first(when) -> None:
    model, data = compile_disc(EULER)
    if when == "before":
        mujoco.set_mjcb_control(push)
    with knife_edges(model, data, Plane(), TOUCHING):
        if when == "inside":
            mujoco.set_mjcb_control(push)
        mujoco.mj_step(model, data, 100)
        assert mujoco.get_mjcb_control() is push
    assert mujoco.get_mjcb_control() is push
    mujoco.set_mjcb_control(None)  # MuJoCo cannot compile a model with a callback in Python
    np.testing.assert_array_equal(data.qpos, step_by_hand(True))
    assert np.abs(data.qpos - step_by_hand(False)).max() > 1e-3


def test_callback_that_is_taken_away_inside_the_block_is_not_called_again() -> None:
    model, data = compile_disc(EULER)
    mujoco.set_mjcb_control(push)
    with knife_edges(model, data, Plane(), TOUCHING):
        mujoco.set_mjcb_control(None)
        mujoco.mj_step(model, data, 100)
    assert control_slot().value is None
    np.testing.assert_array_equal(data.qpos, step_by_hand(False))


def test_rolling_forces_know_the_user_s_forces() -> None:
    """Control callback, applied forces and the wrench on a body: the contact's force takes them up at once."""
    model, data = compile_disc(*NO_CONTACT)
    mujoco.set_mjcb_control(lambda model, data: data.ctrl.fill(0.3))
    with rolling_forces(model, data, Plane(), TOUCHING, STABILISATION) as contacts:
        data.qfrc_applied[1] = 0.2
        data.xfrc_applied[1, 2] = -1.0
        mujoco.mj_forward(model, data)
        np.testing.assert_array_equal(data.qfrc_applied, [0, 0.2, 0, 0, 0, 0])
        # Newton's law for the mass centre; the motor pushes forward, along y.
        given = np.array([0.0, 0.2 + 0.3, -1.0 - 9.81 * MASS])
        np.testing.assert_allclose(MASS * data.qacc[:3], contacts.forces()[0] + given, rtol=0, atol=1e-13)
        assert contacts.standing()
        # The acceleration is compatible with rolling: after a second of RK4 the wheel has neither gap nor slip left.
        mujoco.mj_step(model, data, 500)
        mujoco.mj_forward(model, data)
        spin = 5.0  # about the rate of the disc [rad/s]
        assert np.abs(contacts.gaps()).max() < 500 * (spin * model.opt.timestep) ** 5


def test_replaced_callback_ends_rolling_forces_with_an_error() -> None:
    model, data = compile_disc(*NO_CONTACT)

    def step() -> None:
        with rolling_forces(model, data, Plane(), TOUCHING, STABILISATION):
            mujoco.set_mjcb_control(push)
            mujoco.mj_step(model, data)

    with pytest.raises(EngineError, match="control callback was replaced inside the block"):
        step()
    assert mujoco.get_mjcb_control() is push


def test_error_in_the_user_s_callback_is_the_user_s() -> None:
    model, data = compile_disc()

    def fail(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        raise RuntimeError("mine")

    mujoco.set_mjcb_control(fail)
    with pytest.raises(RuntimeError, match="mine"), knife_edges(model, data, Plane(), TOUCHING):
        mujoco.mj_step(model, data)
    assert mujoco.get_mjcb_control() is fail
    mujoco.set_mjcb_control(None)
    with knife_edges(model, data, Plane(), TOUCHING) as contacts:
        mujoco.mj_step(model, data)
        assert contacts.standing()


def test_passive_callback_acts() -> None:
    model, data = compile_disc(EULER)

    def push_passively(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        data.qfrc_passive[0] += np.sin(30 * data.time)

    mujoco.set_mjcb_passive(push_passively)
    with knife_edges(model, data, Plane(), TOUCHING):
        mujoco.mj_step(model, data, 100)
    mujoco.set_mjcb_passive(None)
    again_model, again = compile_disc(EULER)
    with knife_edges(again_model, again, Plane(), TOUCHING):
        for _ in range(100):
            again.qfrc_applied[0] = np.sin(30 * again.time)
            mujoco.mj_step(again_model, again)
    assert np.abs(again.qpos - step_by_hand(False)).max() > 1e-3
    # The same forces, added in another order: round-off of 100 steps.
    np.testing.assert_allclose(data.qpos, again.qpos, rtol=0, atol=1e-10)


def test_contact_filter_has_no_say_about_the_pair() -> None:
    model, data = compile_disc()
    mujoco.set_mjcb_contactfilter(lambda model, data, first, second: 1)
    with knife_edges(model, data, Plane(), TOUCHING) as contacts:
        mujoco.mj_step(model, data)
        assert contacts.standing()


@pytest.mark.parametrize("flag", ["CONTACT", "CONSTRAINT"])
def test_contacts_that_are_disabled_inside_the_block_are_missed(flag) -> None:
    model, data = compile_disc()

    def step() -> None:
        with knife_edges(model, data, Plane(), TOUCHING) as contacts:
            mujoco.mj_step(model, data)
            assert contacts.standing()
            model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")
            mujoco.mj_step(model, data)
            assert not contacts.standing()
            contacts.check()

    with pytest.raises(EngineError, match="left out a wheel's contact in 4 evaluations"):
        step()


def test_evaluations_that_keep_positions_keep_contacts() -> None:
    model, data = compile_disc()
    with knife_edges(model, data, Plane(), TOUCHING) as contacts:
        mujoco.mj_forward(model, data)
        force = contacts.forces()
        mujoco.mj_forwardSkip(model, data, mujoco.mjtStage.mjSTAGE_POS, 0)
        np.testing.assert_allclose(contacts.forces(), force, rtol=1e-9, atol=0)
        assert contacts.standing()


# ------------------------------------------------------------------------------------ states, copies, threads


def alone(lean: float, steps: int) -> np.ndarray:
    model, data = compile_disc(lean=lean)
    with knife_edges(model, data, Paraboloid(0.01), TOUCHING):
        mujoco.mj_step(model, data, steps)
    return data.qpos.copy()


def test_several_states_at_once() -> None:
    """Two of one model and one of another, on grounds of their own, in turn."""
    model, data = compile_disc(lean=0.4)
    other = mujoco.MjData(model)
    other.qpos[:], other.qvel[:], _ = steady_state(0.3, 1.0)
    third_model, third = compile_disc(lean=0.5)
    with (
        knife_edges(model, data, Paraboloid(0.01), TOUCHING),
        knife_edges(model, other, Paraboloid(0.01), TOUCHING),
        knife_edges(third_model, third, Paraboloid(0.01), TOUCHING),
    ):
        for _ in range(50):
            mujoco.mj_step(model, data)
            mujoco.mj_step(model, other)
            mujoco.mj_step(third_model, third)
    for state, lean in ((data, 0.4), (other, 0.3), (third, 0.5)):
        np.testing.assert_array_equal(state.qpos, alone(lean, 50))


def test_threads() -> None:
    leans, ends, barrier = [0.2, 0.3, 0.4, 0.5], {}, []

    def ride(lean: float) -> None:
        model, data = models[lean]
        with knife_edges(model, data, Paraboloid(0.01), TOUCHING):
            barrier.append(lean)
            mujoco.mj_step(model, data, 2000)
            ends[lean] = data.qpos.copy()

    models = {lean: compile_disc(lean=lean) for lean in leans}
    threads = [Thread(target=ride, args=(lean,)) for lean in leans]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(barrier) == leans
    assert control_slot().value is None
    for lean in leans:
        np.testing.assert_array_equal(ends[lean], alone(lean, 2000))


def test_other_state_of_the_same_model_needs_a_block() -> None:
    model, data = compile_disc()
    other = mujoco.MjData(model)

    def step() -> None:
        with knife_edges(model, data, Plane(), TOUCHING):
            mujoco.mj_copyData(other, model, data)
            mujoco.mj_forward(model, other)

    with pytest.raises(EngineError, match="another state of the same model was evaluated 1 times"):
        step()


def test_states_may_be_copied_back_and_reset() -> None:
    """Branches from one state: the solver's record does not mistake the copy for its own solution."""
    model, data = compile_disc()
    kept = mujoco.MjData(model)
    with knife_edges(model, data, Plane(), TOUCHING) as contacts:
        mujoco.mj_step(model, data, 10)
        mujoco.mj_copyData(kept, model, data)
        mujoco.mj_step(model, data, 10)
        contacts.look()
        first, largest = data.qpos.copy(), contacts.largest
        mujoco.mj_copyData(data, model, kept)
        mujoco.mj_step(model, data, 10)
        np.testing.assert_array_equal(data.qpos, first)
        assert contacts.standing()
        mujoco.mj_resetData(model, data)
        assert contacts.find_fault() is None
        # Taken for a solution, a reset state or a copy would leave a residual of the order of one.
        assert contacts.largest == largest


# ----------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('tolerance="1e-14"', 'solver="PGS"'), "the solver is PGS"),
        (('tolerance="1e-14"', 'noslip_iterations="3"'), "noslip_iterations"),
        (('tolerance="1e-14"/>', '><flag actuation="disable"/></option>'), "no control callbacks"),
        (('tolerance="1e-14"/>', '><flag contact="disable"/></option>'), "no contacts"),
        (('tolerance="1e-14"/>', '><flag constraint="disable"/></option>'), "no constraint forces"),
        (('tolerance="1e-14"/>', '><flag sleep="enable"/></option>'), "need all bodies awake"),
        (("<freejoint/>", ""), "must belong to a body that moves"),
    ],
)
def test_options_that_nobody_can_vouch_for_are_refused(change, message) -> None:
    xml = disc_mjcf(0.002)
    assert change[0] in xml
    model = mujoco.MjModel.from_xml_string(xml.replace(*change))
    with pytest.raises(ValueError, match=message), knife_edges(model, mujoco.MjData(model), Plane(), TOUCHING):
        pass
    assert control_slot().value is None


def test_options_of_the_solver_are_restored() -> None:
    model, data = compile_disc()
    before = model.opt.iterations, model.opt.ls_iterations, model.opt.tolerance, model.opt.ls_tolerance
    with knife_edges(model, data, Plane(), TOUCHING):
        assert model.opt.iterations > before[0]
        mujoco.mj_step(model, data)
        model.opt.ls_iterations = 77
    assert (model.opt.iterations, model.opt.tolerance, model.opt.ls_tolerance) == (before[0], *before[2:])
    assert model.opt.ls_iterations == 77


def test_options_stay_raised_until_the_last_block_of_a_model_ends() -> None:
    model, data = compile_disc()
    other = mujoco.MjData(model)
    before = model.opt.iterations
    first, second = (knife_edges(model, state, Plane(), TOUCHING) for state in (data, other))
    with ExitStack() as later:
        with first:
            later.enter_context(second)
            mujoco.mj_step(model, data)
        assert model.opt.iterations > before
    assert model.opt.iterations == before


def test_pair_without_reach_is_seen() -> None:
    """A bowl's ground far below the plane that stands for it: MuJoCo never asks for the contact."""
    model, data = compile_disc(('gap="1e9"', ""))
    data.qpos[2] += 3.0

    def step() -> None:
        with knife_edges(model, data, Plane(), TOUCHING):
            model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
            mujoco.mj_step(model, data, 10)

    with pytest.raises(EngineError, match=r"left out a wheel's contact in 10 evaluations; its pair needs gap"):
        step()


def test_rolling_forces_refuse_other_constraints() -> None:
    model, data = compile_disc()  # with a contact pair of MuJoCo's
    with (
        pytest.raises(EngineError, match="MuJoCo's own constraints acted in 4 evaluations"),
        rolling_forces(model, data, Plane(), TOUCHING, STABILISATION),
    ):
        mujoco.mj_step(model, data)


def test_unknown_wheel_in_constrained_is_refused() -> None:
    model, data = compile_disc(*NO_CONTACT)
    with (
        pytest.raises(ValueError, match="constrained names 'weel', which is none of the wheels wheel"),
        rolling_forces(model, data, Plane(), TOUCHING, STABILISATION, {"weel": (True, True, True)}),
    ):
        pass
