"""The scenario of a run folder: once changed, nothing in the folder is taken for the run any more."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import velodrome
from tests.sealing import sealed
from velodrome.scenarios.compare import read_pair
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.view import open_native, serve
from velodrome.scenarios.view.viewing import stored_page

NATIVE = "mujoco-native"
EDITS = {
    "wheelbase": ("wheelbase = 1.02", "wheelbase = 1.03"),
    "duration": ("duration = 0.1", "duration = 0.2"),
    "step": ("step = 0.002", "step = 0.001"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = velodrome.run("q2", engines=[NATIVE], duration=0.1, out=tmp_path_factory.mktemp("runs"))
    assert run.folder is not None
    return run.folder


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "copy"))


def change(folder: Path, edit: str) -> None:
    path, (before, after) = folder / "scenario.toml", EDITS[edit]
    text = path.read_text(encoding="utf-8")
    assert text.count(before) == 1
    path.write_text(text.replace(before, after), encoding="utf-8")


def serve_page(folder: Path) -> None:
    serve(folder, 0, lambda address: pytest.fail(f"served at {address}"))


@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.parametrize("read", [velodrome.load, open_native, serve_page, stored_page])
def test_a_changed_scenario_is_refused(read: Callable[[Path], Any], edit: str, copy: Path) -> None:
    change(copy, edit)
    words = rf"^{re.escape(str(copy / 'scenario.toml'))}: was changed since the run was made: .* give a changed copy"
    with pytest.raises(ScenarioError, match=words):
        read(copy)


@pytest.mark.parametrize("edit", EDITS)
def test_a_changed_scenario_is_not_compared(edit: str, folder: Path, copy: Path) -> None:
    assert read_pair(folder, copy).before.trajectories.keys() == {"reference", NATIVE}
    change(copy, edit)
    for pair in ((folder, copy), (copy, folder)):
        with pytest.raises(ScenarioError, match=rf"{re.escape(str(copy))}.*was changed since the run was made"):
            read_pair(*pair)


def test_a_folder_without_a_digest_of_its_scenario_is_read(folder: Path, copy: Path) -> None:
    path = copy / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8"))
    del manifest["scenario_sha256"]
    path.write_text(sealed(manifest), encoding="utf-8")
    assert velodrome.load(copy).metrics == velodrome.load(folder).metrics
    assert read_pair(folder, copy).before.trajectories.keys() == {"reference", NATIVE}
    assert stored_page(copy) == (copy / "report.html").read_text(encoding="utf-8")
