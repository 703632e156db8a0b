"""The bicycle as a MuJoCo model (MJCF), built from its parameters.

The tree is a free rear frame that carries the rear wheel and the front frame, which carries the front
wheel. All joints are ideal hinges. The origin of the rear frame's body is D, so the free joint's position and
linear velocity are those of D. At rest the axes of every body are the inertial ones.

There are three ways of contact:

- "plane", "planes": a wheel is an ellipsoid 0.2 mm thick, since MuJoCo has no knife edge. Its contact
  with a plane is a single, smooth, analytic point; a mesh or a cylinder gives a noisy or jumping set of points.
  The ground is one plane, or one plane per wheel that moves with the surface's tangent plane (a body with
  prescribed motion, "mocap").
- "edges": a wheel is a cylinder, and a plane stands for the ground; `knife_edge` gives MuJoCo the contact points.
- "nothing": there is no contact; the wheels' geoms only mark their frames.
"""

from __future__ import annotations

from typing import Literal
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from ...reference.bicycle import Bicycle
from ...reference.kinematics import WHEELS
from .releases import GAP, RESET, is_present
from .settings import SoftContactSettings, StepSettings
from .tangent import HALF_THICKNESS

Touching = Literal["plane", "planes", "edges", "nothing"]
# A start that fulfils the constraints has gaps of the order of round-off, of either sign, and MuJoCo makes no contact
# for a pair with a positive gap. Within this distance of the ground a wheel counts as touching it [m].
MARGIN = 1e-9
# Distance up to which a knife edge keeps its contact rows [m]; the callbacks cancel its effect on the equilibrium.
EDGE_MARGIN = 1e-3
# Largest distance of a wheel from the plane that stands for curved ground [m].
EDGE_REACH = 1e9


def _number_text(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)


def _add_body(parent: Element, bicycle: Bicycle, name: str, carrier: np.ndarray, origin: np.ndarray) -> Element:
    """Add a body with its inertia; ``origin`` and ``carrier`` are its own and its parent's origin at rest (3,) [m]."""
    body = SubElement(parent, "body", name=name, pos=_number_text(*(origin - carrier)))
    tensor = bicycle.inertia(name)
    entries = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    mass, centre = _number_text(bicycle.body_mass(name)), _number_text(*(bicycle.centre(name) - origin))
    SubElement(body, "inertial", pos=centre, mass=mass, fullinertia=_number_text(*entries))
    return body


def _add_hinge(body: Element, name: str, axis: np.ndarray, damping: float = 0.0) -> None:
    joint = SubElement(body, "joint", name=name, type="hinge", axis=_number_text(*axis))
    if damping != 0:
        joint.set("damping", _number_text(damping))


def _add_wheel(parent: Element, bicycle: Bicycle, wheel: str, carrier: np.ndarray, touching: Touching) -> None:
    name = f"{wheel}_wheel"
    body = _add_body(parent, bicycle, name, carrier, bicycle.centre(name))
    _add_hinge(body, f"{wheel}_angle", np.array([0.0, 1.0, 0.0]))
    radius = getattr(bicycle, f"{name}_radius")
    if touching in ("plane", "planes"):
        shape = {"type": "ellipsoid", "size": _number_text(radius, HALF_THICKNESS, radius)}
    else:
        shape = {"type": "cylinder", "size": _number_text(radius, HALF_THICKNESS), "zaxis": "0 1 0"}
    SubElement(body, "geom", {"name": wheel} | shape)


def _add_ground(world: Element, touching: Touching) -> dict[str, str]:
    """Add the planes and return the name of the plane below each wheel."""
    if touching != "planes":
        SubElement(world, "geom", name="ground", type="plane", size="0 0 1")
        return dict.fromkeys(WHEELS, "ground")
    names = {wheel: f"ground_{wheel}" for wheel in WHEELS}
    for name in names.values():
        body = SubElement(world, "body", name=name, mocap="true")
        SubElement(body, "geom", name=name, type="plane", size="0 0 1")
    return names


def _add_options(root: Element, bicycle: Bicycle, settings: StepSettings) -> None:
    options = {
        "timestep": _number_text(settings.step),
        "integrator": settings.integrator,
        "gravity": _number_text(0.0, 0.0, -bicycle.gravity),
    }
    if isinstance(settings, SoftContactSettings):
        options |= {
            "cone": settings.cone,
            "impratio": _number_text(settings.impratio),
            "tolerance": _number_text(settings.tolerance),
        } | {name: str(value) for name, value in settings.solver_options.items()}
    option = SubElement(root, "option", options)
    # An unstable run must end; without this flag MuJoCo resets the state to the model's initial state. Releases that
    # lack the flag leave a warning when they do, by which `find_trouble` ends the run.
    if is_present(RESET):
        SubElement(option, "flag", autoreset="disable")


def _add_contact_pairs(
    root: Element, settings: SoftContactSettings, planes: dict[str, str], touching: Touching
) -> None:
    contact = SubElement(root, "contact")
    margin, reach = (EDGE_MARGIN, EDGE_REACH) if touching == "edges" else (MARGIN, 0.0)
    detected = margin if is_present(GAP) else margin + reach
    for wheel in WHEELS:
        SubElement(
            contact,
            "pair",
            geom1=planes[wheel],
            geom2=wheel,
            condim="3",
            friction=_number_text(settings.friction, settings.friction, 0.0, 0.0, 0.0),
            solref=_number_text(settings.contact_time, settings.damping_ratio),
            solimp=_number_text(*settings.impedance),
            margin=_number_text(detected),
            gap=_number_text(reach),
        )


def mjcf(bicycle: Bicycle, settings: StepSettings, touching: Touching, steer_damping: float = 0.0) -> str:
    """Return the model's XML.

    Parameters
    ----------
    bicycle : Bicycle
    settings : StepSettings
        `SoftContactSettings` where there is contact.
    touching : {"plane", "planes", "edges", "nothing"}
    steer_damping : float
        [N m s/rad].

    Returns
    -------
    str
    """
    root = Element("mujoco", model="bicycle")
    SubElement(root, "compiler", inertiafromgeom="false")
    _add_options(root, bicycle, settings)
    # Only the pairs declared below may touch: a plane must not touch the other plane's wheel.
    SubElement(SubElement(root, "default"), "geom", contype="0", conaffinity="0")
    world = SubElement(root, "worldbody")
    planes = _add_ground(world, touching)
    origin = bicycle.reference_point
    rear = _add_body(world, bicycle, "rear_frame", np.zeros(3), origin)
    SubElement(rear, "freejoint", name="frame")
    _add_wheel(rear, bicycle, "rear", origin, touching)
    front = _add_body(rear, bicycle, "front_frame", origin, origin)
    _add_hinge(front, "steer", bicycle.steer_axis, steer_damping)
    _add_wheel(front, bicycle, "front", origin, touching)
    if isinstance(settings, SoftContactSettings):
        _add_contact_pairs(root, settings, planes, touching)
    return tostring(root, encoding="unicode")
