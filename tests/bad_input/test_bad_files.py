"""Stored files that a disk, a hand or another program has changed: what was written, or one line; nothing half-read."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from complaints import is_one_line, refusing
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.sealing import sealed
from velodrome.engines.engine import Trajectory
from velodrome.engines.format_version import VERSION_KEY
from velodrome.engines.storage import METADATA_KEY, read_trajectory
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.files import DIGEST_KEY
from velodrome.scenarios.gate import checks as gate
from velodrome.scenarios.gate.verdict import judge_sample
from velodrome.scenarios.run.runner import plan_run, run_plan
from velodrome.scenarios.run.stored import read_document
from velodrome.scenarios.scenario.schema import load_scenario
from velodrome.scenarios.view import viewing as view

NATIVE = "mujoco-native"
VALUES: list[Any] = [
    *(None, True, False, 0, -1, 1.5, 1e308, -1e308, 5e-324, 10**400, float("nan"), float("inf")),
    *("", "x", "a\nb", "\ud800", "\0", "<b>", "../../x", [], [1], {}, {"a": 1}, [[]]),
]
KEYS = ["", "x", "a/b", "../../x", "..", "\0", "a\nb", "reference", "<b>"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the reference and one engine."""
    plan = plan_run(*load_scenario("q2", {"simulation.duration": 0.1}), wanted=[NATIVE])
    return run_plan(plan, tmp_path_factory.mktemp("runs"), lambda *_: None, lambda _: None).folder


@pytest.fixture(scope="module")
def content(folder: Path) -> bytes:
    return (folder / "reference.parquet").read_bytes()


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("spoilt") / "a.parquet"


