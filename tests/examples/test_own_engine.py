"""The guide to bringing one's own engine: what it shows, says and tells to type."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from velodrome.engines import registry
from velodrome.engines.registry import engine_names, load_engine
from velodrome.reference.surface import is_level
from velodrome.scenarios.gate import checks as gate
from velodrome.scenarios.gate.verdict import RIDE_QUANTITIES, SHOWN
from velodrome.scenarios.run.runner import configure_engine, plan_run, run_plan
from velodrome.scenarios.scenario.schema import load_scenario
from velodrome.scenarios.scenario.start import make_start
from velodrome.testing import check_engine

SUITE = Path(__file__).parents[2]
EXAMPLE = SUITE / "examples" / "velodrome-symbrim"
GUIDE = (EXAMPLE / "README.md").read_text(encoding="utf-8")
MOVES = {*RIDE_QUANTITIES, "observed_order", "eigenvalue_error", "growth_rate_error"} - {"fell_at"}


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", GUIDE, re.DOTALL | re.MULTILINE)


SHELL = "".join(blocks("sh")).splitlines()
COMMANDS = [line for line in SHELL if line.startswith("velodrome ")]


def test_the_suite_does_not_pack_the_example() -> None:
    suite = tomllib.loads((SUITE / "pyproject.toml").read_text(encoding="utf-8"))
    (root,) = suite["tool"]["setuptools"]["packages"]["find"]["where"]
    assert [folder.name for folder in (SUITE / root).iterdir() if folder.suffix != ".egg-info"] == ["velodrome"]
    assert "symbrim" not in suite["project"]["entry-points"][registry.ENTRY_POINT_GROUP]


def test_the_guides_scenario_starts_on_the_level_plane() -> None:
    name, scenario = load_scenario(str(EXAMPLE / "plane-weave.toml"))
    start = make_start(scenario)
    assert name == "plane-weave"
    assert is_level(start.problem.surface)
    assert start.growth_rate < 0  # the weave dies out: a comparison of it means something


def test_the_baseline_holds_all_that_an_engine_can_be_held_to() -> None:
    entry = gate.read_baseline("plane-circle", EXAMPLE / "baselines")["symbrim"]
    assert {name for name, value in entry["quantities"].items() if value is not None} == MOVES | {*SHOWN}


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """The guide's smallest engine, announced as an installed package announces it."""
    (tmp_path / "own_engine.py").write_text(blocks("python")[0], encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "own_engine", raising=False)
    announced = registry.list_entry_points(registry.ENTRY_POINT_GROUP)
    point = EntryPoint("own", "own_engine:ENGINE", registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "list_entry_points", lambda group: [*announced, point])
    return "own"


def test_the_guides_smallest_engine_runs_and_gives_only_what_it_has(own: str, tmp_path: Path) -> None:
    assert own in engine_names()
    assert load_engine(own).name == own
    plan = plan_run(*load_scenario("iftomm-2", {"simulation.duration": 0.5}), [own])
    outcome = run_plan(plan, tmp_path, lambda *_: None, lambda _: None)
    assert not outcome.failures
    measured = outcome.metrics[own]
    # Modified Euler at 1 ms: (h rate)^2 of the fastest rate, the wheels' 15 rad/s, of half a second's way.
    assert 0 < measured["position_error"]["max"] < (1e-3 * 15.3) ** 2 * 2.3
    for quantity in ("contact_force_error", "min_normal_force"):
        assert measured[quantity] is None, quantity
    # Slip, gaps and energies follow from its coordinates, which are nearly right.
    for quantity in ("energy_drift", "max_slip", "max_gap"):
        assert 0 < measured[quantity] < 1e-3, quantity
    assert all(verdict["holds"] for verdict in outcome.verdicts)
    assert measured["inconsistent_reports"] == []


def test_the_guides_smallest_engine_conforms(own: str) -> None:
    skipped = [check.name for check in check_engine(own).checks if check.outcome == "skipped"]
    # Of what it does not give nothing can be said, nor of ground that it refuses.
    rest = [name for name in skipped if not name.startswith(("reports", "forces"))]
    assert rest == ["order on bowl", "order on waves"]


