"""Stored runs against each other: what can be compared, what is written, what bad input is told."""

from __future__ import annotations

import io
import json
import re
import shutil
import tomllib
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from rerun.chunk import RrdReader
from rich.console import Console

from tests.sealing import age_folder, change_scenario, contents, sealed
from velodrome.engines.storage import read_trajectory, write_trajectory
from velodrome.scenarios.commands.present_diff import show_diff
from velodrome.scenarios.compare.differences import DIFFERS, TO_THE_BIT, WITHIN_ROUND_OFF
from velodrome.scenarios.compare.folders import _label_rides, diff_runs, read_pair, write_diff
from velodrome.scenarios.compare.markdown import diff_summary, diff_verdict
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.run.runner import plan_run, run_plan
from velodrome.scenarios.scenario.schema import load_scenario

NATIVE = "mujoco-native"


def ride(out: Path, changes: dict[str, Any] | None = None) -> Path:
    """A folder of half a second in the reference and MuJoCo."""
    settings = {"simulation.duration": 0.5, "simulation.output_rate": 50.0} | (changes or {})
    plan = plan_run(*load_scenario("q2-plus", settings), wanted=[NATIVE])
    return run_plan(plan, out, lambda *_: None, lambda _: None).folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ride(tmp_path_factory.mktemp("before"))


@pytest.fixture(scope="module")
def halved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ride(tmp_path_factory.mktemp("after"), {f"engines.{NATIVE}.step": 0.001})


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "copy"))


def shown(document: dict[str, Any], width: int = 100) -> str:
    console = Console(file=io.StringIO(), width=width)
    show_diff(console, document)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_a_repeated_run_is_the_same_to_the_bit(folder: Path, tmp_path: Path) -> None:
    found = diff_runs(read_pair(folder, ride(tmp_path)))
    assert found["same"]
    assert {entry["verdict"] for entry in found["engines"].values()} == {"same to the bit"}
    assert "the rides of the engines in both runs are the same within round-off" in shown(found)


def test_a_changed_setting_differs_and_is_named(folder: Path, halved: Path) -> None:
    found = diff_runs(read_pair(folder, halved))
    assert (found["same"], found["engines"]["reference"]["verdict"]) == (False, "same to the bit")
    entry = found["engines"][NATIVE]
    assert (entry["verdict"], entry["settings"]) == ("differs", {"step": [0.002, 0.001]})
    before, after = (read_trajectory(path / f"{NATIVE}.parquet") for path in (folder, halved))
    distance = np.linalg.norm(after.q[:, :3] - before.q[:, :3], axis=1)
    assert entry["position_difference"]["max"] == distance.max()
    # The solver's tolerance of 1e-8 a step: what a change of the engine must exceed to be told.
    assert entry["step_noise"] == 1e-8
    text = shown(found)
    assert f"{NATIVE}\n  step 0.002 -> 0.001\n" in text
    assert "the rides of the engines in both runs are not the same" in text


def test_the_table_tears_no_verdict_at_eighty_columns(folder: Path, halved: Path) -> None:
    found = diff_runs(read_pair(folder, halved))
    found["engines"]["reference"]["verdict"] = "same within round-off"
    long = found["engines"].pop(NATIVE)
    # As long as the longest name of the suite's own engines, and as long as a name may be; neither may fold.
    for name in ("mujoco-exact-contact", "x" * 64):
        lines = shown(found | {"engines": found["engines"] | {name: long}}, width=80).splitlines()
        assert any(line.endswith("to round-off") for line in map(str.rstrip, lines))
        rows = [line.split() for line in lines if line.startswith(f"{name} ")]
        assert rows[-1][-1] == "differs"
        numbers = [float(word) for row in rows for word in row[1:] if word not in ("differs", "–")]
        assert any(isclose(number, long["cpu_time"]["ratio"], rel_tol=0.05) for number in numbers)


