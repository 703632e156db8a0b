"""`velodrome view --web` in a browser: the ride is drawn, nothing complains, and nothing is asked of other machines."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import driven_chromium as driven
import numpy as np
import pytest

from tests.reports.page.headless_page import missing
from velodrome.reports.drawing.palette import assign_colours
from velodrome.reports.recording import brighten
from velodrome.scenarios.run.runner import plan_run, run_plan
from velodrome.scenarios.scenario.schema import load_scenario
from velodrome.scenarios.view.server import LOOPBACK

NATIVE = "mujoco-native"
COLOURS = assign_colours(["reference", NATIVE])

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(missing() is not None, reason=str(missing())),
]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two runs with different steps, without recordings: the command makes them."""
    made = []
    for step in (0.002, 0.001):
        changes = {"simulation.duration": 1.0, f"engines.{NATIVE}.step": step}
        plan = plan_run(*load_scenario("q2-plus", changes), wanted=[NATIVE])
        out = tmp_path_factory.mktemp("runs")
        made.append(run_plan(plan, out, lambda *_: None, lambda _: None, recording=False).folder)
    return made


@contextmanager
def served(*arguments: str) -> Iterator[str]:
    """The address that the command prints."""
    command = [sys.executable, "-c", "from velodrome.scenarios.cli import main; main()", "view", *arguments, "--web"]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    try:
        assert program.stdout is not None
        yield program.stdout.readline().strip()
    finally:
        os.killpg(program.pid, signal.SIGINT)
        program.wait()


def count(pixels: np.ndarray, colour: tuple[int, int, int]) -> int:
    return int((np.abs(pixels - colour).max(-1) < 24).sum())


FRAME = "document.querySelector('#viewer iframe')"
# Its page is light, and the reference nearly white: only what the viewer draws counts.
BOX = f"(() => {{ {FRAME}.scrollIntoView(); const {{ left, top, right, bottom }} = {FRAME}.getBoundingClientRect();"
BOX += " return [left, top, right, bottom]; })()"


def watch(tab: driven.Chromium, colours: list[tuple[int, int, int]], box: str | None = None) -> None:
    """Wait until all these colours are drawn in the viewer: by curves and names, which are not shaded."""
    deadline = time.monotonic() + driven.PATIENCE
    while True:
        left, top, right, bottom = (
            (0, 0, *driven.SIZE) if box is None else (max(0, round(x)) for x in tab.evaluate(box))
        )
        seen = tab.picture()[top:bottom, left:right]
        found = {colour: count(seen, colour) for colour in colours}
        if min(found.values()) > 150:
            return
        if time.monotonic() > deadline:
            raise TimeoutError(f"the viewer does not draw the ride: {found}; the console: {tab.complaints}")
        time.sleep(0.5)


def check_conduct(tab: driven.Chromium) -> None:
    assert tab.complaints == []
    hosts = {urlsplit(address).hostname for address in tab.requests if address.startswith("http")}
    assert hosts == {LOOPBACK}


def test_the_page_of_a_run_has_the_viewer_with_the_ride_in_it(folders: list[Path], tmp_path: Path) -> None:
    assert not (folders[0] / "comparison.rrd").exists()
    with served(str(folders[0])) as address, driven.chromium(tmp_path) as tab:
        tab.open(address)
        tab.wait_for(f"{FRAME} !== null")
        watch(tab, list(COLOURS.values()), BOX)
        size = tab.evaluate(
            f"(() => {{ const drawn = {FRAME}.contentDocument.querySelector('canvas');"
            " return [drawn.width, drawn.height]; })()"
        )
        assert min(size) > 300
        check_conduct(tab)
    assert (folders[0] / "comparison.rrd").exists()


def test_two_runs_are_in_one_viewer(folders: list[Path], tmp_path: Path) -> None:
    """Each ride of the engine has its own shade; the reference, the same to the bit in both, is there once."""
    own = COLOURS[NATIVE]
    with served(*map(str, folders)) as address, driven.chromium(tmp_path) as tab:
        tab.open(address)
        watch(tab, [COLOURS["reference"], own, brighten(own)])
        check_conduct(tab)