def test_the_guides_smallest_engine_is_gated(own: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Its rides stand for all: orders and eigenvalues take the longest.
    monkeypatch.setattr("velodrome.scenarios.gate.sample._measure_eigenvalues", lambda *_: {})

    def check(**settings: float) -> list[Any]:
        found = gate.check_gate(
            lambda *_: None, ["plane-circle"], [own], tmp_path, lambda n, v: configure_engine(n, {**v, **settings})
        )
        if not (tmp_path / "plane-circle.json").exists():
            gate.update_baselines(found[1], found[0], "first", tmp_path)
        return [verdict for _, verdict in found[0]]

    assert [verdict.status for verdict in check()] == ["new"]
    again = check()
    assert all(verdict.passes for verdict in again)
    # What it does not give is not judged; gaps, slip and energies follow from its coordinates.
    found = {verdict.quantity for verdict in again}
    assert "contact_force_error" not in found
    assert {"energy_drift", "max_gap", "max_slip", "report_mismatch"} <= found
    assert any(not verdict.passes for verdict in check(step=0.002))


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A copy of the suite in which the guide's commands were typed, and what they printed."""
    folder = tmp_path_factory.mktemp("guide") / "suite"
    left_out = shutil.ignore_patterns("*.egg-info", "runs")
    for name in (*("reference", "engines", "reports", "scenarios"), str(EXAMPLE.relative_to(SUITE))):
        # Compiled kernels come along: they are kept beside their sources.
        shutil.copytree(SUITE / name, folder / name, ignore=left_out)
    shutil.copytree(SUITE / "src", folder / "src", ignore=left_out, symlinks=True)
    for name in ("pyproject.toml", "README.md", "constraints.txt"):
        shutil.copy(SUITE / name, folder)
    first = SHELL.index(next(line for line in SHELL if line.startswith(". ")))
    made = typed(folder, SHELL[:first])
    if made.returncode != 0 and "Retrying (" in made.stdout + made.stderr:
        pytest.skip(f"the package registry cannot be reached: {made.stderr.strip().splitlines()[-1]}")
    assert made.returncode == 0, made.stderr
    ridden = typed(folder, SHELL[first:])
    assert ridden.returncode == 0, ridden.stdout + ridden.stderr
    return folder, ridden.stdout


def typed(folder: Path, lines: list[str]) -> subprocess.CompletedProcess[str]:
    # The suite's own environment must not shine through.
    clean = ["env", "-u", "PYTHONPATH", "-u", "VIRTUAL_ENV", "COLUMNS=200", "PIP_RETRIES=1"]
    script = "\n".join(["set -eu", *lines])
    return subprocess.run([*clean, "bash", "-c", script], cwd=folder, capture_output=True, text=True, timeout=1500)


@pytest.mark.slow
def test_the_guides_commands_do_what_it_says(installed: tuple[Path, str]) -> None:
    folder, printed = installed
    assert re.search(r"^symbrim +\d+\.\d+\.\d+ +contact_point, contact_force", printed, re.MULTILINE)
    assert "its own eigenvalues" in printed.split("symbrim\n")[-1]
    assert re.search(r"^symbrim \S+: \d+ passed, 0 failed, 0 skipped$", printed, re.MULTILINE)
    # The committed baseline holds, and so does one that was written anew.
    assert printed.count("the gate holds") == 2
    assert len(list((folder / "runs").iterdir())) == 3
    assert "<failure" not in (folder / "verdicts.xml").read_text(encoding="utf-8")


@pytest.mark.slow
def test_two_derivations_of_the_bicycle_agree(installed: tuple[Path, str]) -> None:
    tolerance = 1e-13
    ride = "velodrome run plane-circle iftomm-2 --engine symbrim --out again --json"
    found = typed(installed[0], [". own/bin/activate", f"{ride} --set engines.symbrim.tolerance={tolerance}"])
    assert found.returncode == 0, found.stderr
    for entry in json.loads(found.stdout)["runs"]:
        start = make_start(load_scenario(entry["scenario"])[1])
        measured = entry["engines"]["symbrim"]
        noise, rate = tolerance * measured["steps"], abs(start.problem.qd[7])
        # Both motions are stable: an error of the speed by a step leads astray in proportion to the time left.
        speed, duration = float(abs(start.problem.qd[:2]).max()), float(start.problem.times[-1])
        assert measured["position_error"]["max"] < noise * (1 + speed) * duration
        # Forces follow accelerations, as sensitive as the square of the fastest rate; see
        # `velodrome.reports.measure.limits`.
        assert measured["contact_force_error"] < noise * rate**2 * start.size / start.problem.bicycle.gravity


@pytest.mark.slow
def test_a_fault_of_the_engine_closes_its_gate(installed: tuple[Path, str]) -> None:
    folder, _ = installed
    source = folder / "examples" / "velodrome-symbrim" / "velodrome_symbrim" / "equations.py"
    whole = source.read_text(encoding="utf-8")
    assert whole.count("= bicycle.body_mass(name)") == 1
    source.write_text(whole.replace("= bicycle.body_mass(name)", "= 1.001 * bicycle.body_mass(name)"), encoding="utf-8")
    try:
        found = typed(folder, [". own/bin/activate", COMMANDS[-1].replace("verdicts.xml", "fault.xml")])
    finally:
        source.write_text(whole, encoding="utf-8")
    assert found.returncode == 1, found.stderr
    assert "the gate fails" in found.stdout
    assert "plane-circle: symbrim: eigenvalue_error: worse" in found.stdout
    assert "<failure" in (folder / "fault.xml").read_text(encoding="utf-8")
