"""What `velodrome history` writes for readers: a page, and two rides side by side for every turning point."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from mill import CIRCLE, FAULT, PACKAGE, install_mill, make_wheel, use_registry

from velodrome.engines.storage import read_trajectory
from velodrome.scenarios.commands.options import parse_changes
from velodrome.scenarios.history.pairs import measure_separation, write_pair_command, write_run_commands
from velodrome.scenarios.history.problems import prepare_ride
from velodrome.scenarios.history.releases import Release
from velodrome.scenarios.history.ride import digest_ride
from velodrome.scenarios.history.wheels import WheelFile
from velodrome.scenarios.scenario import load_scenario, make_start


@pytest.mark.slow
def test_pages_follow_the_turning_points(velodrome, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_mill(tmp_path / "installed", monkeypatch)
    registry = tmp_path / "registry"
    use_registry(registry, monkeypatch)
    monkeypatch.setenv("VELODROME_CACHE", str(tmp_path / "cache"))
    (tmp_path / "circle.toml").write_text(CIRCLE, encoding="utf-8")
    make_wheel(registry, "1.0")
    make_wheel(registry, "1.1", stretch=FAULT)
    make_wheel(registry, "1.2", stretch=FAULT)
    out = tmp_path / "out"
    first = velodrome("history", f"{PACKAGE}==1.0,1.2", "circle.toml", "--out", str(out), "--json")
    assert first.status == 0, first.stderr
    (point,) = first.json()["turning_points"]
    assert point["page"] == f"rides/{PACKAGE}-circle-1.0-1.2.html"
    assert point["date"] is None
    assert sorted(path.name for path in (out / "rides").iterdir()) == [
        f"{PACKAGE}-circle-1.0-1.2.html",
        f"{PACKAGE}-circle-1.0-1.2.json",
    ]
    # The document of the two rides has the samples of the table.
    pair = json.loads((out / "rides" / f"{PACKAGE}-circle-1.0-1.2.json").read_text(encoding="utf-8"))
    before, after = pq.ParquetFile(out / "rides.parquet").read().to_pylist()
    assert pair["before"]["time"] == before["sample_time"]
    assert pair["after"]["position"] == [sample[:3] for sample in after["sample_coordinates"]]
    apart = np.array(after["sample_coordinates"])[:, :3] - np.array(before["sample_coordinates"])[:, :3]
    assert pair["distance"]["time"] == before["sample_time"]
    assert pair["distance"]["distance"] == np.linalg.norm(apart, axis=1).tolist()
    assert pair["distance"]["distance"][0] == 0 < pair["distance"]["distance"][-1]
    assert pair["moved"] == point["quantities"]
    check_the_commands(velodrome, pair, tmp_path)
    # Links lead to files and anchors that are there.
    page = (out / "history.html").read_text(encoding="utf-8")
    links = re.findall(r'href="([^"]*)"', page)
    assert point["page"] in links
    assert all(f'id="{link[1:]}"' in page for link in links if link.startswith("#"))
    back = re.findall(r'href="(\.\.[^"]*)"', (out / point["page"]).read_text(encoding="utf-8"))
    assert back
    assert all((out / "rides" / link).resolve() == out / "history.html" for link in back)
    # A release between takes the turning point, and the page of the former one goes.
    second = velodrome("history", f"{PACKAGE}==1.0,1.1,1.2", "circle.toml", "--out", str(out), "--resume", "--json")
    assert second.status == 0, second.stderr
    assert [found["page"] for found in second.json()["turning_points"]] == [f"rides/{PACKAGE}-circle-1.0-1.1.html"]
    assert sorted(path.name for path in (out / "rides").iterdir()) == [
        f"{PACKAGE}-circle-1.0-1.1.html",
        f"{PACKAGE}-circle-1.0-1.1.json",
    ]


def check_the_commands(velodrome, pair: dict[str, Any], folder: Path) -> None:
    """What the page says to paste runs the rides of the history, to the bit, and shows both in one recording."""
    *runs, compare, show = [shlex.split(line) for line in pair["commands"]]
    for words in runs:
        found = velodrome(*words[1:], "--json")
        assert found.status == 0, found.stderr
    rides = [*folder.glob("two-rides/before/*"), *folder.glob("two-rides/after/*")]
    for ride, side in zip(rides, ("before", "after"), strict=True):
        assert digest_ride(read_trajectory(ride / f"{PACKAGE}.parquet")) == pair[side]["bits"]
    globs = [str(ride) for word in compare[2:4] for ride in sorted(folder.glob(word))]
    assert globs == [str(ride) for ride in rides]
    apart = velodrome("diff", *globs, "--out", "compared", "--json")
    assert apart.json()["engines"][PACKAGE]["version"] == [pair["before"]["release"], pair["after"]["release"]]
    assert show == ["velodrome", "view", *compare[2:]]
    assert (folder / "compared" / "diff.rrd").is_file()


def test_distances_are_those_of_samples_that_both_have() -> None:
    before = {"time": [0.0, 1.0, 2.0], "position": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]}
    after = {"time": [0.0, 0.5, 2.0], "position": [[0.0, 0.0, 0.0], [9.0, 9.0, 9.0], [2.0, 3.0, 4.0]]}
    assert measure_separation(before, after) == {"time": [0.0, 2.0], "distance": [0.0, 5.0]}
    assert measure_separation(before, {"time": [0.25], "position": [[0.0, 0.0, 0.0]]}) == {"time": [], "distance": []}


def test_the_command_names_both_releases() -> None:
    wheel = WheelFile("mujoco", "4.0.0", Path("my builds/mujoco.whl"), "ab")
    core = WheelFile("mujoco-core", "4.0.0", Path("my builds/mujoco_core.whl"), "cd")
    released, build = Release("mujoco", "3.9.0"), Release("mujoco", "4.0.0", (wheel, core))
    command = shlex.split(write_pair_command(released, Release("mujoco", "4.0.0"), "mujoco-native", "q2-plus"))
    assert command[:5] == ["velodrome", "history", "mujoco==3.9.0,4.0.0", "q2-plus", "--engine"]
    command = shlex.split(write_pair_command(released, build, "mujoco-native", "q2-plus"))
    assert command[2] == "mujoco==3.9.0"
    given = [command[place + 1] for place, word in enumerate(command) if word == "--wheel"]
    assert given == ["my builds/mujoco.whl", "my builds/mujoco_core.whl"]
    assert shlex.split(write_pair_command(build, build, "mujoco-native", "q2-plus"))[2] == "mujoco"


def test_the_commands_of_the_runs_have_all_that_the_history_rode_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "circle.toml").write_text(CIRCLE, encoding="utf-8")
    ride = prepare_ride("circle.toml")
    core = WheelFile("mujoco", "4.1.0", Path("my builds/mujoco.whl"), "ab")
    before, after, compare, show = write_run_commands(
        Release("mujoco", "3.9.0"), Release("mujoco", "4.1.0", (core,)), "mujoco-native", ride
    )
    words = shlex.split(before)
    assert words[:5] == ["velodrome", "run", "circle.toml", "--engine", "mujoco-native"]
    options = dict(zip(words[5::2], words[6::2], strict=True))
    assert (options["--release"], options["--out"]) == ("mujoco==3.9.0", "two-rides/before")
    changes = parse_changes(
        [words[k + 1] for k, word in enumerate(words) if word == "--set"], float(options["--duration"])
    )
    _, scenario = load_scenario(words[2], changes, "--set")
    assert make_start(scenario).problem.times.tolist() == ride.start.problem.times.tolist()
    assert scenario.engines["mujoco-native"] == ride.settings_of("mujoco-native") != {}
    assert "--release mujoco --wheel 'my builds/mujoco.whl' --duration" in after
    assert compare == "velodrome diff two-rides/before/* two-rides/after/*"
    assert show == "velodrome view two-rides/before/* two-rides/after/*"
