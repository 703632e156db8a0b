"""Every installed engine passes the examination that a stranger's must pass, with its own settings and with others."""

from __future__ import annotations

from typing import Any

import pytest

from tests.installed import parametrise_engines
from velodrome.engines.engine import REFERENCE
from velodrome.engines.registry import load_engine
from velodrome.testing import check_engine

# Engines that refuse every ground but the plane.
PLANE_ONLY = {"exudyn-builtin"}
# Settings that change the method, where every choice of it must conform.
VARIANTS: list[tuple[str, dict[str, Any]]] = [
    (REFERENCE, {"integrator": "modified-euler"}),
    (REFERENCE, {"tolerance": 1e-9}),
    ("exudyn", {"solver": "trapezoidal-index2"}),
    ("exudyn", {"start": "engine"}),
    ("exudyn", {"jacobian": "iteration", "step": 5e-4}),
    ("exudyn-plane-normal", {"solver": "trapezoidal-index2"}),
    ("mujoco-native", {"integrator": "RK4", "cone": "pyramidal"}),
    ("mujoco-native", {"integrator": "discrete"}),
    ("mujoco-default", {"integrator": "implicit"}),
    ("mujoco-exact-contact", {"integrator": "implicitfast"}),
    ("mujoco-multipliers", {"step": 1e-3, "integrator": "Euler"}),
]
# Examined in files of their own, with several settings; those of JAX and Warp in the process that has compiled them.
ELSEWHERE = ("drake-multipliers", "drake-native", "mjx", "mjx-multipliers", "mujoco-warp", "pinocchio-constraint")


@pytest.mark.parametrize("name", parametrise_engines(without=ELSEWHERE))
def test_an_engine_conforms(name: str) -> None:
    report = check_engine(name)
    outcomes = {check.name: check.outcome for check in report.checks}
    # Nothing that matters is left out: the reference alone may be like the reference, and one engine has only planes.
    allowed = {REFERENCE: {"own work"}, "exudyn-builtin": {"order on bowl", "order on waves"}}
    assert {name for name, outcome in outcomes.items() if outcome == "skipped"} == allowed.get(name, set())
    # A ride and its order on the first ground, and on the last one.
    inputs = 0 if not load_engine(name).takes_inputs else 2 if name in PLANE_ONLY else 4
    assert len(outcomes) == len(report.checks) == 26 + inputs


@pytest.mark.slow
@pytest.mark.parametrize(("name", "settings"), VARIANTS)
def test_an_engine_conforms_with_other_settings(name: str, settings: dict[str, Any]) -> None:
    check_engine(name, settings)
