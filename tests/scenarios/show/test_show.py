"""`velodrome show`: scenarios as resolved, engines' settings, the bicycle, and the JSON schemas of what users write."""

from __future__ import annotations

import json
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from pydantic import Field

from velodrome.engines.engine import Settings
from velodrome.engines.registry import engine_names, load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.scenario.engine_settings import configure_engine
from velodrome.scenarios.scenario.parameters import PARAMETERS
from velodrome.scenarios.scenario.schema import LIBRARY, Scenario, library_names, load_scenario
from velodrome.scenarios.show import make_document, make_schema
from velodrome.scenarios.show.fields import list_fields, list_tables
from velodrome.scenarios.sweep.file import SweepFile

ROOT = Path(__file__).parents[3]
OURS = [name for name in engine_names() if name.startswith(("reference", "exudyn", "mujoco"))]


class Written(Settings):
    """Settings of every form that a field may have."""

    step: float = Field(default=1e-3, gt=0, le=0.5, description="a step", json_schema_extra={"unit": "s"})
    many: int = Field(default=3, ge=1, lt=10)
    perhaps: float | None = Field(default=None, ge=0, le=1)
    pair: tuple[float, float] = (1.0, 2.0)


def test_fields_have_the_units_the_defaults_and_the_ranges_of_their_model() -> None:
    found = list_fields(Written.model_json_schema())
    step = found["step"]
    assert (step.type, step.required, step.default, step.unit, step.description) == (
        "number", False, 1e-3, "s", "a step"
    )  # fmt: skip
    assert (step.exclusive_minimum, step.maximum, step.minimum, step.exclusive_maximum) == (0, 0.5, None, None)
    assert [found[name].range for name in found] == ["above 0, at most 0.5", "from 1, below 10", "from 0 to 1", ""]
    assert (found["many"].unit, found["perhaps"].default, found["pair"].default) == (None, None, [1.0, 2.0])
    json.dumps([field.as_json() for field in found.values()], allow_nan=False)


@pytest.mark.parametrize("name", OURS)
def test_every_setting_of_ours_says_what_it_is(name: str) -> None:
    document = make_document(name, SweepFile)
    engine = load_engine(name)
    assert (document["kind"], document["name"], document["version"]) == ("engine", name, engine.version)
    assert document["gives"] == list(engine.gives)
    assert len(document["description"]) > 20
    assert list(document["settings"]) == list(engine.settings.model_fields)
    defaults = engine.settings().model_dump(mode="json")
    for key, field in document["settings"].items():
        assert field["description"], key
        assert field["default"] == defaults[key]
        # Numbers have a unit and a range, words have choices.
        assert (field["unit"] is None) == (field["type"] == "string"), key
        assert field["range"] or field["type"] == "array", key
        for bound, inside in (("minimum", True), ("maximum", True), ("exclusive_minimum", False)):
            if field[bound] is not None:
                assert _takes(name, key, field[bound]) or not inside, (key, bound)
        if field["maximum"] is not None:
            assert not _takes(name, key, field["maximum"] * 2 + 1)


def _takes(name: str, key: str, value: Any) -> bool:
    """Whether no complaint about a value is about its range: it may not go with the others' defaults."""
    try:
        configure_engine(name, {key: value})
    except ScenarioError as error:
        return "Input should be" not in str(error)
    return True


@pytest.mark.parametrize("name", library_names())
def test_a_scenario_is_shown_with_every_number_and_its_unit(name: str) -> None:
    document = make_document(name, SweepFile)
    _, scenario = load_scenario(name)
    assert document["bicycle"] == asdict(scenario.make_bicycle())
    stated = tomllib.loads((LIBRARY / f"{name}.toml").read_text(encoding="utf-8"))
    assert stated["simulation"].items() <= document["simulation"].items()
    assert set(document["engines"]) >= set(OURS)
    for engine in OURS:
        settings = configure_engine(engine, scenario.engines.get(engine, {}))[1]
        assert document["engines"][engine] == settings.model_dump(mode="json", exclude_none=True)
    # What is shown, read as a scenario, is that scenario.
    tables = {key: value for key, value in document.items() if key not in ("kind", "name", "units")}
    again = Scenario.model_validate(tables)
    assert again.make_bicycle() == scenario.make_bicycle()
    for table in ("surface", "motion", "perturbation", "simulation", "gate"):
        assert getattr(again, table) == getattr(scenario, table)
    for place in document["units"]:
        value: Any = document
        for key in place.split("."):
            value = value[key]
    assert document["units"]["simulation.duration"] == "s"
    assert document["units"]["bicycle.gravity"] == "m/s^2"
    assert document["units"]["perturbation.lean_rate"] == "rad/s"


def test_the_bicycle_is_shown_with_units_and_meanings() -> None:
    document = make_document("bicycle", SweepFile)
    assert document["parameters"] == asdict(Bicycle())
    assert set(document["units"]) == set(document["descriptions"]) == set(document["parameters"]) == set(PARAMETERS)
    assert (document["units"]["front_wheel_Iyy"], document["units"]["rear_frame_x"]) == ("kg m^2", "m")
    assert len(set(document["descriptions"].values())) == len(PARAMETERS)


def test_tables_of_a_scenario_file_are_all_told() -> None:
    tables = make_document("scenario", SweepFile)["tables"]
    kinds = [table["kind"] for table in tables if table["table"] == "surface"]
    assert kinds == ["plane", "inclined-plane", "paraboloid", "sphere", "cone", "torus", "profile", "height-field"]
    names = {table["table"] for table in tables}
    assert names >= {"", "motion", "motion.near", "perturbation", "simulation", "gate", "criterion", "bicycle"}
    assert names >= {f"engines.{engine}" for engine in OURS}
    for table in tables:
        for key, field in table["fields"].items():
            # The kind is its own description.
            assert field["description"] or key == "kind", (table["table"], key)
            if field["type"] == "number":
                assert field["unit"] is not None, (table["table"], key)


