"""Units and meanings of the bicycle's parameters for documents and tables."""

from __future__ import annotations

from typing import NamedTuple

from ...reference.bicycle import BODIES, Bicycle


class Parameter(NamedTuple):
    """Unit and meaning of a parameter."""

    unit: str
    meaning: str


_OF_THE_WHOLE = {
    "wheelbase": Parameter("m", "distance between the contact points of the upright bicycle"),
    "trail": Parameter("m", "by how much the front contact lies behind the steering axis on the ground"),
    "steer_axis_tilt": Parameter("rad", "tilt of the steering axis from the vertical, backwards"),
    "gravity": Parameter("m/s^2", "gravitational acceleration"),
}
_OF_A_BODY = {
    "radius": ("m", "radius of the {body}'s knife edge"),
    "mass": ("kg", "mass of the {body}"),
    "x": ("m", "centre of mass of the {body}, forward of the rear contact"),
    "z": ("m", "centre of mass of the {body}, above the ground"),
    "Ixx": ("kg m^2", "moment of inertia of the {body} about x, forward"),
    "Iyy": ("kg m^2", "moment of inertia of the {body} about y, to the left"),
    "Izz": ("kg m^2", "moment of inertia of the {body} about z, up"),
    "Ixz": ("kg m^2", "entry xz of the {body}'s inertia tensor"),
}


def _describe(name: str) -> Parameter:
    if name in _OF_THE_WHOLE:
        return _OF_THE_WHOLE[name]
    body = next(body for body in BODIES if name.startswith(body))
    unit, meaning = _OF_A_BODY[name.removeprefix(f"{body}_")]
    words = {"rear_wheel_Ixx": "a diameter", "front_wheel_Ixx": "a diameter"}.get(name)
    axle = name.endswith("wheel_Iyy")
    text = meaning.format(body=body.replace("_", " "))
    if words or axle:
        text = f"{text.partition(' about ')[0]} about {words or 'the axle'}"
    return Parameter(unit, text)


PARAMETERS = {name: _describe(name) for name in Bicycle.__dataclass_fields__}