@pytest.fixture(scope="module")
def spoilt(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the run folder, for one of its files to be changed and put back."""
    return Path(shutil.copytree(folder, tmp_path_factory.mktemp("spoilt") / "run"))


def same(a: Trajectory, b: Trajectory) -> bool:
    pairs = [(getattr(a, field.name), getattr(b, field.name)) for field in fields(Trajectory)]
    return all(np.array_equal(x, y, equal_nan=True) if isinstance(x, np.ndarray) else x == y for x, y in pairs)


def read_or_refused(path: Path, content: bytes, good: Path) -> None:
    """A changed file is what was written, or refused in a line that names it."""
    path.write_bytes(content)
    said = ""
    try:
        found = read_trajectory(path)
    except ValueError as error:
        said, found = str(error), None
    if found is None:
        assert said.startswith(f"{path} ")
        assert is_one_line(said)
    else:
        assert same(found, read_trajectory(good))


@settings(max_examples=100)
@given(st.lists(st.tuples(st.integers(0, 10**6), st.integers(1, 255)), min_size=1, max_size=3))
def test_a_trajectory_with_turned_bits_is_refused_or_whole(
    path: Path, folder: Path, content: bytes, turned: list[tuple[int, int]]
) -> None:
    changed = bytearray(content)
    for where, bits in turned:
        changed[where % len(content)] ^= bits
    read_or_refused(path, bytes(changed), folder / "reference.parquet")


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(0, 200), st.sampled_from(["cut", "zeroed", "doubled", "gone"]))
def test_a_trajectory_that_lost_a_piece_is_refused_or_whole(
    path: Path, folder: Path, content: bytes, where: int, length: int, how: str
) -> None:
    where %= len(content)
    piece = content[where : where + length]
    changed = {
        "cut": content[:where],
        "zeroed": content[:where] + bytes(len(piece)) + content[where + length :],
        "doubled": content[:where] + piece + content[where:],
        "gone": content[:where] + content[where + length :],
    }
    read_or_refused(path, changed[how], folder / "reference.parquet")


@pytest.mark.slow
def test_no_turned_bit_gives_other_numbers(path: Path, folder: Path, content: bytes) -> None:
    # Without the digest some 16 of 100 do; with the checksums of pages that Parquet has, 3 of 100.
    rng = np.random.default_rng(5)
    for where in rng.integers(0, len(content), 3000):
        changed = bytearray(content)
        changed[where] ^= 1 << int(rng.integers(8))
        read_or_refused(path, bytes(changed), folder / "reference.parquet")


def column(name: str, values: Any) -> Callable[[pa.Table], pa.Table]:
    def changed(table: pa.Table) -> pa.Table:
        column = values(table) if callable(values) else pa.array([values] * len(table))
        return table.set_column(table.column_names.index(name), name, column)

    return changed


def renamed(table: pa.Table) -> pa.Table:
    """With x and y exchanged."""
    names = [{"x": "y", "y": "x"}.get(name, name) for name in table.column_names]
    return table.rename_columns(names).replace_schema_metadata(table.schema.metadata)


def facts(**changes: Any) -> Callable[[pa.Table], pa.Table]:
    def changed(table: pa.Table) -> pa.Table:
        found = json.loads((table.schema.metadata or {})[METADATA_KEY]) | changes
        return table.replace_schema_metadata({METADATA_KEY: json.dumps(found).encode()})

    return changed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda table: table.select(sorted(table.column_names)), "do not match their digest"),
        (lambda table: table.slice(0, 5), "do not match their digest"),
        (lambda table: table.slice(0, 0), "times must be finite and rising"),
        (lambda table: table.append_column("more", pa.array(np.zeros(len(table)))), "do not match their digest"),
        (lambda table: table.append_column("x", pa.array(np.zeros(len(table)))), "2 columns x"),
        (lambda table: table.drop_columns(["rear_contact_x"]), "no column rear_contact_x"),
        (renamed, "do not match their digest"),
        (column("x", "a"), "column x is string"),
        (column("x", 1), "column x is int64"),
        (column("x", True), "column x is bool"),
        (column("x", b"a"), "column x is binary"),
        (column("x", [1.0]), "column x is list"),
        (column("x", None), "column x is null"),
        (column("x", lambda table: table["x"].cast(pa.float32())), "column x is float"),
        (column("x", lambda table: table["x"].cast(pa.decimal128(30, 15))), "column x is decimal"),
        (column("x", lambda table: pa.array([None] + [1.0] * (len(table) - 1))), "column x has holes"),
        (column("x", float("nan")), "do not match their digest"),
        (column("time", float("nan")), "times must be finite and rising"),
        (column("time", 1.0), "times must be finite and rising"),
        (facts(engine=None), "engine: Input should be a valid string"),
        (facts(settings=[]), "settings: Input should be a valid dictionary"),
        (facts(steps=-1), "steps: Input should be greater"),
        (facts(steps="9"), "steps: Input should be a valid integer"),
        (facts(cpu_time=float("nan")), "cpu_time: Input should be a finite number"),
        (facts(cpu_time=True), "cpu_time: Input should be a valid number"),
        (facts(friction=-1.0), "friction: Input should be greater"),
        (lambda table: table.replace_schema_metadata({METADATA_KEY: b"[" * 100_000}), "no whole velodrome metadata"),
        (lambda table: table.replace_schema_metadata({METADATA_KEY: b"\xff"}), "no whole velodrome metadata"),
    ],
)
def test_a_table_that_is_no_trajectory_is_refused(
    change: Callable[[pa.Table], pa.Table], words: str, path: Path, folder: Path
) -> None:
    pq.write_table(change(pq.read_table(folder / "reference.parquet")), path)
    with pytest.raises(ValueError, match=words) as caught:
        read_trajectory(path)
    assert is_one_line(str(caught.value))


def test_a_trajectory_of_a_newer_format_is_refused_with_what_to_do(path: Path, folder: Path) -> None:
    pq.write_table(facts(schema_version=2)(pq.read_table(folder / "reference.parquet")), path)
    with pytest.raises(ValueError, match="its schema_version is 2, and this velodrome reads up to 1") as caught:
        read_trajectory(path)
    assert is_one_line(str(caught.value))


def test_a_trajectory_says_its_format(folder: Path) -> None:
    found = json.loads((pq.read_schema(folder / "reference.parquet").metadata or {})[METADATA_KEY])
    assert found["schema_version"] == 1


def test_a_trajectory_of_an_earlier_version_has_no_digest_and_is_read(path: Path, folder: Path) -> None:
    good = folder / "reference.parquet"
    pq.write_table(facts()(pq.read_table(good)), path)
    assert same(read_trajectory(path), read_trajectory(good))


def test_the_name_of_a_folder_adds_no_column(folder: Path, tmp_path: Path) -> None:
    # As a data set's partitions are called.
    below = tmp_path / "x=5" / "engine=3"
    below.mkdir(parents=True)
    copied = shutil.copy(folder / "reference.parquet", below)
    assert same(read_trajectory(Path(copied)), read_trajectory(folder / "reference.parquet"))


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none", tmp_path / "a\0b"):
        with pytest.raises(ValueError, match="cannot be read as a trajectory"):
            read_trajectory(path)


def places(document: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The ways to everything inside a JSON document."""
    yield way
    inner = (
        document.items() if isinstance(document, dict) else enumerate(document) if isinstance(document, list) else ()
    )
    for key, value in inner:
        yield from places(value, (*way, key))


def altered(document: Any, where: int, how: str, value: Any, key: str) -> Any:
    """A document with one thing in it dropped, renamed or replaced."""
    ways = list(places(document))
    *way, last = ways[1 + where % (len(ways) - 1)]
    changed = inner = copy.deepcopy(document)
    for step in way:
        inner = inner[step]
    if how == "drop":
        del inner[last]
    elif how == "rename" and isinstance(inner, dict):
        inner[key] = inner.pop(last)
    else:
        inner[last] = value
    return changed


ALTERATION = st.tuples(
    st.integers(0, 10**4), st.sampled_from(["drop", "rename", "value"]), st.sampled_from(VALUES), st.sampled_from(KEYS)
)
DOCUMENTS = st.sampled_from(["manifest.json", "metrics.json"])


def page_or_refused(spoilt: Path, name: str, text: bytes) -> None:
    good = (spoilt / name).read_bytes()
    (spoilt / name).write_bytes(text)
    try:
        with refusing() as said:
            view.stored_page(spoilt).encode()
        assert all(str(spoilt) in line for line in said)
    finally:
        (spoilt / name).write_bytes(good)


@settings(max_examples=20)
@given(DOCUMENTS, ALTERATION)
def test_the_page_of_an_altered_run_is_written_or_refused(spoilt: Path, name: str, alteration: Any) -> None:
    document = json.loads((spoilt / name).read_text())
    page_or_refused(spoilt, name, sealed(altered(document, *alteration)).encode())


@pytest.mark.slow
@settings(max_examples=300)
@given(DOCUMENTS, ALTERATION)
def test_the_pages_of_many_altered_runs_are_written_or_refused(spoilt: Path, name: str, alteration: Any) -> None:
    document = json.loads((spoilt / name).read_text())
    page_or_refused(spoilt, name, sealed(altered(document, *alteration)).encode())


@settings(max_examples=40)
@given(DOCUMENTS, ALTERATION)
def test_any_change_of_a_sealed_document_is_seen(spoilt: Path, name: str, alteration: Any) -> None:
    good = json.loads((spoilt / name).read_text())
    changed = altered(good, *alteration)
    text = (spoilt / name).read_bytes()
    (spoilt / name).write_text(json.dumps(changed))
    try:
        with refusing() as said:
            assert read_document(spoilt, name) == {
                key: good[key] for key in good if key not in (VERSION_KEY, DIGEST_KEY)
            }
            assert json.dumps(changed, sort_keys=True) == json.dumps(good, sort_keys=True)
        assert all(line.startswith(f"{spoilt / name}: ") for line in said)
    finally:
        (spoilt / name).write_bytes(text)


def test_the_order_and_the_layout_of_a_document_do_not_matter(spoilt: Path) -> None:
    path = spoilt / "metrics.json"
    text, found = path.read_text(), read_document(spoilt, "metrics.json")
    path.write_text(json.dumps(dict(reversed(json.loads(text).items())), indent=4))
    try:
        assert read_document(spoilt, "metrics.json") == found
    finally:
        path.write_text(text)


@pytest.mark.parametrize(
    ("version", "words"),
    [
        (3, "its schema_version is 3, and this velodrome reads up to 2: .*pip install --upgrade velodrome"),
        (10**40, "its schema_version is very large"),
        *((value, "its schema_version is no whole number from 1 to 2") for value in (0, -1, 2.0, True, None, "2", [])),
    ],
    ids=repr,
)
def test_a_document_of_another_format_is_refused_with_what_to_do(version: Any, words: str, spoilt: Path) -> None:
    path = spoilt / "manifest.json"
    text = path.read_text()
    path.write_text(sealed(json.loads(text) | {VERSION_KEY: version}))
    try:
        with pytest.raises(ScenarioError, match=words) as caught:
            read_document(spoilt, "manifest.json")
        assert is_one_line(str(caught.value))
    finally:
        path.write_text(text)


@settings(max_examples=30)
@given(DOCUMENTS, st.integers(0, 10**4), st.binary(max_size=5))
def test_the_page_of_a_run_with_a_cut_document_is_refused(spoilt: Path, name: str, where: int, more: bytes) -> None:
    text = (spoilt / name).read_bytes()
    page_or_refused(spoilt, name, text[: where % len(text)] + more)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[" * 100_000, "nested too deeply"),
        ('{"a": ' + "9" * 5000 + "}", "not a JSON document"),
        ('{"a": NaN}', "NaN is no number of JSON"),
        ('{"a": "\\ud800"}', "not a JSON document"),
        ('"a"', "not a JSON object"),
    ],
)
def test_a_document_that_is_none_is_refused(text: str, words: str, spoilt: Path) -> None:
    good = (spoilt / "manifest.json").read_text()
    (spoilt / "manifest.json").write_text(text)
    try:
        with pytest.raises(ScenarioError, match=words) as caught:
            view.stored_page(spoilt)
        assert is_one_line(str(caught.value))
    finally:
        (spoilt / "manifest.json").write_text(good)


