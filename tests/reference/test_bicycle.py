import math
from dataclasses import replace

import numpy as np
import pytest

from tests.literature import published
from velodrome.reference.bicycle import BODIES, Bicycle, require_rigid_bodies
from velodrome.reference.kinematics import constants

TABLE = published("meijaard2007")["parameters"]


def test_defaults_are_the_published_parameters() -> None:
    bicycle = Bicycle()
    # (ours, Meijaard's name, sign): z points down in the table.
    for name, symbol, sign in (
        *(("wheelbase", "w", 1), ("trail", "c", 1), ("gravity", "g", 1)),
        *(("rear_wheel_radius", "rR", 1), ("rear_wheel_mass", "mR", 1)),
        *(("rear_wheel_Ixx", "IRxx", 1), ("rear_wheel_Iyy", "IRyy", 1)),
        *(("rear_frame_x", "xB", 1), ("rear_frame_z", "zB", -1), ("rear_frame_mass", "mB", 1)),
        *(("rear_frame_Ixx", "IBxx", 1), ("rear_frame_Iyy", "IByy", 1)),
        *(("rear_frame_Izz", "IBzz", 1), ("rear_frame_Ixz", "IBxz", -1)),
        *(("front_frame_x", "xH", 1), ("front_frame_z", "zH", -1), ("front_frame_mass", "mH", 1)),
        *(("front_frame_Ixx", "IHxx", 1), ("front_frame_Iyy", "IHyy", 1)),
        *(("front_frame_Izz", "IHzz", 1), ("front_frame_Ixz", "IHxz", -1)),
        *(("front_wheel_radius", "rF", 1), ("front_wheel_mass", "mF", 1)),
        *(("front_wheel_Ixx", "IFxx", 1), ("front_wheel_Iyy", "IFyy", 1)),
    ):
        assert getattr(bicycle, name) == sign * TABLE[symbol], name
    assert TABLE["lam"] == "pi/10"
    assert bicycle.steer_axis_tilt == math.pi / 10


def test_reference_point_lies_on_the_steering_axis_at_the_front_hub() -> None:
    bicycle = Bicycle()
    x, _, z = bicycle.reference_point
    assert z == TABLE["rF"]
    # The axis meets the ground ahead of the front contact by the trail.
    assert x + z * math.tan(bicycle.steer_axis_tilt) == pytest.approx(TABLE["w"] + TABLE["c"], abs=1e-15)
    assert x == pytest.approx(0.986, abs=5e-4)


def test_assemblies_keep_mass_and_centre() -> None:
    bicycle = Bicycle()
    c = constants(bicycle)
    assert c.m1 + c.m2 == pytest.approx(bicycle.mass, rel=1e-15)
    moments = [bicycle.body_mass(body) * (bicycle.centre(body) - bicycle.reference_point) for body in BODIES]
    moment = np.sum(moments, axis=0)
    assert np.allclose([c.s1x + c.s2x, c.s1z + c.s2z], moment[[0, 2]], rtol=1e-14)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rear_frame_mass": -85.0}, "rear_frame_mass"),
        ({"front_wheel_mass": 0.0}, "front_wheel_I.*without mass"),
        ({"wheelbase": math.nan}, "wheelbase"),
        ({"trail": math.inf}, "trail"),
        ({"gravity": True}, "gravity"),
        ({"steer_axis_tilt": 1.6}, "steer_axis_tilt"),
        ({"rear_frame_Ixz": 6.0}, "rear_frame_I"),  # not positive definite
    ],
)
def test_impossible_parameters_are_refused(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        replace(Bicycle(), **change)
    assert "\n" not in str(caught.value)


def test_a_broken_triangle_inequality_is_told_with_its_size() -> None:
    ring = replace(Bicycle(), front_wheel_Iyy=2 * Bicycle().front_wheel_Ixx)
    assert ring.warnings() == ()
    measured = replace(Bicycle(), front_wheel_Iyy=1.03 * ring.front_wheel_Iyy)
    (line,) = measured.warnings()
    assert "front_wheel: " in line
    assert "by 3 %" in line
    require_rigid_bodies(measured)
    with pytest.raises(ValueError, match=r"front_wheel_I.*by 6.76 %"):
        require_rigid_bodies(replace(Bicycle(), front_wheel_Iyy=0.3))


def test_bodies_may_be_points_and_wheels_may_have_no_mass() -> None:
    none = {f"{body}_I{axes}": 0.0 for body in ("rear_frame", "front_frame") for axes in ("xx", "yy", "zz", "xz")}
    none |= {f"{wheel}_{part}": 0.0 for wheel in ("rear_wheel", "front_wheel") for part in ("mass", "Ixx", "Iyy")}
    assert replace(Bicycle(), **none).warnings() == ()
    with pytest.raises(ValueError, match="at least one body must have mass"):
        replace(Bicycle(), **none, rear_frame_mass=0.0, front_frame_mass=0.0)