def test_document_page_and_recording_are_written(folder: Path, halved: Path, tmp_path: Path) -> None:
    pair = read_pair(folder, halved)
    found = diff_runs(pair)
    paths = write_diff(pair, found, tmp_path / "out")
    assert [path.name for path in paths] == ["diff.json", "diff.md", "diff.html", "diff.rrd"]
    assert contents(paths[0]) == found
    assert f"## {NATIVE}: differs" in paths[1].read_text()
    page = paths[2].read_text(encoding="utf-8")
    assert f'Differs by more than round-off: <span class="whole">{NATIVE}</span> (by up to ' in page
    assert "Distance between both rides" in page  # the figure
    entities = {chunk.entity_path for chunk in RrdReader(str(paths[3])).stream()}
    roots = {re.split(r"(?<!\\)/", entity)[2] for entity in entities if entity.startswith("/world/")}
    # What tells the rides apart, with every sign that a path gives a meaning of its own escaped.
    names = [f"{NATIVE}\\ \\@\\ step\\ {step}" for step in (0.002, 0.001)]
    assert roots == {"reference", "ground", *names}
    assert [entity for entity in entities if entity.startswith("/plots/log_position_change/")] == [
        f"/plots/log_position_change/tested/{names[1]}"
    ]


@pytest.mark.parametrize(
    ("engine", "entry", "labels"),
    [
        ("exudyn", {"verdict": TO_THE_BIT, "version": ["1.9", "1.13"]}, ("exudyn", "exudyn")),
        ("reference", {"verdict": WITHIN_ROUND_OFF, "version": ["1", "1"]}, ("reference", "reference")),
        ("exudyn", {"version": ["1.9", "1.13"], "settings": {"step": [1, 2]}}, ("exudyn @ 1.9", "exudyn @ 1.13")),
        (
            "exudyn",
            {"settings": {"step": [0.002, 0.001], "method": ["a", "b"]}},
            ("exudyn @ step 0.002, method a", "exudyn @ step 0.001, method b"),
        ),
        (
            "exudyn",
            {"settings": {name: [1, 2] for name in ("a", "b", "c")}},
            ("exudyn @ before", "exudyn @ after"),
        ),
        ("reference", {}, ("reference @ before", "reference @ after")),
    ],
)
def test_rides_are_named_by_what_tells_them_apart(engine: str, entry: dict[str, Any], labels: tuple[str, str]) -> None:
    assert _label_rides(engine, {"verdict": DIFFERS, "version": ["1", "1"], "settings": {}} | entry) == labels


def test_a_recording_of_two_runs_says_which_they_are_and_what_is_drawn_once(folder: Path, halved: Path) -> None:
    pair = read_pair(folder, halved)
    found = diff_runs(pair)
    assert diff_verdict(found).split("\n\n") == [
        "**The rides of the engines in both runs are not the same.**",
        f"before: {pair.before.name}; after: {pair.after.name}",
        "The same to the bit, drawn once: reference\n",
    ]
    lines = diff_summary(found).splitlines()
    assert lines[0] == f"# {found['title']}"
    position = found["engines"][NATIVE]["position_difference"]
    assert f"| {NATIVE} | {position['max']:.4g} | {position['exceeds_at']:.4g} | differs |" in lines
    assert "| reference | 0 | – | same to the bit |" in lines
    assert "- step 0.002 -> 0.001" in lines


def test_one_engine_beside_the_reference(folder: Path, halved: Path) -> None:
    assert list(diff_runs(read_pair(folder, halved, [NATIVE]))["engines"]) == ["reference", NATIVE]
    with pytest.raises(ScenarioError, match=r"engine 'exudyn' is not in both runs \(there are reference"):
        read_pair(folder, halved, ["exudyn"])


def test_an_engine_that_is_gone_is_held_to_round_off(folder: Path, copy: Path) -> None:
    for path in (folder, copy):
        manifest = json.loads((path / "manifest.json").read_text())
        assert NATIVE in manifest["engines"]
    manifest["engines"][NATIVE]["settings"]["unheard_of"] = 1
    (copy / "manifest.json").write_text(sealed(manifest))
    found = diff_runs(read_pair(folder, copy))
    assert found["notes"] == [
        f"{NATIVE} is not installed here with such settings; its steps are allowed round-off only"
    ]
    assert found["notes"][0] in shown(found)