def test_files_of_different_runs_are_told_apart(folder: Path, tmp_path: Path) -> None:
    plan = plan_run(*load_scenario("q2", {"simulation.duration": 0.1}), wanted=[NATIVE])
    other = run_plan(plan, tmp_path / "runs", lambda *_: None, lambda _: None).folder
    copied = Path(shutil.copytree(folder, tmp_path / "run"))
    for name in ("reference.parquet", "manifest.json", "metrics.json"):
        good = (copied / name).read_bytes()
        shutil.copy(other / name, copied / name)
        with pytest.raises(ScenarioError, match="is of another run than"):
            view.stored_page(copied)
        (copied / name).write_bytes(good)
    shutil.copy(copied / f"{NATIVE}.parquet", copied / "reference.parquet")
    with pytest.raises(ScenarioError, match=f"is a trajectory of '{NATIVE}'"):
        view.stored_page(copied)


@pytest.mark.parametrize("name", ["../../x", "a/b", "..", "/etc/passwd"])
def test_no_document_leads_out_of_its_folder(name: str, folder: Path, tmp_path: Path) -> None:
    copied = Path(shutil.copytree(folder, tmp_path / "run"))
    (copied / "metrics.json").write_text(json.dumps({name: {}}))
    with pytest.raises(ScenarioError, match=r"is no name of a file in it|it has no \.\.\.parquet"):
        view.stored_page(copied)


