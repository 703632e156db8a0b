"""Compiled callbacks in MuJoCo: who is called, for whom, until when, and what if MuJoCo were built otherwise."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

import subprocess
import sys
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from mujoco.introspect import structs

from velodrome.engines.engine import EngineError
from velodrome.engines.mujoco import layout
from velodrome.engines.mujoco.knife_edge import knife_edges, rolling_forces
from velodrome.engines.mujoco.library import collision_slot, control_slot
from velodrome.engines.mujoco.rolling_disc import TOUCHING, disc_mjcf, steady_state
from velodrome.reference.surface import Paraboloid, Plane


def disc(xml: str = disc_mjcf(0.002)) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    qpos, qvel, _ = steady_state(0.4, 1.0)
    data.qpos[:7], data.qvel[:6] = qpos, qvel
    return model, data


def test_what_was_there_is_restored_however_the_block_ends() -> None:
    model, data = disc()
    before = collision_slot().value
    for end in (None, ValueError, KeyboardInterrupt):
        try:
            with knife_edges(model, data, Plane(), TOUCHING):
                assert collision_slot().value != before
                assert control_slot().value is not None
                if end is not None:
                    raise end
        except (ValueError, KeyboardInterrupt):
            pass
        assert collision_slot().value == before
        assert control_slot().value is None


def test_a_state_has_one_block_at_a_time() -> None:
    model, data = disc()
    with knife_edges(model, data, Plane(), TOUCHING):
        with (
            pytest.raises(EngineError, match="one must end before"),
            rolling_forces(model, data, Plane(), TOUCHING, 1.0),
        ):
            pass
        mujoco.mj_forward(model, data)
        # Still the first's: a knife edge's contact is exact, a cylinder's has several points.
        assert data.ncon == 1


def test_other_models_keep_their_own_contacts() -> None:
    model, data = disc()
    other_model, other = disc()
    other.qpos[2] -= 1e-3
    mujoco.mj_forward(other_model, other)
    expected = [other.ncon, *other.contact.dist, *other.contact.pos.ravel(), *other.qacc]
    with knife_edges(model, data, Plane(), TOUCHING):
        mujoco.mj_forward(other_model, other)
        again = [other.ncon, *other.contact.dist, *other.contact.pos.ravel(), *other.qacc]
    # The same computation: only where the solver starts may differ by round-off.
    np.testing.assert_allclose(again, expected, rtol=1e-12, atol=1e-9)


def test_other_wheels_of_the_model_keep_their_own_contacts() -> None:
    """A second, unnamed cylinder lies on the plane: MuJoCo gives it its own contacts."""
    body = '<body pos="5 0 0.0999"><freejoint/><geom type="cylinder" size="0.2 0.1"/></body></worldbody>'
    model, data = disc(disc_mjcf(0.002).replace("</worldbody>", body))
    with knife_edges(model, data, Plane(), TOUCHING):
        mujoco.mj_forward(model, data)
    wheel = model.geom("wheel").id
    assert np.sum(data.contact.geom[:, 1] == wheel) == 1
    assert np.sum(data.contact.geom[:, 1] != wheel) >= 3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('type="cylinder" size="0.3 0.001"', 'type="sphere" size="0.3"'), "'wheel' must be a cylinder"),
        (
            ('name="ground" type="plane" size="0 0 1"', 'name="ground" type="box" size="9 9 9"'),
            "'ground' must be a plane",
        ),
        (('condim="3"', 'condim="4"'), "condim 3"),
        (('margin="1e-3"', ""), "a margin above 0"),
        (('<pair geom1="ground"', '<pair geom1="another"'), "one contact pair of 'ground' and 'wheel', not 0"),
    ],
)
def test_models_that_cannot_work_are_refused(change, message) -> None:
    xml = disc_mjcf(0.002).replace("<worldbody>", '<worldbody><geom name="another" type="plane" size="0 0 1"/>')
    assert change[0] in xml
    model, data = disc(xml.replace(*change))
    with pytest.raises(ValueError, match=message), knife_edges(model, data, Plane(), TOUCHING):
        pass
    assert control_slot().value is None


def test_wheel_without_contact_is_seen_and_flies() -> None:
    model, data = disc()
    with knife_edges(model, data, Paraboloid(0.1), TOUCHING) as contacts:
        # A disc for the plane is a little too low for a bowl.
        mujoco.mj_forward(model, data)
        assert contacts.standing()
        data.qpos[3:7] = [1, 0, 0, 0]  # its axle along z: it lies flat
        mujoco.mj_forward(model, data)
        assert data.ncon == 0
        assert not contacts.standing()


def test_callbacks_that_are_not_called_are_no_ride() -> None:
    model, data = disc()
    with knife_edges(model, data, Plane(), TOUCHING) as contacts, pytest.raises(EngineError, match="did not call"):
        contacts.standing()


def test_wheel_lifts_off() -> None:
    """In the air, but within the contact's margin, a wheel falls freely."""
    model, data = disc()
    data.qpos[2] += 5e-4
    data.qvel[:] = 0
    data.qvel[2] = 1.0
    with knife_edges(model, data, Plane(), TOUCHING):
        mujoco.mj_forward(model, data)
        assert data.ncon == 1
        # The solver stops at 1e-14 of accelerations of 10 m/s^2.
        np.testing.assert_allclose(data.qacc, [0, 0, -9.81, 0, 0, 0], atol=1e-12)


# ---------------------------------------------------------------------------- what if MuJoCo were built otherwise


@pytest.fixture
def unknown_layout():
    """Nothing found out yet, before and after."""
    layout.find_layout.cache_clear()
    layout._structure_layout.cache_clear()
    yield
    layout.find_layout.cache_clear()
    layout._structure_layout.cache_clear()


def test_places_are_those_of_the_views(unknown_layout) -> None:
    found = layout.find_layout()
    assert found.contact_size == mujoco.MjData(disc()[0]).contact.dist.itemsize * 76


@pytest.mark.parametrize(
    ("structure", "field", "message"),
    [("mjData", "nefc", "nefc elsewhere"), ("mjData", "arena", "elsewhere"), ("mjContact", "mu", "elsewhere")],
)
def test_fields_that_moved_give_an_error(unknown_layout, monkeypatch, structure, field, message) -> None:
    """A field of the description is dropped, so the ones behind it are not where it says."""
    declared = structs.STRUCTS[structure]
    fields = tuple(f for f in declared.fields if f.name != field)
    monkeypatch.setitem(structs.STRUCTS, structure, replace(declared, fields=fields))
    before = collision_slot().value
    model, data = disc()
    with (
        pytest.raises(EngineError, match=f"MuJoCo {mujoco.__version__} .*({message}|describes itself)"),
        knife_edges(model, data, Plane(), TOUCHING),
    ):
        pass
    assert collision_slot().value == before
    assert control_slot().value is None


def test_another_function_gives_an_error(unknown_layout, monkeypatch) -> None:
    monkeypatch.setitem(layout._CALLED, "mj_jac", "const mjModel * | int")
    with pytest.raises(EngineError, match="another function mj_jac"):
        layout.find_layout()


def test_listing_the_ladder_does_not_load_mujoco() -> None:
    code = (
        "from velodrome.engines.mujoco import default, native, exact_contact, multipliers as m; m.ENGINE.version; "
        "import sys; "
        "sys.exit(any(name in sys.modules for name in ('mujoco', 'velodrome.engines.mujoco.compiled')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
