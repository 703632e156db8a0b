"""A sweep as a whole, done in this process: every row once, equal bits, and what stops it."""

from __future__ import annotations

import errno
import json
from collections.abc import Generator, Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sweeping import UPRIGHT, data_set, here, planned, rows, swept

from velodrome.engines.admission import ride_engine
from velodrome.engines.storage import METADATA_KEY
from velodrome.reference.bicycle import LARGEST_EXCESS, Bicycle
from velodrome.reports.measure import flatten_metrics
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.run.runner import claimed_noise, measure_one, plan_run
from velodrome.scenarios.scenario.schema import load_scenario
from velodrome.scenarios.sweep import rows as columns
from velodrome.scenarios.sweep.plan import SweepPlan, Task, plan_sweep
from velodrome.scenarios.sweep.pool import Done
from velodrome.scenarios.sweep.run import Work, run_sweep
from velodrome.scenarios.sweep.store import JOURNAL, MANIFEST, RESULTS, STAGING, TIMINGS, part_of
from velodrome.scenarios.sweep.summary import status_of, summarise_sweep
from velodrome.scenarios.sweep.worker import Setup

CASES = Path(__file__).parents[2] / "cases"
LEANING = UPRIGHT + "perturbation.lean_rate = [0.0, 0.1, 0.2, 0.3]\n"


