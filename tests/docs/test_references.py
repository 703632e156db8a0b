"""The references name everything: commands, options, fields, settings, metrics, keys of documents, public names."""

from __future__ import annotations

import json
import runpy
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from command_pages import commands, describe_commands, option_names
from documents import COMMON, documented, find_key, find_paths
from engine_settings import describe_engines, find_own_engines
from generated import GENERATORS, MARK, fill_page
from pages import ROOT, source_pages
from scenario_files import describe_scenario_file, describe_sweep_file, scenario_tables

import velodrome
from velodrome.engines.registry import preview_engine
from velodrome.engines.storage import trajectory_columns
from velodrome.reference.bicycle import Bicycle
from velodrome.reports.measure import QUANTITIES
from velodrome.scenarios.cli import main
from velodrome.scenarios.run.machine import describe_machine
from velodrome.scenarios.scenario.schema import Scenario
from velodrome.scenarios.sweep.file import Hypercube, SweepFile

pytestmark = pytest.mark.once  # names and keys, which are the suite's own

FACES = (
    "velodrome",
    "velodrome.engines.coordinates",
    "velodrome.engines.problems",
    "velodrome.engines.rolling",
    "velodrome.testing",
)


def marks() -> list[tuple[str, str]]:
    return [
        (mark, arguments.strip())
        for page in source_pages()
        for mark, arguments in MARK.findall(page.read_text(encoding="utf-8"))
    ]


def test_every_reference_has_its_place_in_a_page() -> None:
    assert {mark for mark, _ in marks()} == set(GENERATORS)
    assert sorted(module for mark, module in marks() if mark == "api") == sorted(FACES)


def test_a_page_with_a_wrong_mark_is_refused() -> None:
    with pytest.raises(ValueError, match="nothing is generated under 'metric'"):
        fill_page("<!-- generated: metric -->")


@pytest.mark.parametrize("module", FACES)
def test_every_public_name_is_in_the_reference(module: str) -> None:
    text = fill_page(f"<!-- generated: api {module} -->")
    for name in import_module(module).__all__:
        assert f"### `{name}`" in text, name
        assert f":: {module}.{name}\n" in text, name


def test_every_command_and_option_is_in_the_reference() -> None:
    text = describe_commands()
    for name, command in commands().items():
        (part,) = [part for part in text.split("\n## ") if part.startswith(f"`velodrome {name}`")]
        for spelling in option_names(command):
            assert f"`{spelling}" in part, f"{name} {spelling}"


def test_every_field_of_a_scenario_and_a_sweep_is_in_the_reference() -> None:
    text = describe_scenario_file()
    models = [model for models in scenario_tables().values() for model in models]
    for model in (Scenario, *models):
        for name, field in model.model_fields.items():
            assert f"\n`{name}`\n: " in text, f"{model.__name__}.{name}"
            assert name == "kind" or field.description, f"{model.__name__}.{name} has no description"
    for name in Bicycle.__dataclass_fields__:
        assert f"| `{name}` |" in text
    swept = describe_sweep_file()
    for model in (SweepFile, Hypercube):
        for name, field in model.model_fields.items():
            assert f"`{name}`\n: " in swept, f"{model.__name__}.{name}"
            assert field.description, f"{model.__name__}.{name} has no description"


def test_every_setting_is_in_the_reference_with_its_range() -> None:
    parts = dict(zip(find_own_engines(), describe_engines().split("(engine-")[1:], strict=True))
    for name, part in parts.items():
        for setting, field in preview_engine(name).settings.model_fields.items():
            assert f"\n`{setting}`\n: " in part, f"{name}: {setting}"
            assert field.description, f"{name}: {setting} has no description"
    assert "number from 1e-06 to 0.02 [s]; default `0.002`" in parts["mujoco-native"]
    assert "`pip install 'velodrome[drake]'`" in parts["drake-native"]  # whether it is installed or not


def test_every_metric_has_a_definition_and_none_is_left() -> None:
    run = velodrome.run("q2-plus", engines="mujoco-native", duration=0.5)
    for engine, row in run.metrics.items():
        assert list(row) == list(QUANTITIES), engine
        for name, value in row.items():
            quantity = QUANTITIES[name]
            if isinstance(value, dict):
                assert tuple(value) == quantity.parts, name
            if value is None:
                assert quantity.absent, f"{name} is null, and nothing says when"
            assert isinstance(value, str | list | None) or quantity.unit, f"{name} has no unit"


def test_every_column_of_a_trajectory_is_in_the_reference() -> None:
    text = fill_page("<!-- generated: trajectory-columns -->")
    for field, columns in trajectory_columns():
        assert f"`{field}` [" in text
        assert all(f"`{column}`" in text for column, _ in columns)


