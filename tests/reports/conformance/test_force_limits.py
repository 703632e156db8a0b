"""Contact forces that are off by more than the ride's own error allows are found, with the reason where one fits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from planting import changed, plant

from velodrome.testing import examine_engine

pytestmark = pytest.mark.once  # the examination's judgement; `test_conformance` examines every engine

FRONT = np.array([0.0, 1.0])[:, None]
Z = np.array([0.0, 0.0, 1.0])

CASES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "front zero": (lambda force: force * (1 - FRONT), "zero at the front wheel"),
    "sideways": (lambda force: force + FRONT * [0, 300, 0], "those of the front wheel look shifted by (0, 300, 0) N"),
    "little": (lambda force: force + FRONT * [0.1, 0, 0], "those of the front wheel look shifted by (0.1, 0, 0) N"),
    "swapped": (lambda force: force[..., [1, 0, 2]], "with x and y swapped"),
    "mirrored": (lambda force: force * (1 - 2 * FRONT * (1 - Z)), "mirrored in x and y at the front wheel"),
    "normal": (lambda force: force * (1 + 0.1 * Z), "their z components look scaled by 1.1"),
    "one wheel": (lambda force: force * (1 + 0.2 * FRONT), "those of the front wheel look scaled by 1.2"),
    "scaled": (lambda force: 1.001 * force, "they look scaled by 1.001"),
    "noisy": (lambda force: force * (1 + 0.01 * np.random.default_rng(0).normal(size=force.shape)), "of the weight"),
}


@pytest.mark.parametrize("what", CASES)
def test_wrong_forces_are_found(what: str) -> None:
    change, words = CASES[what]
    report = examine_engine(plant("exudyn", changed("contact_force", by=change)))
    assert [check.name for check in report.failed] == ["forces on plane", "forces on waves, another bicycle"], report
    for check in report.failed:
        assert words in "\n".join(check.found)


def test_what_an_engine_of_soft_contacts_hides_is_said() -> None:
    report = examine_engine(plant("mujoco-native", changed("contact_force", by=lambda force: 1.1 * force)))
    check = report["forces on plane"]
    assert check.outcome == "passed"
    assert "of the weight could not be told: the ride's own error hides them" in check.found[1]
    double = examine_engine(plant("mujoco-native", changed("contact_force", by=lambda force: 1.5 * force)))
    assert "they look scaled by 1.5" in "\n".join(double["forces on plane"].found)


def test_forces_that_ring_are_judged_by_their_means() -> None:
    settings = {"solver": "trapezoidal-index2"}
    found = examine_engine("exudyn-plane-normal", settings)["forces on plane"]
    assert found.outcome == "passed"
    assert "they ring from step to step" in found.found[1]
    wrong = plant("exudyn-plane-normal", changed("contact_force", by=lambda force: 1.001 * force))
    assert examine_engine(wrong, settings)["forces on plane"].outcome == "failed"