def breaking_off(after: int, error: BaseException) -> Work:
    def work(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        yield from islice(here(setup, tasks), after)
        raise error

    return work


def test_a_row_has_the_parameters_and_the_metrics_of_a_run(tmp_path: Path) -> None:
    text = 'engines = ["reference", "mujoco-multipliers"]\n' + UPRIGHT
    plan = planned(tmp_path, text + '"engines.mujoco-multipliers.step" = [0.01]\nperturbation.lean_rate = [0.0, 0.1]')
    swept(plan, tmp_path / "out")
    found = rows(tmp_path / "out", "mujoco-multipliers")
    assert [row["perturbation.lean_rate"] for row in found] == [0.0, 0.1]
    changes = dict(plan.tasks[-1].changes)
    alone = plan_run(*load_scenario("iftomm-1", changes), wanted=["mujoco-multipliers"])
    rides = {
        name: ride_engine(engine, alone.start.problem, settings, lambda _: None)
        for name, (engine, settings) in alone.engines.items()
    }
    noise = claimed_noise(*alone.engines["mujoco-multipliers"])
    measured = measure_one(alone.start, rides["mujoco-multipliers"], rides["reference"], step_noise=noise)
    differing = set(columns.TIMING)
    flat = {name: value for name, value in flatten_metrics(measured).items() if name not in differing}
    assert set(flat) == set(columns.METRICS) - {"family", "growth_rate", "size", "warnings"}
    assert {name: found[1][name] for name in flat} == flat
    assert (found[1]["status"], found[1]["reason"]) == ("done", None)


def test_the_order_of_the_work_does_not_matter(tmp_path: Path) -> None:
    def forwards(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        yield from here(setup, tasks[::-1])

    plan = planned(tmp_path, LEANING)
    swept(plan, tmp_path / "a")
    swept(plan, tmp_path / "b", forwards)
    assert data_set(tmp_path / "a") == data_set(tmp_path / "b")
    assert pq.read_table(tmp_path / "a" / TIMINGS).num_rows == 4


def test_a_motion_that_does_not_exist_is_a_row_of_every_engine(tmp_path: Path) -> None:
    text = 'scenario = "q2"\nengines = ["reference", "exudyn"]\n[grid]\nmotion.rear_rate = [3.0]'
    outcome = swept(planned(tmp_path, text), tmp_path / "out")
    for engine in ("reference", "exudyn"):
        (row,) = rows(tmp_path / "out", engine)
        assert row["status"] == "no-motion"
        assert "no circular motion" in row["reason"]
    assert status_of(outcome) == 0


def test_a_fall_is_a_result(tmp_path: Path) -> None:
    text = 'scenario = "iftomm-1"\nengines = ["reference", "mujoco-multipliers"]\n'
    plan = planned(tmp_path, text + "[grid]\nmotion.speed = [1.0]\nperturbation.lean_rate = [1.0]")
    outcome = swept(plan, tmp_path / "out")
    for engine in plan.file.engines:
        (row,) = rows(tmp_path / "out", engine)
        assert row["status"] == "fell"
        assert f"fell at {row['fell_at']!r} s" in row["reason"]
    (row,) = rows(tmp_path / "out", "mujoco-multipliers")
    assert row["position_error_max"] is not None
    # Its error is that up to the fall, and no error of a whole ride.
    assert summarise_sweep(plan, outcome)["engines"]["mujoco-multipliers"]["position_error"] is None
    assert status_of(outcome) == 0


def test_ground_that_an_engine_does_not_know_is_a_failed_row(tmp_path: Path) -> None:
    text = 'scenario = "q2"\nengines = ["exudyn-builtin"]\n[grid]\nsimulation.duration = [0.1]'
    outcome = swept(planned(tmp_path, text), tmp_path / "out")
    (row,) = rows(tmp_path / "out", "exudyn-builtin")
    assert row["status"] == "failed"
    assert "level plane" in row["reason"]
    assert status_of(outcome) == 1


@pytest.mark.parametrize(
    ("error", "said", "status"),
    [
        (KeyboardInterrupt(), "interrupted", 130),
        (OSError(errno.ENOSPC, "No space left on device"), "cannot write: No space left on device", 1),
    ],
)
def test_what_is_done_is_kept_and_not_done_again(tmp_path: Path, error: BaseException, said: str, status: int) -> None:
    plan, out = planned(tmp_path, LEANING), tmp_path / "out"
    first = swept(plan, out, breaking_off(3, error))
    assert (first.missing, first.stopped, status_of(first)) == (1, said, status)
    assert not (out / RESULTS).exists()
    assert json.loads((out / MANIFEST).read_text())["complete"] is False
    asked: list[int] = []

    def counting(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        asked.extend(task.index for task in tasks)
        yield from here(setup, tasks)

    second = swept(plan, out, counting, resume=True)
    assert asked == [0]
    assert second.counts == {"reference": {"done": 4}}
    assert json.loads((out / MANIFEST).read_text())["complete"] is True
    swept(plan, tmp_path / "undisturbed")
    assert data_set(out) == data_set(tmp_path / "undisturbed")
    assert (out / JOURNAL).read_bytes() == b""


def test_a_disk_that_fills_while_the_data_set_is_written_leaves_no_part_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, out = planned(tmp_path, LEANING), tmp_path / "out"

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", full)
    assert swept(plan, out).stopped == "cannot write: No space left on device"
    assert data_set(out) == {}
    monkeypatch.undo()
    assert swept(plan, out, resume=True).stopped is None
    assert len(rows(out)) == 4


def test_a_sweep_is_not_mixed_with_another(tmp_path: Path) -> None:
    plan, out = planned(tmp_path, LEANING), tmp_path / "out"
    swept(plan, out)
    with pytest.raises(ScenarioError, match="holds a sweep already"):
        swept(plan, out)
    other = planned(tmp_path, LEANING.replace("0.3", "0.4"))
    with pytest.raises(ScenarioError, match="is of another sweep"):
        swept(other, out, resume=True)
    with pytest.raises(ScenarioError, match="no sweep to resume"):
        swept(plan, tmp_path / "nothing", resume=True)
    manifest = json.loads((out / MANIFEST).read_text())
    manifest["libraries"]["numpy"] = "1.0"
    (out / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(ScenarioError, match=r"begun with numpy 1\.0"):
        swept(plan, out, resume=True)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"libraries": 3}', "\x00"])
def test_a_damaged_manifest_is_said(tmp_path: Path, text: str) -> None:
    plan = planned(tmp_path, LEANING)
    (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(ScenarioError, match="is not of a sweep"):
        swept(plan, tmp_path, resume=True)


def stopped_without_its_manifest(plan: SweepPlan, out: Path) -> bytes:
    """Make a folder with the rows of a stopped sweep and without its manifest; return its journal."""
    assert swept(plan, out, breaking_off(3, KeyboardInterrupt())).missing == 1
    (out / MANIFEST).unlink()
    return (out / JOURNAL).read_bytes()


def test_a_journal_without_its_manifest_is_not_adopted(tmp_path: Path) -> None:
    plan, out = planned(tmp_path, LEANING), tmp_path / "out"
    journal = stopped_without_its_manifest(plan, out)
    other = planned(tmp_path, LEANING.replace("0.3", "0.4"))
    for one in (other, plan):
        with pytest.raises(ScenarioError, match=r"out: holds the journal\.txt of a sweep without its sweep\.json"):
            swept(one, out)
    assert (out / JOURNAL).read_bytes() == journal
    assert not (out / MANIFEST).exists()


@pytest.mark.parametrize("left", [RESULTS, TIMINGS, STAGING])
def test_what_another_sweep_left_does_not_become_a_part_of_the_data_set(tmp_path: Path, left: str) -> None:
    plan, out = planned(tmp_path, LEANING), tmp_path / "out"
    swept(plan, tmp_path / "other")
    out.mkdir()
    (tmp_path / "other" / (RESULTS if left == STAGING else left)).rename(out / left)
    with pytest.raises(ScenarioError, match=rf"out: holds the {left} of a sweep without its sweep\.json"):
        swept(plan, out)
    assert [path.name for path in out.iterdir()] == [left]


def test_timings_of_another_sweep_are_refused(tmp_path: Path) -> None:
    plan, out = planned(tmp_path, LEANING), tmp_path / "out"
    swept(plan, out)
    swept(planned(tmp_path, LEANING.replace("0.3", "0.4")), tmp_path / "other")
    (out / TIMINGS).write_bytes((tmp_path / "other" / TIMINGS).read_bytes())
    with pytest.raises(ScenarioError, match=r"timing\.parquet: is not of this sweep"):
        swept(plan, out, resume=True)


def test_rows_of_another_sweep_are_refused_and_kept(tmp_path: Path) -> None:
    plan, out = planned(tmp_path, LEANING), tmp_path / "out"
    journal = stopped_without_its_manifest(plan, out)
    # Another sweep's manifest beside them: one of the four runs is another.
    other = planned(tmp_path, LEANING.replace("0.3", "0.4"))
    swept(other, tmp_path / "other")
    (out / MANIFEST).write_bytes((tmp_path / "other" / MANIFEST).read_bytes())
    with pytest.raises(ScenarioError, match=r"journal\.txt: has the row \d, which is not of this sweep"):
        swept(other, out, resume=True)
    assert (out / JOURNAL).read_bytes() == journal
    # And one line among its own.
    with (tmp_path / "other" / JOURNAL).open("ab") as file:
        file.write(journal.splitlines(keepends=True)[0])
    with pytest.raises(ScenarioError, match="which is not of this sweep"):
        swept(other, tmp_path / "other", resume=True)
    # And a block.
    (tmp_path / "other" / JOURNAL).write_bytes(b"")
    swept(plan, tmp_path / "third")
    block = part_of(tmp_path / "other", "reference").with_name("block-00000000.parquet")
    block.write_bytes(part_of(tmp_path / "third", "reference").read_bytes())
    with pytest.raises(ScenarioError, match=r"block-00000000\.parquet: is not of this sweep"):
        swept(other, tmp_path / "other", resume=True)


def test_every_part_of_the_data_set_says_its_format(tmp_path: Path) -> None:
    plan, out = planned(tmp_path, LEANING), tmp_path / "out"
    swept(plan, out)
    for path in (part_of(out, "reference"), out / TIMINGS):
        found = json.loads((pq.read_schema(path).metadata or {})[METADATA_KEY])
        assert found == {"schema_version": 1, "sweep": json.loads((out / MANIFEST).read_text())["key"]}


def test_a_sweep_of_an_earlier_version_is_refused_with_what_to_do(tmp_path: Path) -> None:
    plan, out = planned(tmp_path, LEANING), tmp_path / "out"
    swept(plan, out)
    manifest = json.loads((out / MANIFEST).read_text())
    assert manifest.pop("schema_version") == 4
    # As it was called before.
    (out / MANIFEST).write_text(json.dumps(manifest | {"format": 4}))
    assert swept(plan, out, resume=True).missing == 0
    (out / MANIFEST).write_text(json.dumps(manifest | {"schema_version": 5}))
    with pytest.raises(ScenarioError, match="its schema_version is 5, and this velodrome reads up to 4"):
        swept(plan, out, resume=True)
    for earlier in ({"schema_version": 3}, {}):
        (out / MANIFEST).write_text(json.dumps(manifest | earlier))
        with pytest.raises(ScenarioError, match=r"begun by another version of velodrome.* in another folder by --out"):
            swept(plan, out, resume=True)


def slow(after: int) -> Work:
    """Work that finds a timeout in all but the first so many rows."""

    def work(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        for number, done in enumerate(here(setup, tasks)):
            lost = {"status": "timeout", "reason": f"no result within {setup.time_limit!r} s"}
            yield done if number < after else Done(done.index, lost, {})

    return work


def test_rows_that_timed_out_are_tried_again_when_asked(tmp_path: Path) -> None:
    plan, out = planned(tmp_path, LEANING), tmp_path / "out"
    first = swept(plan, out, slow(1))
    assert (first.counts, status_of(first)) == ({"reference": {"done": 1, "timeout": 3}}, 1)
    assert swept(plan, out, resume=True).counts == first.counts
    stopped = run_sweep(plan, out, breaking_off(1, KeyboardInterrupt()), True, lambda *_: None, ["timeout"])
    assert (stopped.counts, stopped.missing) == ({"reference": {"done": 2, "timeout": 2}}, 2)
    assert json.loads((out / MANIFEST).read_text())["complete"] is False
    seen: list[int] = []
    earlier: list[Mapping[str, int]] = []
    last = run_sweep(plan, out, here, True, lambda done: seen.append(done.index), ["timeout"], earlier.append)
    assert (last.counts, last.missing, status_of(last)) == ({"reference": {"done": 4}}, 0, 0)
    assert earlier == [{"done": 2}]
    assert len(set(seen)) == len(seen) == 2
    swept(plan, tmp_path / "undisturbed")
    assert data_set(out) == data_set(tmp_path / "undisturbed")


def test_another_time_limit_asks_for_the_rows_that_it_ended(tmp_path: Path) -> None:
    out = tmp_path / "out"
    swept(planned(tmp_path, LEANING), out, slow(1))
    longer = planned(tmp_path, LEANING.replace("60.0", "600.0"))
    with pytest.raises(ScenarioError, match=r"status timeout under time_limit 60\.0, .* with --retry timeout"):
        swept(longer, out, resume=True)
    assert run_sweep(longer, out, here, True, lambda *_: None, ["timeout"]).counts == {"reference": {"done": 4}}
    assert swept(longer, out, resume=True).stopped is None


def test_rows_that_ended_under_another_limit_are_found_after_a_stop(tmp_path: Path) -> None:
    def stopped(work: Work, after: int) -> Work:
        def part(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
            yield from islice(work(setup, tasks), after)
            raise KeyboardInterrupt

        return part

    out, text = tmp_path / "out", LEANING
    swept(planned(tmp_path, text), out, stopped(here, 1))
    # A shorter limit, under which rows time out, and back to the first one.
    shorter = planned(tmp_path, text.replace("60.0", "1.0"))
    swept(shorter, out, stopped(slow(0), 2), resume=True)
    plan = planned(tmp_path, text)
    with pytest.raises(ScenarioError, match=r"status timeout under time_limit 1\.0, but the file has 60\.0"):
        swept(plan, out, resume=True)
    # One of the two is tried again, and times out under the longer limit, too; then the other one's limit is asked for.
    run_sweep(plan, out, stopped(slow(0), 1), True, lambda *_: None, ["timeout"])
    for other in (plan, shorter):
        with pytest.raises(ScenarioError, match=r"under time_limit \[1\.0, 60\.0\]"):
            swept(other, out, resume=True)
    last = run_sweep(plan, out, here, True, lambda *_: None, ["timeout"])
    assert (last.counts, last.missing) == ({"reference": {"done": 4}}, 0)
    assert json.loads((out / MANIFEST).read_text())["limits"]["time_limit"] == 60.0


def test_a_point_that_is_none_is_a_row_and_the_others_ride(tmp_path: Path) -> None:
    plan, out = plan_sweep(CASES / "sweep-inertia.toml"), tmp_path / "out"
    outcome = swept(plan, out)
    found = {row["index"]: row for row in rows(out)}
    assert (len(found), status_of(outcome)) == (20, 0)
    for row in found.values():
        inertia = np.array([row[f"bicycle.rear_frame_I{axis}"] for axis in ("xx", "yy", "zz")])
        tensor = np.diag(inertia)
        tensor[0, 2] = tensor[2, 0] = Bicycle().rear_frame_Ixz
        principal = np.linalg.eigvalsh(tensor)
        possible = principal[0] > 0 and principal[2] <= (principal[0] + principal[1]) * (1 + LARGEST_EXCESS)
        assert row["status"] == ("done" if possible else "refused")
        if not possible:
            assert "are not those of a rigid body" in row["reason"]
        elif principal[2] > principal[0] + principal[1]:
            assert "no rigid body has such moments" in row["warnings"]
        else:
            assert row["warnings"] is None
            assert row["version"] is not None
    assert outcome.counts["reference"].keys() == {"done", "refused"}
    document = summarise_sweep(plan, outcome)
    assert all(
        reason.startswith("refused: bicycle: rear_frame_I") for reason in document["engines"]["reference"]["reasons"]
    )
    asked: list[int] = []

    def counting(setup: Setup, tasks: Sequence[Task]) -> Generator[Done]:
        asked.extend(task.index for task in tasks)
        yield from here(setup, tasks)

    again = run_sweep(plan, out, counting, True, lambda *_: None, ["refused"])
    assert sorted(asked) == [index for index, row in sorted(found.items()) if row["status"] == "refused"]
    assert (again.missing, again.counts) == (0, outcome.counts)


def test_a_step_that_an_engine_refuses_is_a_row_when_another_is_not(tmp_path: Path) -> None:
    text = 'engines = ["exudyn"]\n' + UPRIGHT + '"engines.exudyn.step" = [0.01, 0.003]\n'
    plan = planned(tmp_path, text)
    outcome = swept(plan, tmp_path / "out")
    assert outcome.counts == {"exudyn": {"done": 1, "refused": 1}}
    (row,) = (row for row in rows(tmp_path / "out", "exudyn") if row["status"] == "refused")
    assert row["engines.exudyn.step"] == 0.003
    assert row["reason"].startswith("engines.exudyn: ")


def test_parameters_keep_their_types_and_tables_become_json(tmp_path: Path) -> None:
    text = 'scenario = "q2"\ngrid.simulation.duration = [1, 0.5]\ngrid.motion.family = [2]\ngrid.title = ["x"]\n'
    text += "grid.motion.near = [{ lean = 0.74, steer = 2.84 }]"
    plan = planned(tmp_path, text)
    schema = columns.row_schema(plan.parameters, {})
    assert schema.field("simulation.duration").type == pa.float64()
    assert schema.field("motion.family").type == pa.int64()
    row = columns.make_record(plan.tasks[0], {}, schema)
    assert row["motion.near"] == '{"lean": 0.74, "steer": 2.84}'
    assert row["title"] == "x"


def test_the_summary_counts_and_measures(tmp_path: Path) -> None:
    text = 'engines = ["reference", "mujoco-multipliers"]\n' + LEANING + '"engines.mujoco-multipliers.step" = [0.01]'
    plan = planned(tmp_path, text)
    document = summarise_sweep(plan, swept(plan, tmp_path / "out"))
    json.dumps(document, allow_nan=False)
    entry = document["engines"]["mujoco-multipliers"]
    errors = [row["position_error_max"] for row in rows(tmp_path / "out", "mujoco-multipliers")]
    assert entry["rows"] == {"done": 4}
    assert entry["position_error"]["worst"] == max(errors)
    assert document["engines"]["reference"]["position_error"] is None


def test_a_sweep_of_one_run_needs_no_grid(tmp_path: Path) -> None:
    plan = planned(tmp_path, 'scenario = "iftomm-1"')
    swept(plan, tmp_path / "out")
    assert len(rows(tmp_path / "out")) == 1
