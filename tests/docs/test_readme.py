"""The table that the README prints is that of a real run."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from pages import ROOT, blocks

pytestmark = pytest.mark.once  # figures of the newest libraries

# Remarks and figures are those of the libraries that constraints.txt pins.
PINNED = dict(line.split("==") for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines())
PRINTED = next(block.text for block in blocks(ROOT / "README.md", "text"))
# Half a unit of the second digit is up to 5 % of a figure. Below this its digits are those of round-off, which differ
# from machine to machine; see `velodrome.reports.measure.limits`.
TWO_DIGITS, ROUND_OFF_MATTERS = 0.05, 1e-7


def table_of(text: str) -> tuple[list[list[str]], dict[str, list[str]]]:
    """Heading and rows by engine of a run's table, up to the remarks."""
    lines = text.strip().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("engine "))
    heading = [line.split() for line in lines[first - 2 : first + 1]]
    rows = {}
    for line in lines[first + 1 :]:
        name, *cells = line.split()
        if len(cells) != len(heading[2]) - 1 or not re.fullmatch(r"[\d.e+-]+|–", cells[-1]):
            break
        rows[name] = cells
    return heading, rows


def run_printed(duration: str, folder: Path) -> str:
    code = "from velodrome.scenarios.cli import main; main()"
    command = [sys.executable, "-c", code, "run", "q2-plus", "--duration", duration, "--out", str(folder)]
    environment = {**os.environ, "COLUMNS": "120"}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=True).stdout


def test_the_columns_and_engines_are_those_of_a_run(tmp_path: Path) -> None:
    printed, ridden = table_of(PRINTED), table_of(run_printed("0.5", tmp_path))
    assert printed[0] == ridden[0]
    assert sorted(printed[1]) == sorted(ridden[1])  # their order is that of the errors, over the duration
    assert len(printed[1]) > 5
    # A line says what each column is.
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for title in zip(printed[0][0], printed[0][1], strict=True):
        meaning = [line for line in text.splitlines() if line.startswith("- **") and title[0] in line.split("**")[1]]
        assert meaning, title


@pytest.mark.slow
def test_the_figures_and_remarks_are_those_of_a_run(tmp_path: Path) -> None:
    if any(version(name) != PINNED[name] for name in ("exudyn", "mujoco")):
        pytest.skip("other versions of the engines than those that constraints.txt pins")
    ridden = run_printed("20", tmp_path)
    rows = table_of(ridden)[1]
    assert list(rows) == list(table_of(PRINTED)[1])
    for engine, cells in table_of(PRINTED)[1].items():
        for printed, found in zip(cells[:-1], rows[engine][:-1], strict=True):  # CPU time is the machine's
            assert (printed == "–") == (found == "–"), engine
            if printed == "–":
                continue
            expected, value = float(printed), float(found)
            if abs(expected) > ROUND_OFF_MATTERS:
                assert math.isclose(value, expected, rel_tol=TWO_DIGITS), f"{engine}: {found} is not {printed}"
            else:
                assert abs(value) < 10 * abs(expected), f"{engine}: {found} is far above {printed}"
    remarks = [line for line in PRINTED.splitlines()[1:] if ": " in line]
    assert len(remarks) > 3
    for line in remarks:
        assert line in ridden.splitlines(), line
