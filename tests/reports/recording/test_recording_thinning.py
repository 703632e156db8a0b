"""Long rides in a recording: fewer samples, no lost peak, and it is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded import BICYCLE, BOWL, Content, flat, ride

from velodrome.engines.engine import REFERENCE, Trajectory
from velodrome.reference.kinematics import LEAN
from velodrome.reports.recording import write_recording
from velodrome.reports.recording.thinning import MOST_SAMPLES, choose_stride, describe_thinning

PEAK = 137  # a sample that no stride of ten takes


@pytest.fixture(scope="module")
def rides() -> dict[str, Trajectory]:
    jolted = ride("jolted")
    q = jolted.q.copy()
    q[PEAK, LEAN] += 0.2
    return {REFERENCE: ride(REFERENCE), "jolted": replace(jolted, q=q), "short": ride("short", 58, ended="it fell")}


def length(run: Trajectory, samples: int) -> Trajectory:
    """A ride with as many samples, which differ in time only."""
    return replace(run.first(1), time=np.arange(samples) * 0.01)


@pytest.mark.parametrize(
    ("samples", "rate", "stride"),
    [
        (MOST_SAMPLES + 1, None, 1),
        (MOST_SAMPLES + 2, None, 2),
        (60_001, None, 24),
        (201, 100.0, 1),
        (201, 1000.0, 1),
        (201, 99.9, 2),
        (201, 50.0, 2),
        (201, 30.0, 4),
        (201, 0.1, 1000),
        (1, 10.0, 1),
    ],
)
def test_no_more_samples_than_asked_for(
    rides: dict[str, Trajectory], samples: int, rate: float | None, stride: int
) -> None:
    runs = [length(rides["short"], 1), length(rides[REFERENCE], samples)]
    assert choose_stride(runs, rate) == stride
    assert (describe_thinning(runs, stride) is None) == (stride == 1)


def test_a_rate_thins_what_is_seen_and_keeps_first_last_and_peaks(rides: dict[str, Trajectory], tmp_path: Path) -> None:
    path = tmp_path / "thin.rrd"
    said = write_recording(path, "thin", BICYCLE, BOWL, rides, "**All.**", "# A ride", rate=10.0)
    assert said == (
        "The recording holds every 10th sample, 10 of 100 a second, and curves' peaks between them; "
        "the Parquet files hold all samples."
    )
    content = Content(path)
    assert flat(content.static["/summary", "TextDocument:text"]).tolist() == [f"# A ride\n\n{said}\n"]
    for name, run in rides.items():
        time, step, position = content.values(f"/world/{name}/rear_frame", "Transform3D:translation")
        kept = sorted({*range(0, len(run.time), 10), len(run.time) - 1})
        np.testing.assert_array_equal(step, kept)
        np.testing.assert_array_equal(time, np.array(kept) * 10_000_000)
        np.testing.assert_array_equal(position, run.body_position[kept, 0].astype(np.float32))
    time, _, lean = content.values("/plots/lean/tested/jolted", "Scalars:scalars")
    assert len(time) <= 20
    assert PEAK * 10_000_000 in time
    assert lean.max() == rides["jolted"].q[PEAK, LEAN]


def test_every_sample_is_there_and_nothing_said_otherwise(rides: dict[str, Trajectory], tmp_path: Path) -> None:
    path = tmp_path / "whole.rrd"
    assert write_recording(path, "whole", BICYCLE, BOWL, rides, "", "# A ride", rate=100.0) is None
    content = Content(path)
    assert len(content.values(f"/world/{REFERENCE}/rear_frame", "Transform3D:translation")[0]) == 201
    assert flat(content.static["/summary", "TextDocument:text"]).tolist() == ["# A ride"]
