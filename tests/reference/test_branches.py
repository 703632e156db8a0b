"""Motions found from branches on neighbouring bowls are those of the full search, to the bit."""

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.branches import MotionRequest, find_family_motions
from velodrome.reference.families import FAMILIES, find_motion
from velodrome.reference.missing_motion import NoSuchMotion, SearchFailed
from velodrome.reference.surface import Paraboloid, Plane, SurfaceOfRevolution

BICYCLE = Bicycle()
# Rear rates that a family has somewhere, its folds and ends included [rad/s].
RATES = {1: (1.0, 24.0), 2: (2.0, 30.0), 3: (0.2, 60.0), 4: (0.2, 30.0)}


def draw_requests(family: int, count: int, seed: int, a_cell: int = 12) -> list[MotionRequest]:
    """Draw motions on bowls that lie near each other in groups."""
    rng, requests = np.random.default_rng(seed), list[MotionRequest]()
    while len(requests) < count:
        alphas = 0.5 * rng.random() ** 3 + 2e-4 * rng.random(a_cell)
        bowls, rates = [Paraboloid(float(alpha)) for alpha in alphas], rng.uniform(*RATES[family], a_cell)
        requests += [MotionRequest(BICYCLE, bowl, float(rate), family) for bowl, rate in zip(bowls, rates, strict=True)]
    return requests[:count]


def compare_with_search(requests: list[MotionRequest]) -> tuple[int, int]:
    """Assert that motions are those of the full search; return how many were found, and how many there are."""
    found, existing = 0, 0
    for request, motion in zip(requests, find_family_motions(requests), strict=True):
        try:
            _, searched = find_motion(request.bicycle, request.surface, request.rear_rate, request.family, request.near)
        except (NoSuchMotion, SearchFailed):
            assert motion is None, request
            continue
        existing += 1
        if motion is not None:
            found += 1
            for name in ("position", "contact", "force"):
                np.testing.assert_array_equal(getattr(motion, name), getattr(searched, name), err_msg=str(request))
            np.testing.assert_array_equal(motion.state(), searched.state(), err_msg=str(request))
            assert motion.residual == searched.residual
    return found, existing


@pytest.mark.parametrize("family", FAMILIES)
def test_motions_are_those_of_the_full_search(family: int) -> None:
    found, existing = compare_with_search(draw_requests(family, 36, family))
    assert found > 0.5 * existing > 0


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_thousands_of_motions_are_those_of_the_full_search(family: int) -> None:
    found, existing = compare_with_search(draw_requests(family, 1500, 100 + family))
    assert found > 0.5 * existing > 0


@pytest.mark.parametrize("ground", [Plane(), Paraboloid(0.03)])
def test_rates_near_folds(ground: SurfaceOfRevolution) -> None:
    """Towards the largest rate of family 1, and the smallest of family 2, motions are found or left to the search."""
    requests = [MotionRequest(BICYCLE, ground, float(rate), 1) for rate in np.linspace(19.5, 22.0, 20)]
    requests += [MotionRequest(BICYCLE, ground, float(rate), 2) for rate in np.linspace(14.5, 16.0, 20)]
    found, existing = compare_with_search(requests)
    assert 0 < found <= existing


def test_nearest_motions_are_those_of_the_full_search() -> None:
    rng = np.random.default_rng(0)
    requests = [
        MotionRequest(BICYCLE, Paraboloid(float(alpha)), float(rate), 2, near)
        for alpha in rng.uniform(0.005, 0.0052, 3)
        for rate in rng.uniform(17.5, 18.5, 2)
        for near in ((0.74, 2.84), (-0.74, -2.84), (0.3, 2.0))
    ]
    found, existing = compare_with_search(requests)
    assert found == existing == 12  # there is no motion near the third


def test_results_do_not_depend_on_the_neighbours() -> None:
    requests = draw_requests(2, 24, 7)
    together = find_family_motions(requests)
    for request, motion in zip(requests[::-1], together[::-1], strict=True):
        (alone,) = find_family_motions([request])
        assert (alone is None) == (motion is None)
        if alone is not None and motion is not None:
            np.testing.assert_array_equal(alone.state(), motion.state())
