"""`velodrome warm-up`: kernels compiled ahead."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from velodrome.reference.kernels import cache
from velodrome.scenarios.cli import main
from velodrome.scenarios.commands import warm_up

COMMAND = "from velodrome.scenarios.cli import main; main()"


def test_part_that_fails_is_told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The other parts are done; the exit status is 1."""
    monkeypatch.setattr(warm_up, "_USES", (("list", "--json"), ("show", "nothing-like-it")))
    monkeypatch.setattr(sys, "argv", ["velodrome", "warm-up", "--json", "--processes", "2"])
    with pytest.raises(SystemExit) as ended:
        main()
    found = json.loads(capsys.readouterr().out)
    assert ended.value.code == 1
    assert list(found["failures"]) == ["show nothing-like-it"]
    assert "nothing-like-it" in found["failures"]["show nothing-like-it"]
    assert Path(found["folder"]) == cache.find_kernel_folder()


def test_without_a_writable_folder_the_variable_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    warm_up._show({"compiled": 0, "kernels": 3, "seconds": 1.0, "folder": None, "failures": {}})
    shown = capsys.readouterr().out
    assert "compiled: 0 of 3 kernels in 1.0 s" in shown
    assert "NUMBA_CACHE_DIR" in shown


@pytest.mark.slow
def test_after_it_nothing_is_compiled(tmp_path: Path) -> None:
    """Neither by the command itself nor by another command."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}

    def call(*arguments: str) -> str:
        command = [sys.executable, "-c", COMMAND, *arguments]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout

    first = json.loads(call("warm-up", "--json"))
    assert first["compiled"] == first["kernels"] == len(list(tmp_path.rglob("*.nbc"))) > 100
    assert json.loads(call("warm-up", "--json"))["compiled"] == 0
    call("run", "q2", "--duration", "0.1", "--no-recording", "--out", str(tmp_path / "runs"))
    call("circular", "--alpha", "0.01", "--rear-rate", "20", "--family", "2", "--json")
    sweep = tmp_path / "two.toml"
    sweep.write_text('scenario = "q2"\n[grid]\nperturbation.lean_rate = [0.1, 0.2]\nsimulation.duration = [0.1]\n')
    call("sweep", str(sweep), "--workers", "1", "--out", str(tmp_path / "sweep"))
    assert len(list(tmp_path.rglob("*.nbc"))) == first["kernels"]
