"""Singular equations of motion: which bicycles have them, and which motion is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state, dynamics, residual
from velodrome.reference.regularity import require_inertia_in_turns, require_inertia_upright
from velodrome.reference.surface import Plane
from velodrome.reference.upright import canonical_matrices

MASSLESS = {f"{wheel}_wheel_{what}": 0.0 for wheel in ("rear", "front") for what in ("mass", "Ixx", "Iyy")}
NO_FRONT = {f"front_frame_{what}": 0.0 for what in ("mass", "Ixx", "Iyy", "Izz", "Ixz")}
POINT = {f"rear_frame_{what}": 0.0 for what in ("Ixx", "Iyy", "Izz", "Ixz")}
# Kooijman et al. (2011): two point masses on massless skates.
SKATE = Bicycle(
    wheelbase=1.0,
    trail=0.0,
    steer_axis_tilt=np.pi / 36,
    rear_wheel_radius=0.1,
    front_wheel_radius=0.1,
    rear_frame_x=1.2,
    rear_frame_z=0.4,
    rear_frame_mass=10.0,
    front_frame_x=1.02,
    front_frame_z=0.2,
    **{**MASSLESS, **NO_FRONT, **POINT, "front_frame_mass": 1.0},
)
ON_AXIS = SKATE.wheelbase - SKATE.front_frame_z * np.tan(SKATE.steer_axis_tilt)
REGULAR = {
    "benchmark": Bicycle(),
    "massless wheels": replace(Bicycle(), **MASSLESS),
    "two-mass skate": SKATE,
    "no front assembly, but trail": replace(Bicycle(), **MASSLESS, **NO_FRONT),
    "front mass on the axis, but trail": replace(SKATE, trail=0.1, front_frame_x=ON_AXIS + 0.1),
    "light front assembly": replace(Bicycle(), trail=0.0, **{**MASSLESS, **NO_FRONT, "front_frame_mass": 4e-9}),
}
SINGULAR = {
    "no front assembly": (replace(SKATE, front_frame_mass=0.0), "singular: steer has no inertia: neither the front"),
    "front mass on the axis": (replace(SKATE, front_frame_x=ON_AXIS), "singular: steer has no inertia"),
    "no front assembly, no trail": (replace(Bicycle(), trail=0.0, **MASSLESS, **NO_FRONT), "steer has no inertia"),
    "on the ground": (replace(SKATE, rear_frame_z=0.0, front_frame_z=0.0), "singular: lean has no inertia"),
    "a single point": (
        replace(Bicycle(), **MASSLESS, **NO_FRONT, **POINT),
        r"a combination of lean, steer and rolling has no inertia: with their rates in the ratio 0\.02\d+ : 1 : 0",
    ),
}


@pytest.mark.parametrize("bicycle", REGULAR.values(), ids=REGULAR)
def test_bodies_without_inertia_are_no_fault_where_the_constraints_leave_none_out(bicycle: Bicycle) -> None:
    require_inertia_upright(bicycle)
    require_inertia_in_turns(bicycle)
    q, qd = consistent_state(bicycle, Plane(), (1.0, 0.0), 0.1, 0.05, (0.02, 0.01, 20.0))
    found = dynamics(bicycle, Plane(), q, qd)
    assert np.all(np.isfinite(found.acceleration))
    assert np.all(np.isfinite(found.force))


@pytest.mark.parametrize(("bicycle", "said"), SINGULAR.values(), ids=SINGULAR)
def test_a_motion_without_inertia_is_named(bicycle: Bicycle, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        require_inertia_upright(bicycle)


@pytest.mark.parametrize("bicycle", REGULAR.values(), ids=REGULAR)
def test_a_regular_bicycle_has_a_regular_canonical_mass_matrix(bicycle: Bicycle) -> None:
    mass = canonical_matrices(bicycle).M
    size = np.sqrt(np.diag(mass))
    assert np.linalg.cond(mass / np.outer(size, size)) < 1e9


@pytest.mark.parametrize(("bicycle", "said"), SINGULAR.values(), ids=SINGULAR)
def test_a_singular_bicycle_has_a_singular_canonical_mass_matrix(bicycle: Bicycle, said: str) -> None:
    mass = canonical_matrices(bicycle).M
    # Round-off of the terms that the determinant consists of.
    assert abs(np.linalg.det(mass)) <= 1e-14 * max(mass[0, 0] * mass[1, 1], 1e-14 * mass.max() ** 2)


def test_accelerations_and_forces_of_a_skate_solve_the_equations() -> None:
    """The mass matrix of its tree has no inverse; that of the whole system has."""
    q, qd = consistent_state(SKATE, Plane(), (1.0, 0.0), 0.1, 0.05, (0.02, 0.01, 20.0))
    found = dynamics(SKATE, Plane(), q, qd)
    rows = residual(SKATE, Plane(), q, qd, found.acceleration, found.contact.ravel(), found.force.ravel())
    assert np.abs(rows).max() < 1e-12
