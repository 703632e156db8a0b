"""The picture of the ground: on the surface everywhere, and no further than there is ground."""

import numpy as np
import pytest

from velodrome.reference.bowls import Sphere, Torus
from velodrome.reference.height_field import HeightField
from velodrome.reference.profile import SplineProfile
from velodrome.reference.surface import Paraboloid, Plane, Surface, evaluate
from velodrome.reports.drawing.ground import STEEPEST, GroundMesh, make_ground

REACH = STEEPEST / np.hypot(1, STEEPEST)  # sine of the steepest slope that is drawn
TURN = np.linspace(0, 2 * np.pi, 200)
ROUND, ALONG = np.column_stack([np.cos(TURN), np.sin(TURN)]), np.column_stack([np.linspace(0, 9, 50), np.zeros(50)])
x, y = np.arange(12.0)[:, None] - 1, np.arange(8.0)[None, :] - 3.5
FIELD = HeightField((0.1 * np.sin(x) * np.cos(y)).tolist(), 1.0, (-1.0, -3.5))


def everything(ground: GroundMesh) -> np.ndarray:
    return np.concatenate([ground.vertices, ground.normals, ground.edge, ground.wall, *ground.lines])


@pytest.mark.parametrize(
    ("surface", "path", "inner", "outer"),
    [
        (Paraboloid(0.2), 3 * ROUND, 0.0, 4.2),
        (Plane(), ALONG, None, None),
        # To the slope of 5 where the rim lies inside the margin,
        (Sphere(3.5), 3 * ROUND, 0.0, 3.5 * REACH),
        (Torus(20.0, 5.0), 20 * ROUND, 20 - 5 * REACH, 20 + 5 * REACH),
        # to the points,
        (SplineProfile((2.0, 2.5, 3.0, 4.0), (0.0, 0.1, 0.4, 2.0)), 3 * ROUND, 2.0, 4.0),
        # to the grid's edge, 1 m behind the axis; or along the part of a ride that is on the grid.
        (FIELD, 0.9 * ROUND, 0.0, None),
        (FIELD, 2 * ROUND, None, None),
        (FIELD, ALONG, None, None),
        (Sphere(10.0), ALONG, None, None),
    ],
)
def test_ground_is_drawn_as_far_as_there_is_any(
    surface: Surface, path: np.ndarray, inner: float | None, outer: float | None
) -> None:
    ground = make_ground(surface, path)
    assert np.isfinite(everything(ground)).all()
    assert np.isfinite(ground.brightness).all()
    vertices = ground.vertices
    np.testing.assert_allclose(vertices[:, 2], evaluate(surface, vertices[:, 0], vertices[:, 1])[:, 0], atol=1e-12)
    radii = np.linalg.norm(vertices[:, :2], axis=1)
    # Halving 40 times finds an edge to 1e-11 of some 10 m.
    if inner is not None:
        assert radii.min() == pytest.approx(inner, abs=1e-9)
    if outer is not None:
        assert radii.max() == pytest.approx(outer, abs=1e-9)


def test_a_steep_ride_has_ground_on_both_sides() -> None:
    """At the slope of 6 of a deep paraboloid."""
    ground = make_ground(Paraboloid(1.0), 3 * ROUND)
    assert np.linalg.norm(ground.vertices[:, :2], axis=1).max() == pytest.approx(4.2)


def test_a_ride_that_has_left_the_ground_is_left_out() -> None:
    path = np.concatenate([ALONG, [[60.0, 0.0]]])
    ground = make_ground(FIELD, path)
    assert np.isfinite(everything(ground)).all()
    assert ground.vertices[:, 0].max() == pytest.approx(10.0, abs=1e-9)
