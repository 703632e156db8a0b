"""Trajectories written and read back: every bit, every fact, or a refusal."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from velodrome.engines.engine import Trajectory
from velodrome.engines.storage import (
    DIGEST_KEY,
    METADATA_KEY,
    ROWS_PER_GROUP,
    digest,
    read_trajectory,
    trajectory_columns,
    trajectory_table,
    write_trajectory,
)
from velodrome.reference.fall import Fall

OPTIONAL = ("contact_point", "contact_force", "gap", "slip", "kinetic_energy", "potential_energy")
SHAPES = {
    "time": (),
    "q": (9,),
    "qd": (9,),
    "body_position": (4, 3),
    "body_quaternion": (4, 4),
    "contact_point": (2, 3),
    "contact_force": (2, 3),
    "gap": (2,),
    "slip": (2, 2),
    "kinetic_energy": (),
    "potential_energy": (),
}


def trajectory(count: int = 5, **changes: Any) -> Trajectory:
    """Distinct numbers everywhere, so that a swapped column shows."""
    rng = np.random.default_rng(1)
    values: dict[str, Any] = {name: rng.standard_normal((count, *shape)) for name, shape in SHAPES.items()}
    values["time"].sort()
    facts = {"engine": "exudyn", "version": "1.0", "settings": {"step": 0.001, "method": None}}
    return Trajectory(**{**values, **facts, "steps": 7, "cpu_time": 0.1 + 0.2, "ended": "fell", **changes})


def assert_same(a: Trajectory, b: Trajectory) -> None:
    for field in fields(Trajectory):
        left, right = getattr(a, field.name), getattr(b, field.name)
        if isinstance(left, np.ndarray):
            assert right.dtype == np.float64, field.name
            assert right.shape == left.shape, field.name
            # Bits, not values: nan and -0 come back as they were.
            assert right.tobytes() == left.tobytes(), field.name
        else:
            assert left == right, field.name


def test_everything_comes_back_to_the_bit(tmp_path: Path) -> None:
    q = trajectory().q
    q[0, :5] = np.nan, np.inf, -0.0, 5e-324, 1 / 3
    written = trajectory(q=q)
    write_trajectory(written, tmp_path / "a.parquet")
    assert_same(written, read_trajectory(tmp_path / "a.parquet"))


def test_a_long_ride_is_written_in_groups_with_the_digest_of_the_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    written = trajectory(ROWS_PER_GROUP + 1, time=np.arange(ROWS_PER_GROUP + 1.0))
    write_trajectory(written, path)
    found = pq.ParquetFile(path)
    assert [found.metadata.row_group(k).num_rows for k in range(found.num_row_groups)] == [ROWS_PER_GROUP, 1]
    assert found.schema_arrow.metadata[DIGEST_KEY] == digest(trajectory_table(written))
    assert_same(written, read_trajectory(path))


def test_neighbouring_samples_take_less_than_their_bytes(tmp_path: Path) -> None:
    time = np.linspace(0.0, 10.0, 10_001)
    smooth = {name: np.sin(time.reshape(-1, *[1] * len(shape)) + np.ones(shape)) for name, shape in SHAPES.items()}
    write_trajectory(trajectory(len(time), **{**smooth, "time": time}), tmp_path / "a.parquet")
    raw = len(time) * sum(len(names) for _, names in trajectory_columns()) * 8
    # A double has 8 bytes. Where neighbours differ by 1e-3 or less, its sign, exponent and first digits repeat: of
    # 8 bytes 2 compress to little.
    assert (tmp_path / "a.parquet").stat().st_size < 0.85 * raw


def test_what_iterations_left_comes_back_and_older_files_say_nothing_of_it(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    write_trajectory(trajectory(unconverged_steps=3, largest_residual=0.1 + 0.2), path)
    read = read_trajectory(path)
    assert (read.unconverged_steps, read.largest_residual) == (3, 0.1 + 0.2)
    table = pq.read_table(path)
    facts = json.loads(table.schema.metadata[METADATA_KEY])
    older = {name: fact for name, fact in facts.items() if name not in ("unconverged_steps", "largest_residual")}
    pq.write_table(table.replace_schema_metadata({METADATA_KEY: json.dumps(older).encode()}), path)
    read = read_trajectory(path)
    assert (read.unconverged_steps, read.largest_residual) == (None, None)


def test_the_states_around_a_fall_come_back_to_the_bit(tmp_path: Path) -> None:
    path, rng = tmp_path / "a.parquet", np.random.default_rng(2)
    fall = Fall(np.array([0.1 + 0.2, 0.4]), rng.standard_normal((2, 9)), rng.standard_normal((2, 9)))
    write_trajectory(trajectory(fall=fall), path)
    read = read_trajectory(path).fall
    assert read is not None
    for name in ("time", "q", "qd"):
        assert getattr(read, name).tobytes() == getattr(fall, name).tobytes(), name
    # A state of another length is damage.
    table = pq.read_table(path)
    facts = json.loads(table.schema.metadata[METADATA_KEY])
    facts["fall"]["q"][0].pop()
    pq.write_table(table.replace_schema_metadata({METADATA_KEY: json.dumps(facts).encode()}), path)
    with pytest.raises(ValueError, match=r"its schema has no whole velodrome metadata \(fall\.q\.0: "):
        read_trajectory(path)
    # Files of earlier versions say nothing of a fall.
    del facts["fall"]
    pq.write_table(table.replace_schema_metadata({METADATA_KEY: json.dumps(facts).encode()}), path)
    assert read_trajectory(path).fall is None


@pytest.mark.parametrize("absent", [(name,) for name in OPTIONAL] + [OPTIONAL])
def test_what_an_engine_does_not_give_stays_none(absent: tuple[str, ...], tmp_path: Path) -> None:
    written = replace(trajectory(), **dict.fromkeys(absent))
    write_trajectory(written, tmp_path / "a.parquet")
    assert_same(written, read_trajectory(tmp_path / "a.parquet"))


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.integers(1, 40),
    st.none() | st.text(),
    st.dictionaries(st.text(), st.none() | st.booleans() | st.integers() | st.text() | st.floats(allow_nan=False)),
)
def test_any_facts_come_back(tmp_path: Path, count: int, ended: str | None, facts: dict[str, Any]) -> None:
    written = trajectory(count, ended=ended, settings=facts)
    write_trajectory(written, tmp_path / "a.parquet")
    assert_same(written, read_trajectory(tmp_path / "a.parquet"))


def test_columns_are_named_and_carry_units(tmp_path: Path) -> None:
    written = trajectory()
    write_trajectory(written, tmp_path / "a.parquet")
    table = pq.read_table(tmp_path / "a.parquet")
    units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
    assert list(units) == [column for _, names in trajectory_columns() for column, _ in names]
    sample = {"time": "s", "lean": "rad", "lean_rate": "rad/s", "x_rate": "m/s", "rear_contact_x": "m"}
    sample |= {"front_force_z": "N", "rear_gap": "m", "front_slip_forward": "m/s", "kinetic_energy": "J"}
    sample |= {"front_wheel_qw": "1", "rear_frame_x": "m"}
    assert sample.items() <= units.items()
    # A reader without this suite finds the right numbers under the names.
    force, slip = written.contact_force, written.slip
    assert force is not None
    assert slip is not None
    assert table["front_force_z"].to_pylist() == force[:, 1, 2].tolist()
    assert table["rear_slip_forward"].to_pylist() == slip[:, 0, 1].tolist()
    assert table["front_wheel_qw"].to_pylist() == written.body_quaternion[:, 3, 0].tolist()


def test_a_write_that_fails_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="reshape"):
        write_trajectory(trajectory(gap=np.zeros((4, 2))), tmp_path / "a.parquet")
    with pytest.raises(TypeError):
        write_trajectory(trajectory(settings={"step": object()}), tmp_path / "a.parquet")
    assert list(tmp_path.iterdir()) == []


def test_a_write_that_breaks_off_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.parquet"
    write_trajectory(trajectory(), path)
    whole = path.read_bytes()

    write_group = pq.ParquetWriter.write_table

    def write_one_group(writer: Any, group: Any) -> None:
        write_group(writer, group)
        raise OSError("disk full")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", write_one_group)
    with pytest.raises(OSError, match="disk full"):
        write_trajectory(replace(trajectory(), steps=8), path)
    assert path.read_bytes() == whole
    assert list(tmp_path.iterdir()) == [path]


def damaged(kind: str, path: Path) -> None:
    """Write a file that is no whole trajectory."""
    write_trajectory(trajectory(), path)
    table, content = pq.read_table(path), path.read_bytes()
    if kind == "missing":
        path.unlink()
    elif kind == "text":
        path.write_text("time,x\n0,1\n")
    elif kind == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif kind == "no column x":
        pq.write_table(table.drop(["x"]), path)
    elif kind == "no metadata":
        pq.write_table(table.replace_schema_metadata(None), path)
    else:
        pq.write_table(table.replace_schema_metadata({METADATA_KEY: kind.encode()}), path)


@pytest.mark.parametrize("kind", ["missing", "text", "cut", "no column x", "no metadata", "{", "{}", "[]"])
def test_what_is_no_trajectory_is_refused_by_name(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    damaged(kind, path)
    with pytest.raises(ValueError, match=r"a\.parquet .*trajectory"):
        read_trajectory(path)


def test_columns_are_what_their_names_say(tmp_path: Path) -> None:
    """A round trip cannot see two columns exchanged on both ways."""
    written = trajectory()
    write_trajectory(written, tmp_path / "a.parquet")
    table = pq.read_table(tmp_path / "a.parquet")
    point, force, slip = written.contact_point, written.contact_force, written.slip
    assert point is not None
    assert force is not None
    assert slip is not None
    for column, values in {
        "z": written.q[:, 2],
        "lean": written.q[:, 4],
        "rear_angle_rate": written.qd[:, 7],
        "rear_contact_x": point[:, 0, 0],
        "rear_contact_y": point[:, 0, 1],
        "front_contact_z": point[:, 1, 2],
        "rear_force_y": force[:, 0, 1],
        "front_force_x": force[:, 1, 0],
        "rear_slip_lateral": slip[:, 0, 0],
        "rear_slip_forward": slip[:, 0, 1],
        "front_slip_lateral": slip[:, 1, 0],
        "rear_frame_x": written.body_position[:, 0, 0],
        "front_wheel_z": written.body_position[:, 3, 2],
        "front_frame_qw": written.body_quaternion[:, 1, 0],
        "rear_wheel_qz": written.body_quaternion[:, 2, 3],
    }.items():
        assert np.array_equal(table.column(column).to_numpy(), values), column
