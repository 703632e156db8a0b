import math
from dataclasses import replace

import numpy as np
import pytest

from tests.literature import published
from velodrome.reference.bicycle import BODIES, Bicycle
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
        ({"front_wheel_mass": 0.0}, "front_wheel_mass"),
        ({"wheelbase": math.nan}, "wheelbase"),
        ({"trail": math.inf}, "trail"),
        ({"gravity": True}, "gravity"),
        ({"steer_axis_tilt": 1.6}, "steer_axis_tilt"),
        ({"front_wheel_Iyy": 0.3}, "front_wheel_I"),  # more than twice Ixx: no rigid body
        ({"rear_frame_Ixz": 6.0}, "rear_frame_I"),  # not positive definite
    ],
)
def test_impossible_parameters_are_refused(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        replace(Bicycle(), **change)
    assert "\n" not in str(caught.value)
