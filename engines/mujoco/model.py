"""The bicycle as a MuJoCo model (MJCF), built from its parameters.

The tree is a free rear frame that carries the rear wheel and the front frame, which carries the front
wheel; all joints are ideal hinges. The rear frame's origin is D, so the free joint's position and
linear velocity are D's own. At rest every body's axes are the inertial ones.

A wheel is an ellipsoid 0.2 mm thick: MuJoCo has no knife edge, and its contact with a plane is a
single, smooth, analytic point, where a mesh or a cylinder gives a noisy or jumping set of points. The
ground is one plane, or one plane a wheel that moves with the surface's tangent plane (a body driven
from outside, "mocap").
"""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from engines.mujoco.settings import NativeSettings
from engines.mujoco.tangent import HALF_THICKNESS
from reference.bicycle import Bicycle
from reference.kinematics import WHEELS

# A start on the constraints has gaps of round-off, of either sign, and MuJoCo gives a pair apart no
# contact at all. Within a nanometre of the ground a wheel counts as touching it.
MARGIN = 1e-9
# MuJoCo's default impedances; the largest of them enters the damping of every contact row.
IMPEDANCE = (0.9, 0.95, 0.001, 0.5, 2.0)


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


def _wheel(parent: Element, bicycle: Bicycle, wheel: str, carrier: np.ndarray) -> None:
    name = f"{wheel}_wheel"
    body = _body(parent, bicycle, name, carrier, bicycle.centre(name))
    _hinge(body, f"{wheel}_angle", np.array([0.0, 1.0, 0.0]))
    radius = getattr(bicycle, f"{name}_radius")
    SubElement(body, "geom", name=wheel, type="ellipsoid", size=_text(radius, HALF_THICKNESS, radius))


def _ground(world: Element, moving: bool) -> dict[str, str]:
    """Add the planes; returns the name of the plane below each wheel."""
    if not moving:
        SubElement(world, "geom", name="ground", type="plane", size="0 0 1")
        return dict.fromkeys(WHEELS, "ground")
    names = {wheel: f"ground_{wheel}" for wheel in WHEELS}
    for name in names.values():
        body = SubElement(world, "body", name=name, mocap="true")
        SubElement(body, "geom", name=name, type="plane", size="0 0 1")
    return names


def mjcf(bicycle: Bicycle, settings: NativeSettings, moving: bool) -> str:
    """The model's XML.

    Parameters
    ----------
    bicycle : Bicycle
    settings : NativeSettings
    moving : bool
        One moving plane a wheel instead of a single resting one.

    Returns
    -------
    str
    """
    root = Element("mujoco", model="bicycle")
    SubElement(root, "compiler", inertiafromgeom="false")
    option = SubElement(
        root,
        "option",
        timestep=_text(settings.step),
        integrator=settings.integrator,
        cone=settings.cone,
        impratio=_text(settings.impratio),
        tolerance=_text(settings.tolerance),
        gravity=_text(0.0, 0.0, -bicycle.gravity),
    )
    # An unstable run must end as one, not start again from the model's initial state.
    SubElement(option, "flag", autoreset="disable")
    # Only the pairs declared below may touch: a plane must not see the other plane's wheel.
    SubElement(SubElement(root, "default"), "geom", contype="0", conaffinity="0")
    world = SubElement(root, "worldbody")
    planes = _ground(world, moving)
    origin = bicycle.reference_point
    rear = _body(world, bicycle, "rear_frame", np.zeros(3), origin)
    SubElement(rear, "freejoint", name="frame")
    _wheel(rear, bicycle, "rear", origin)
    front = _body(rear, bicycle, "front_frame", origin, origin)
    _hinge(front, "steer", bicycle.steer_axis)
    _wheel(front, bicycle, "front", origin)
    contact = SubElement(root, "contact")
    for wheel in WHEELS:
        SubElement(
            contact,
            "pair",
            geom1=planes[wheel],
            geom2=wheel,
            condim="3",
            friction=_text(settings.friction, settings.friction, 0.0, 0.0, 0.0),
            solref=_text(settings.contact_time, settings.damping_ratio),
            solimp=_text(*IMPEDANCE),
            margin=_text(MARGIN),
        )
    return tostring(root, encoding="unicode")
