"""Pictures of a report page, taken in Chromium without a display.

``python -m tests.reports.page.headless_page PAGE PICTURE [light|dark [WIDTH HEIGHT]]`` takes one; PAGE is a path or
an address, with ``#hide=ENGINE,ENGINE&t=SECONDS`` to choose what it shows.
``python -m tests.reports.page.headless_page install`` installs Chromium from Debian's packages.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome")
SIZE = (1280, 5600)
PATIENCE = 120  # for a busy machine [s]
# Said by the browser of the page, not of the machine that it runs on.
CONSOLE = re.compile(r":[A-Z]+:CONSOLE[:(](.*)")


def browser() -> str | None:
    """Path of a Chromium, if there is one."""
    return next((path for path in map(shutil.which, NAMES) if path is not None), None)


def missing() -> str | None:
    """Why no picture can be taken here; None if one can."""
    if browser() is None:
        return "no Chromium; python -m tests.reports.page.headless_page install gets Debian's, as root"
    return None


def install() -> None:
    """Install Chromium from Debian's packages."""
    for command in (["apt-get", "update"], ["apt-get", "install", "--yes", "--no-install-recommends", "chromium"]):
        subprocess.run(command, check=True)


def _run(address: str, *options: str) -> tuple[str, list[str]]:
    """Open a page: what is written to stdout, and what the page's console says."""
    program = browser()
    assert program is not None
    with tempfile.TemporaryDirectory() as profile:
        command = [program, "--headless=new", "--disable-gpu", "--hide-scrollbars", "--no-first-run"]
        # Its sandbox does not start as root, as in a container; the page is our own.
        command += ["--no-sandbox", "--disable-dev-shm-usage", f"--user-data-dir={profile}"]
        command += ["--enable-logging=stderr", "--v=0", *options, address]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=True)
    return done.stdout, [found.group(1) for line in done.stderr.splitlines() if (found := CONSOLE.search(line))]


def picture(address: str, path: Path, dark: bool = False, size: tuple[int, int] = SIZE) -> list[str]:
    """Take a picture of a page; returns all that its console says."""
    options = [f"--screenshot={path}", "--window-size={},{}".format(*size)]
    _, said = _run(address, *options, *(["--force-dark-mode"] if dark else []))
    return said


def document(address: str) -> str:
    """The page's HTML after its script has run."""
    text, said = _run(address, "--dump-dom")
    assert not said, said
    return text


if __name__ == "__main__":
    if sys.argv[1:] == ["install"]:
        install()
    else:
        where, taken, *rest = sys.argv[1:]
        window = (int(rest[1]), int(rest[2])) if rest[1:] else SIZE
        address = (
            where
            if "://" in where
            else Path(where.split("#")[0]).resolve().as_uri() + "".join(where.partition("#")[1:])
        )
        for line in picture(address, Path(taken), rest[:1] == ["dark"], window):
            print(line, file=sys.stderr)
