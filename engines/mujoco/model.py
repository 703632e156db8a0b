"""The bicycle as a MuJoCo model (MJCF), built from its parameters.

The tree is a free rear frame that carries the rear wheel and the front frame, which carries the front
wheel; all joints are ideal hinges. The rear frame's origin is D, so the free joint's position and
linear velocity are D's own. At rest every body's axes are the inertial ones.

What touches is one of three:

- "plane", "planes": a wheel is an ellipsoid 0.2 mm thick, since MuJoCo has no knife edge, and its contact
  with a plane is a single, smooth, analytic point, where a mesh or a cylinder gives a noisy or jumping
  set of points. The ground is one plane, or one plane a wheel that moves with the surface's tangent
  plane (a body driven from outside, "mocap").
- "edges": a wheel is a cylinder, and a plane stands for the ground; `knife_edge` tells MuJoCo where they
  touch.
- "nothing": the wheels' geoms carry their frames only.
"""

from __future__ import annotations

from typing import Literal
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.kinematics import WHEELS
from .settings import ContactSettings, StepSettings
from .tangent import HALF_THICKNESS

Touching = Literal["plane", "planes", "edges", "nothing"]
# A start on the constraints has gaps of round-off, of either sign, and MuJoCo gives a pair apart no
# contact at all. Within a nanometre of the ground a wheel counts as touching it.
MARGIN = 1e-9
# A knife edge keeps its rows within this distance [m]. It is not held there: the callbacks take it out.
EDGE_MARGIN = 1e-3
# The plane that stands for curved ground may be as far from a wheel as it likes [m].
EDGE_REACH = 1e9


def _text(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)


def _body(parent: Element, bicycle: Bicycle, name: str, carrier: np.ndarray, origin: np.ndarray) -> Element:
    """Add a body with its inertia; ``origin`` and its carrier's are points of the bicycle at rest (3,)."""
    body = SubElement(parent, "body", name=name, pos=_text(*(origin - carrier)))
    tensor = bicycle.inertia(name)
    entries = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    mass, centre = _text(bicycle.body_mass(name)), _text(*(bicycle.centre(name) - origin))
    SubElement(body, "inertial", pos=centre, mass=mass, fullinertia=_text(*entries))
    return body


def _hinge(body: Element, name: str, axis: np.ndarray) -> None:
    SubElement(body, "joint", name=name, type="hinge", axis=_text(*axis))


def _wheel(parent: Element, bicycle: Bicycle, wheel: str, carrier: np.ndarray, touching: Touching) -> None:
    name = f"{wheel}_wheel"
    body = _body(parent, bicycle, name, carrier, bicycle.centre(name))
    _hinge(body, f"{wheel}_angle", np.array([0.0, 1.0, 0.0]))
    radius = getattr(bicycle, f"{name}_radius")
    if touching in ("plane", "planes"):
        shape = {"type": "ellipsoid", "size": _text(radius, HALF_THICKNESS, radius)}
    else:
        shape = {"type": "cylinder", "size": _text(radius, HALF_THICKNESS), "zaxis": "0 1 0"}
    SubElement(body, "geom", {"name": wheel} | shape)


def _ground(world: Element, touching: Touching) -> dict[str, str]:
    """Add the planes; returns the name of the plane below each wheel."""
    if touching != "planes":
        SubElement(world, "geom", name="ground", type="plane", size="0 0 1")
        return dict.fromkeys(WHEELS, "ground")
    names = {wheel: f"ground_{wheel}" for wheel in WHEELS}
    for name in names.values():
        body = SubElement(world, "body", name=name, mocap="true")
        SubElement(body, "geom", name=name, type="plane", size="0 0 1")
    return names


def _options(root: Element, bicycle: Bicycle, settings: StepSettings) -> None:
    options = {
        "timestep": _text(settings.step),
        "integrator": settings.integrator,
        "gravity": _text(0.0, 0.0, -bicycle.gravity),
    }
    if isinstance(settings, ContactSettings):
        options |= {
            "cone": settings.cone,
            "impratio": _text(settings.impratio),
            "tolerance": _text(settings.tolerance),
            "noslip_iterations": str(settings.noslip_iterations),
        } | {name: str(value) for name, value in settings.solver_options.items()}
    option = SubElement(root, "option", options)
    # An unstable run must end as one, not start again from the model's initial state.
    SubElement(option, "flag", autoreset="disable")


def _pairs(root: Element, settings: ContactSettings, planes: dict[str, str], touching: Touching) -> None:
    contact = SubElement(root, "contact")
    margin, reach = (EDGE_MARGIN, EDGE_REACH) if touching == "edges" else (MARGIN, 0.0)
    for wheel in WHEELS:
        SubElement(
            contact,
            "pair",
            geom1=planes[wheel],
            geom2=wheel,
            condim="3",
            friction=_text(settings.friction, settings.friction, 0.0, 0.0, 0.0),
            solref=_text(settings.contact_time, settings.damping_ratio),
            solimp=_text(*settings.impedance),
            margin=_text(margin),
            gap=_text(reach),
        )


def mjcf(bicycle: Bicycle, settings: StepSettings, touching: Touching) -> str:
    """The model's XML.

    Parameters
    ----------
    bicycle : Bicycle
    settings : StepSettings
        `ContactSettings` where anything touches.
    touching : {"plane", "planes", "edges", "nothing"}

    Returns
    -------
    str
    """
    root = Element("mujoco", model="bicycle")
    SubElement(root, "compiler", inertiafromgeom="false")
    _options(root, bicycle, settings)
    # Only the pairs declared below may touch: a plane must not see the other plane's wheel.
    SubElement(SubElement(root, "default"), "geom", contype="0", conaffinity="0")
    world = SubElement(root, "worldbody")
    planes = _ground(world, touching)
    origin = bicycle.reference_point
    rear = _body(world, bicycle, "rear_frame", np.zeros(3), origin)
    SubElement(rear, "freejoint", name="frame")
    _wheel(rear, bicycle, "rear", origin, touching)
    front = _body(rear, bicycle, "front_frame", origin, origin)
    _hinge(front, "steer", bicycle.steer_axis)
    _wheel(front, bicycle, "front", origin, touching)
    if isinstance(settings, ContactSettings):
        _pairs(root, settings, planes, touching)
    return tostring(root, encoding="unicode")
