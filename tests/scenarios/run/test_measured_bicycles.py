"""Measured bicycles in every engine: errors of the benchmark bicycle's size, of the same order in the step."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import velodrome
from velodrome.engines.engine import REFERENCE
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.families import trace_all
from velodrome.reference.rideability import assess_motions
from velodrome.reference.sections import sample_family
from velodrome.reference.surface import Paraboloid
from velodrome.scenarios.scenario.bicycle_file import read_bicycle_file

peer: Any = pytest.importorskip("bicycleparameters", reason="BicycleParameters, whose files are read, is not installed")
FOLDER = Path(peer.__file__).parent
FILES = {
    **{path.parents[1].name: path for path in sorted(FOLDER.glob("app-data/bicycles/*/Parameters/*.txt"))},
    "Pista with its rider": FOLDER / "tests/parameter_sets/benchmark-pistarider.yml",
    "Browser with its rider": FOLDER / "tests/parameter_sets/principal-browserjason.yml",
}
BOWL = Paraboloid(0.005)
MOTIONS = ("upright", "circle")


@dataclass(frozen=True)
class Method:
    """A step [s], the order of the error in it, and how far the order seen between it and its half may be off."""

    step: float
    order: float
    margin: float


# The error at step h is C h^p (1 + c h^k): what is seen between h and h/2 is off by c h^k / 2, some percent. The fourth
# order is seen where errors are a hundred times what round-off adds in a thousand steps, some 1e-13 m.
METHODS = {
    "exudyn": Method(1e-3, 2, 0.1),
    "exudyn-plane-normal": Method(1e-3, 2, 0.1),
    "exudyn-builtin": Method(1e-3, 2, 0.1),
    "mujoco-native": Method(2e-3, 1, 0.2),
    "mujoco-multipliers": Method(4e-3, 4, 0.3),
}
# Its contacts' softness, not its step, sets its error.
SOFT = "mujoco-exact-contact"
# Rides of bicycles with other speeds, growth rates and sizes: within a power of ten of the benchmark's.
SIZE = 10.0


def read_bicycle(name: str) -> Bicycle:
    return read_bicycle_file(FILES[name]).bicycle


@cache
def circle_changes(name: str) -> dict[str, Any]:
    """The steadiest circular motion within 30 m of the axis, where the bowl is flat, at 8 to 25 rad/s."""
    best: tuple[float, dict[str, Any]] | None = None
    for curve in trace_all(read_bicycle(name), BOWL)[0]:
        samples = sample_family(curve)
        rides = (samples.normal_force > 0).all(axis=1) & (samples.rear_rate > 8) & (samples.rear_rate < 25)
        rides &= samples.radius < 30
        for k in np.flatnonzero(rides):
            growth = float(samples.growth_rate[k])
            unknowns = curve.points[k].unknowns[None]
            if (best is None or growth < best[0]) and assess_motions(read_bicycle(name), BOWL, unknowns).physical[0]:
                near = {"lean": float(samples.lean[k]), "steer": float(samples.steer[k])}
                best = growth, {"motion": {"rear_rate": float(samples.rear_rate[k]), "near": near}}
    assert best is not None
    return {"surface": {"kind": "paraboloid", "alpha": BOWL.alpha}, **best[1]}


@cache
def measured_errors(name: str, motion: str, halved: bool, folder: Path) -> tuple[dict[str, float], dict[str, str]]:
    """Largest position errors over two seconds [m], and the reasons of the engines that did not ride, by engine."""
    fields = (
        circle_changes(name)
        if motion == "circle"
        else {"surface": {"kind": "plane"}, "motion": {"kind": "upright", "speed": 5.0}}
    )
    path = folder / f"{motion}.toml"
    document = {"title": motion, **fields, "perturbation": {"lean_rate": 0.05}}
    path.write_text("".join(toml_lines(document)))
    steps = {engine: {"step": method.step / (2 if halved else 1)} for engine, method in METHODS.items()}
    changes = {f"bicycle.{key}": value for key, value in asdict(read_bicycle(name)).items()}
    changes |= {"simulation.duration": 2.0, "simulation.output_rate": 50.0}
    engines = [*METHODS, SOFT]
    if motion == "circle":
        engines.remove("exudyn-builtin")  # the plane alone
    found = velodrome.run(path, engines=engines, settings=steps, changes=changes)
    errors = found.metrics.column("position_error_max")
    return {engine: errors[engine] for engine in found.trajectories if engine != REFERENCE}, {
        engine: str(reason) for engine, reason in found.failures.items()
    }


def toml_lines(document: dict[str, Any]) -> list[str]:
    """Lines of a TOML file with one level of tables, whose values may be inline tables of numbers."""
    lines = []
    for key, value in document.items():
        if not isinstance(value, dict):
            lines.append(f"{key} = {value!r}\n")
            continue
        lines.append(f"[{key}]\n")
        for name, entry in value.items():
            inline = "{ " + ", ".join(f"{k} = {v!r}" for k, v in entry.items()) + " }" if isinstance(entry, dict) else 0
            lines.append(f"{name} = {inline or repr(entry)}\n")
    return lines


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("measured")


def check_rides(name: str, motion: str, folder: Path) -> None:
    errors, refused = measured_errors(name, motion, False, folder)
    halved, _ = measured_errors(name, motion, True, folder)
    benchmark, _ = measured_errors("Benchmark", motion, False, folder)
    scattered = bool(read_bicycle(name).warnings())
    for engine in benchmark:
        if scattered and engine.startswith("mujoco"):
            # MuJoCo takes rigid bodies alone.
            assert "inertia must satisfy A + B >= C" in refused[engine]
            continue
        assert errors[engine] < SIZE * benchmark[engine], engine
        if engine in METHODS:
            method = METHODS[engine]
            assert np.log2(errors[engine] / halved[engine]) == pytest.approx(method.order, abs=method.margin), engine


def test_there_are_ten_measured_bicycles() -> None:
    assert len(FILES) - 1 >= 10


@pytest.mark.slow
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", sorted(FILES))
def test_measured_bicycles_ride_as_the_benchmark_does(name: str, motion: str, folder: Path) -> None:
    check_rides(name, motion, folder)