BASELINE = json.loads((gate.BASELINES / "q2.json").read_text(encoding="utf-8"))


def measured(entries: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """What each engine measured; a quantity that is null is one that is not there."""
    return {
        name: {quantity: value for quantity, value in entry["quantities"].items() if value is not None}
        for name, entry in entries.items()
    }


def judged(found: Mapping[str, Any]) -> bool:
    """Whether every engine holds what the committed baseline says, exactly."""
    holds = True
    for name, entry in BASELINE["engines"].items():
        limits = dict.fromkeys(entry["quantities"], 1e-12)
        verdicts = judge_sample(name, entry["quantities"], found.get(name), limits, entry["settings"], entry["version"])
        assert all(is_one_line(verdict.reason) for verdict in verdicts)
        json.dumps([verdict.as_json() for verdict in verdicts], allow_nan=False)
        holds = holds and all(verdict.passes for verdict in verdicts)
    return holds


@settings(max_examples=100)
@given(ALTERATION)
def test_an_altered_baseline_is_refused_or_judged_by(tmp_path_factory: Any, alteration: Any) -> None:
    path = tmp_path_factory.getbasetemp() / "q2.json"
    changed = altered(BASELINE, *alteration)
    path.write_text(json.dumps(changed))
    with refusing() as said:
        found = gate.read_baseline("q2", path.parent)
        assert measured(found) == measured(BASELINE["engines"]) or not judged(found)
    assert all(line.startswith(str(path)) for line in said)


@settings(max_examples=50)
@given(st.integers(0, 10**5), st.binary(max_size=5))
def test_a_cut_baseline_is_refused(tmp_path_factory: Any, where: int, more: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "q2.json"
    text = json.dumps(BASELINE).encode()
    path.write_bytes(text[: where % len(text)] + more)
    with refusing() as said:
        gate.read_baseline("q2", path.parent)
    assert said
    assert said[0].startswith(f"{path}: not a baseline")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"scenario": "plane-circle"}, "not the baseline of q2 but of 'plane-circle'"),
        ({"duration": 6.0}, "its duration is 6.0, not 3.0"),
        ({"output_rate": 25.0}, "its output_rate is 25.0, not 50.0"),
        ({"short_horizon": 0.5}, "its short_horizon is 0.5, not 1.0"),
    ],
)
def test_a_baseline_of_another_ride_is_refused(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    (tmp_path / "q2.json").write_text(json.dumps(BASELINE | changes))
    with pytest.raises(ScenarioError, match=words):
        gate.read_baseline("q2", tmp_path, gate.load_gated("q2")[1])


def test_a_baseline_without_a_version_is_read_and_a_newer_one_refused(tmp_path: Path) -> None:
    older = {key: value for key, value in BASELINE.items() if key != VERSION_KEY}
    assert older != BASELINE
    (tmp_path / "q2.json").write_text(json.dumps(older))
    assert gate.read_baseline("q2", tmp_path) == BASELINE["engines"]
    (tmp_path / "q2.json").write_text(json.dumps(BASELINE | {VERSION_KEY: 2}))
    with pytest.raises(ScenarioError, match=r"not a baseline: its schema_version is 2, .* reads up to 1"):
        gate.read_baseline("q2", tmp_path)


def test_a_file_is_no_folder_of_baselines(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ScenarioError, match="is not a folder of baselines"):
        gate.read_baseline("q2", tmp_path / "file")
