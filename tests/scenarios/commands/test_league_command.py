"""`velodrome league`: its tables, its files and its exit status."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

RIDE = ("league", "plane-circle", "--engine", "mujoco-native", "--duration", "0.3", "--levels", "1")


def test_the_tables_keep_engines_whole_at_sixty_columns(velodrome, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    engines = ("--engine", "exudyn-plane-normal", "--engine", "mujoco-multipliers")
    result = velodrome(*RIDE, *engines)
    assert result.status == 0
    lines = result.stdout.splitlines()
    tables = [line for line in lines if line.startswith(("reference", "mujoco-", "exudyn-")) and "creeps" not in line]
    assert len(tables) % 4 == 0
    assert {line.split()[0] for line in tables} == {
        *("reference", "mujoco-native", "mujoco-multipliers", "exudyn-plane-normal")
    }
    assert all(len(line.rstrip()) <= 60 for line in tables)
    first = [line.split() for line in tables[:4]]
    errors = [float(cells[1]) for cells in first[1:]]
    assert first[0][:2] == ["reference", "–"]
    assert errors == sorted(errors)
    assert any(line.startswith("wheels creep, slip = J̇q̇ / b, with 1 / b: mujoco-native ") for line in lines)
    assert "written: league/league.html" in lines


def test_the_document_is_printed_and_stored(velodrome, tmp_path: Path) -> None:
    result = velodrome(*RIDE, "--json", "--out", "found")
    assert result.status == 0
    assert result.json() == json.loads((tmp_path / "found/league.json").read_text())
    assert result.json()["engines"]["mujoco-native"]["scenarios"]["plane-circle"]["status"] == "rode"


def test_settings_from_a_file_are_ridden_and_named(velodrome, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('[engines.mujoco-native]\nstep = 0.001\nsource = "<me>"\n')
    result = velodrome(*RIDE, "--settings", "mine.toml", "--json")
    entry = result.json()["engines"]["mujoco-native"]
    assert entry["settings_source"] == "mine.toml: <me>"
    assert entry["scenarios"]["plane-circle"]["step"] == pytest.approx(0.001)
    page = (tmp_path / "league/league.html").read_text()
    assert "mine.toml: &lt;me&gt;" in page


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("no-such",), "no scenario 'no-such' in the library"),
        (("plane-circle", "--engine", "exudin"), "did you mean 'exudyn'?"),
        (("plane-circle", "--settings", "none.toml"), "--settings none.toml: cannot be read"),
        (("plane-circle", "--levels", "0"), "--levels"),
        (("plane-circle", "--set", "engines.exudyn.step=0.001"), "put them into a file for --settings"),
        (("plane-circle", "--out", ""), "--out: it is empty"),
    ],
)
def test_bad_input_is_one_line(velodrome, arguments: tuple[str, ...], said: str, tmp_path: Path) -> None:
    result = velodrome("league", *arguments)
    assert result.status == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert list(tmp_path.iterdir()) == []