RUN = "run q2-plus --engine mujoco-multipliers --duration 0.5 --json --out"
SWEEP = 'scenario = "q2"\n[grid]\nsimulation.duration = [1.0]\nperturbation.lean_rate = [0.0, 0.1]\n'
DOCUMENTS = {
    "list": ["list --json"],
    "run": [f"{RUN} runs"],
    "circular": ["circular --alpha 0.005 --rear-rate 18 --family 1 --json"],
    "missing-motion": ["circular --alpha 0.005 --rear-rate 500 --family 2 --json"],
    "families": ["families --alpha 0.005 --json"],
    "bicycle": ["bicycle --json"],
    "warm-up": ["warm-up --json"],
    "show": ["show exudyn --json"],
    "diff": [f"{RUN} before", f"{RUN} after", "diff before/* after/* --json"],
    "check": ["check plane-circle --engine mujoco-multipliers --json"],
    "precision": [
        "precision q2 --engine mujoco-multipliers --duration 1 --levels 2 --set simulation.output_rate=25 --json"
    ],
    "float32": ["float32 plane-circle --engine mujoco-native --duration 0.5 --starts 2 --json"],
    "league": ["league plane-circle --engine mujoco-native --duration 0.5 --json"],
    "history": ["history wheelmill==1.0,1.1 circle.toml --cache cache --out history --json"],
    "sweep": ["sweep sweep.toml --json"],
    "critical": ["critical --json"],
    "bifurcations": ["bifurcations --alpha 0.005 --family 4 --engine reference --step 0.01 --json"],
    "basin": ["basin q2 --along lean_rate --map lean_rate,steer_rate --rides 9 --sample 8 --json"],
    "atlas": ["atlas --size 2000 --json"],
    "paper": ["paper --json"],
}
# Documents that a command writes to a file, beside the one that it prints.
WRITTEN = {"run": ("manifest", "runs/*/manifest.json"), "history": ("history-rides", "history/rides/*.json")}
QUICK = ("list", "circular", "missing-motion", "run", "bicycle", "show")
# What is null or absent in these documents, and other ways to say no.
SOMETIMES = ("absent", "the reason", "Verdicts", "As in", "that differ", "criterion")


def test_every_document_is_looked_at() -> None:
    assert {*DOCUMENTS, *(name for name, _ in WRITTEN.values())} == set(documented())


def test_what_a_manifest_may_say_of_the_platform_is_in_the_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some of it depends on the environment: all of it is made to be there."""
    blas = {"user_api": "blas", "internal_api": "openblas", "version": "0.3", "architecture": "Haswell"}
    monkeypatch.setitem(sys.modules, "threadpoolctl", SimpleNamespace(threadpool_info=lambda: [blas]))
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    found = describe_machine.__wrapped__()
    assert {"blas_loaded", "openblas_coretype"} <= set(found)
    keys = list(documented()["manifest"]["keys"])
    assert [name for name in found if find_key(f"platform.{name}", keys) is None] == []


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else pytest.mark.slow) for name in DOCUMENTS]
)
def test_every_key_of_a_document_is_in_the_reference(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    if name == "history":
        make_releases(tmp_path, monkeypatch)
    printed = ""
    for line in DOCUMENTS[name]:
        monkeypatch.setattr(sys, "argv", ["velodrome", *fill_patterns(line)])
        with pytest.raises(SystemExit) as ended:
            main()
        printed, errors = capsys.readouterr()
        assert ended.value.code in (0, 1), errors
    assert_documented(name, json.loads(printed))
    if name in WRITTEN:
        other, pattern = WRITTEN[name]
        (path,) = tmp_path.glob(pattern)
        assert_documented(other, json.loads(path.read_text(encoding="utf-8")))


def fill_patterns(line: str) -> Iterator[str]:
    """The words of a command, with the files of this folder for patterns, as a shell would give them."""
    for word in line.split():
        yield from [str(path) for path in sorted(Path().glob(word))] if "*" in word else [word]


def assert_documented(name: str, document: dict[str, Any]) -> None:
    """Every key of a document is in the reference, and every key in the reference is there or may be absent."""
    keys = documented()[name]["keys"]
    paths = [path for path in find_paths(document) if path not in COMMON]
    found = {path: find_key(path, list(keys)) for path in paths}
    assert [path for path, key in found.items() if key is None] == []
    unseen = {key for key in keys if key not in found.values()}
    assert [key for key in unseen if not any(word in keys[key] for word in SOMETIMES)] == []


def make_releases(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a registry of two releases of a tiny package, with an engine that rides in them, and a scenario."""
    mill = runpy.run_path(str(ROOT / "tests" / "scenarios" / "history" / "mill.py"))
    mill["install_mill"](folder / "installed", monkeypatch)
    mill["use_registry"](folder / "registry", monkeypatch)
    mill["make_wheel"](folder / "registry", "1.0")
    mill["make_wheel"](folder / "registry", "1.1", stretch=mill["FAULT"])
    (folder / "circle.toml").write_text(mill["CIRCLE"], encoding="utf-8")


def test_a_key_that_nobody_documented_is_seen() -> None:
    keys = ["engines.*.points[].step", "alpha", "verdicts[]"]
    assert find_key("alpha", keys) == "alpha"
    assert find_key("verdicts", keys) == "verdicts[]"
    assert find_key("verdicts[].limit", keys) == "verdicts[]"
    assert find_key("engines.exudyn.points[].step", keys) == "engines.*.points[].step"
    assert find_key("engines.exudyn.points[].error", keys) is None
    assert find_key("alphas", keys) is None