def test_tables_of_a_sweep_file_are_all_told() -> None:
    found = {table.name: list(table.fields) for table in list_tables(SweepFile.model_json_schema())}
    assert found[""] == ["title", "scenario", "engines", "time_limit", "memory_limit", "grid", "list"]
    assert found["latin_hypercube"] == ["count", "seed", "ranges"]


@pytest.mark.parametrize(
    ("name", "meant"), [("exudin", "exudyn"), ("q2-pluss", "q2-plus"), ("bycicle", "bicycle"), ("sweeps", "sweep")]
)
def test_what_is_called_nothing_is_refused_with_what_is_meant(name: str, meant: str, velodrome) -> None:
    result = velodrome("show", name)
    assert (result.status, result.stdout) == (2, "")
    assert result.stderr.startswith(f"velodrome: nothing is called '{name}' (did you mean '{meant}'?); ")
    assert result.stderr.count("\n") == 1


def test_a_bad_file_is_told_all_its_mistakes(velodrome) -> None:
    result = velodrome("show", str(ROOT / "tests" / "cases" / "newcomer.toml"))
    assert result.status == 2
    assert result.stderr.count("; ") == 4


def test_settings_that_are_wrong_are_told_in_a_file_that_is_right(velodrome, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text((LIBRARY / "q2.toml").read_text(encoding="utf-8") + "[engines.exudyn]\nstepp = 1\n")
    result = velodrome("show", str(path))
    assert result.status == 2
    assert result.stderr == f"velodrome: {path}: engines.exudyn: unknown key 'stepp' (did you mean 'step'?)\n"


@pytest.mark.parametrize("name", ["q2-plus", "mujoco-exact-contact", "bicycle", "scenario", "sweep"])
def test_names_are_whole_at_sixty_columns_and_the_same_at_any_width(
    name: str, velodrome, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = {}
    for width in (40, 60, 200):
        monkeypatch.setenv("COLUMNS", str(width))
        result = velodrome("show", name)
        assert result.status == 0
        shown[width] = result.stdout
        text = " ".join(result.stdout.split())
        assert text == " ".join(shown[40].split())
    lines = shown[60].splitlines()
    # What is no value of somebody's and no name fits the terminal.
    assert all(len(line) <= 60 for line in lines if line.startswith("    "))
    assert not any(line != line.rstrip() for line in lines)
    if name == "mujoco-exact-contact":
        for key in make_document(name, SweepFile)["settings"]:
            assert any(line == key or line.startswith((f"{key} = ", f"{key}, ")) for line in lines), key


def test_json_is_the_document_with_its_version(velodrome) -> None:
    found = velodrome("show", "exudyn", "--json").json()
    assert found == {"schema_version": 1} | make_document("exudyn", SweepFile)


@pytest.mark.parametrize("name", ["q2", "scenario", "sweep", "exudyn", "bicycle"])
def test_schemas_are_json_schemas(name: str, velodrome) -> None:
    validation = pytest.importorskip("jsonschema")
    found = velodrome("show", name, "--schema").json()
    assert found["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    validation.Draft202012Validator.check_schema(found)


def _scenario_files() -> list[Path]:
    found = [LIBRARY / f"{name}.toml" for name in library_names()]
    return [
        *found,
        *sorted((ROOT / "tests" / "cases").glob("*.toml")),
        ROOT / "examples/velodrome-symbrim/plane-weave.toml",
    ]


@pytest.mark.parametrize("path", _scenario_files(), ids=lambda path: path.stem)
def test_the_schema_takes_every_scenario_that_the_suite_takes_and_no_other(path: Path) -> None:
    validation = pytest.importorskip("jsonschema")
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    schema = make_schema("sweep" if "grid" in data or "latin_hypercube" in data else "scenario", "", SweepFile)
    faults = list(validation.Draft202012Validator(schema).iter_errors(data))
    assert bool(faults) == (path.stem == "newcomer"), faults


@pytest.mark.parametrize("path", sorted((ROOT / "examples" / "sweeps").glob("*.toml")), ids=lambda path: path.stem)
def test_the_schema_takes_the_sweeps_of_the_examples(path: Path) -> None:
    validation = pytest.importorskip("jsonschema")
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    validation.Draft202012Validator(make_schema("sweep", "", SweepFile)).validate(data)


@pytest.mark.parametrize(
    "change",
    [
        {"surfce": {}},
        {"title": 3},
        {"surface": {"kind": "plane", "alpha": 1.0}},
        {"motion": {"kind": "upright", "speed": 0.0}},
        {"bicycle": {"trial": 0.1}},
        {"bicycle": {"trail": "0.1"}},
        {"engines": {"exudyn": {"stepp": 0.1}}},
        {"engines": {"exudyn": {"step": 1.0}}},
        {"engines": {"exudin": {}}},
        {"simulation": {"output_rate": 100.0}},
    ],
    ids=repr,
)
def test_the_schema_refuses_what_the_suite_refuses(change: dict[str, Any]) -> None:
    validation = pytest.importorskip("jsonschema")
    checker = validation.Draft202012Validator(make_schema("scenario", "", SweepFile))
    data = tomllib.loads((LIBRARY / "q2.toml").read_text(encoding="utf-8"))
    assert checker.is_valid(data)
    assert not checker.is_valid(data | change)
