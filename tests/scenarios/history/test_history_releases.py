"""Releases as the command line names them: lists, ranges, wheels, and what is neither."""

from __future__ import annotations

from pathlib import Path

import pytest
from mill import make_wheel

from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.history.releases import (
    Release,
    nearest_version,
    order_releases,
    parse_release_range,
    read_wheel_releases,
)

THERE = ["4.0.0", "3.10.0", "3.9.0", "3.3.7", "3.3.0", "3.2.7", "4.1.0rc1"]


@pytest.mark.parametrize(
    ("text", "selected"),
    [
        ("mujoco==3.9.0,4.0.0", ["3.9.0", "4.0.0"]),
        ("mujoco == 4.0.0 , 3.9.0", ["3.9.0", "4.0.0"]),
        ("mujoco==3.3.*,4.0.0", ["3.3.0", "3.3.7", "4.0.0"]),
        ("mujoco>=3.3,<=4.0", ["3.3.0", "3.3.7", "3.9.0", "3.10.0", "4.0.0"]),
        ("mujoco>=3.3,!=3.9.0,<4", ["3.3.0", "3.3.7", "3.10.0"]),
        ("mujoco~=3.3.0", ["3.3.0", "3.3.7"]),
        ("MuJoCo>=4.1rc1", ["4.1.0rc1"]),
    ],
)
def test_a_range_selects_releases_oldest_first(text: str, selected: list[str]) -> None:
    found = parse_release_range(text)
    assert found.package == "mujoco"
    assert found.select(THERE) == selected


def test_only_versions_that_are_written_out_are_exact() -> None:
    assert parse_release_range("mujoco==3.9.0,4.0.0").exact == ("3.9.0", "4.0.0")
    assert parse_release_range("mujoco==3.9.*").exact is None
    assert parse_release_range("mujoco>=3.9").exact is None


@pytest.mark.parametrize("text", ["mujoco=3", "mujoco>=3,4", "==3", "mujoco[all]==3", "mujoco==", "a b==1", "mujoco@x"])
def test_what_is_no_range_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(ScenarioError, match=r"e\.g\. 'mujoco==3\.9\.0,4\.0\.0'") as told:
        parse_release_range(text)
    assert "\n" not in str(told.value)


def test_wheels_stand_after_the_release_of_their_version_and_once(tmp_path: Path) -> None:
    paths = [make_wheel(tmp_path, "1.1+fault"), make_wheel(tmp_path / "again", "1.0")]
    local, twin = read_wheel_releases(paths, "wheelmill")
    found = order_releases("wheelmill", ["1.10", "1.1", "1.0"], [local, twin, twin])
    assert [release.label for release in found] == [
        "1.0",
        f"1.0 wheel {str(twin.digest)[:8]}",
        "1.1",
        f"1.1+fault wheel {str(local.digest)[:8]}",
        "1.10",
    ]
    assert len({release.key for release in found}) == 5


def test_a_wheel_of_another_content_is_another_release(tmp_path: Path) -> None:
    paths = [make_wheel(tmp_path / "a", "1.0"), make_wheel(tmp_path / "b", "1.0", stretch=1.1)]
    one, other = read_wheel_releases(paths, "wheelmill")
    assert one.key != other.key
    assert one.key != Release("wheelmill", "1.0").key


@pytest.mark.parametrize(
    ("wanted", "near"), [("3.4", "3.9.0"), ("9", "4.1.0rc1"), ("0.1", "3.2.7"), ("3.9.*", "3.9.0")]
)
def test_the_nearest_release(wanted: str, near: str) -> None:
    assert nearest_version(wanted, THERE) == near
    assert nearest_version(wanted, []) is None