@pytest.mark.parametrize(
    ("table", "key", "value", "words"),
    [
        ("surface", "alpha", 0.006, "different scenarios: surface.alpha 0.005 against 0.006$"),
        ("perturbation", "lean_rate", 0.2, "different scenarios: perturbation.lean_rate 0.1 against 0.2$"),
        ("simulation", "output_rate", 100.0, "different output times: simulation.output_rate 50.0 against 100.0$"),
    ],
)
def test_runs_that_cannot_be_compared_are_told_apart(
    folder: Path, copy: Path, table: str, key: str, value: float, words: str
) -> None:
    change_scenario(copy, lambda scenario: scenario[table].update({key: value}))
    with pytest.raises(ScenarioError, match=words.replace(".", r"\.")):
        read_pair(folder, copy)


def test_another_start_is_refused(folder: Path, copy: Path) -> None:
    manifest = json.loads((copy / "manifest.json").read_text())
    # The root's own error is 1e-11 at the most.
    manifest["start"]["q"][0] += 5e-12
    (copy / "manifest.json").write_text(sealed(manifest))
    assert diff_runs(read_pair(folder, copy))["same"]
    manifest["start"]["q"][0] += 1e-9
    (copy / "manifest.json").write_text(sealed(manifest))
    with pytest.raises(ScenarioError, match="different starts: coordinates differ by up to 1e-09"):
        read_pair(folder, copy)


def test_a_folder_of_before_there_were_versions_is_compared(folder: Path, copy: Path) -> None:
    age_folder(copy)
    for pair in (read_pair(copy, folder), read_pair(folder, copy)):
        found = diff_runs(pair)
        assert found["same"]
        # What the older one does not say is not taken for a difference of the rides.
        assert "processor" in found["differs"]["platform"]


def test_another_bicycle_is_told_by_its_parameter(folder: Path, copy: Path) -> None:
    age_folder(copy)
    scenario = tomllib.loads((copy / "scenario.toml").read_text())
    (copy / "scenario.toml").write_text(tomli_w.dumps(scenario | {"bicycle": {"trail": 0.07}}))
    with pytest.raises(ScenarioError, match=r"different scenarios: bicycle\.trail 0\.08 against 0\.07$"):
        read_pair(folder, copy)


def test_other_times_in_a_trajectory_are_refused(folder: Path, copy: Path) -> None:
    path = copy / f"{NATIVE}.parquet"
    ride = read_trajectory(path)
    ride.time[3] += 1e-6
    write_trajectory(ride, path)
    with pytest.raises(ScenarioError, match=f"different output times of {NATIVE}"):
        read_pair(folder, copy)


@pytest.mark.parametrize("name", ["manifest.json", "metrics.json", "scenario.toml", f"{NATIVE}.parquet"])
def test_what_is_no_run_folder_gets_one_line(folder: Path, copy: Path, name: str) -> None:
    with pytest.raises(ScenarioError, match="no such folder"):
        read_pair(folder, copy / "absent")
    (copy / name).write_text("{")
    with pytest.raises(ScenarioError) as damaged:
        read_pair(folder, copy)
    assert str(copy) in str(damaged.value)
    (copy / name).unlink()
    with pytest.raises(ScenarioError, match=f"it has no {name}") as missing:
        read_pair(copy, folder)
    for error in (damaged, missing):
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("manifest", ["[]", "{}", '{"engines": {"reference": 1}}'])
def test_a_manifest_without_its_parts_gets_one_line(folder: Path, copy: Path, manifest: str) -> None:
    (copy / "manifest.json").write_text(manifest)
    with pytest.raises(ScenarioError, match=r"not a JSON object|not the files of one run"):
        read_pair(folder, copy)


def test_a_damaged_start_is_told_in_words(folder: Path, copy: Path) -> None:
    manifest = json.loads((copy / "manifest.json").read_text())
    manifest["start"]["q"] = [0.0]
    (copy / "manifest.json").write_text(sealed(manifest))
    with pytest.raises(ScenarioError, match=r"not the files of one run: a start has nine coordinates and nine rates$"):
        read_pair(folder, copy)
