"""Directives that run what a page shows.

``typed``: commands with what they print; ``figured``: commands with the figures that they write; ``drawn``: code with
its figure.

What was run once is kept under ``docs/made`` and used again as long as nothing changes that it could depend on: its
text, the package, and the versions of its libraries.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

import velodrome

DOCS = Path(__file__).parents[1]
MADE = DOCS / "made"
COLUMNS = 100  # letters in a line: the whole table of a run
_PIXELS_DRAWN, _PIXELS_PRINTED, _PIXELS_SHOWN = 160, 300, 96  # an inch
_LIBRARIES = ("exudyn", "mujoco", "numpy", "scipy", "numba", "matplotlib")


@cache
def package_digest() -> str:
    """Digest of all that a run may depend on beside its own text."""
    found = hashlib.sha256(platform.python_version().encode())
    for library in _LIBRARIES:
        found.update(f"{library} {version(library)}\n".encode())
    (package,) = velodrome.__path__
    for folder, folders, files in os.walk(package, followlinks=True):
        folders.sort()
        for name in sorted(files):
            if name.endswith((".py", ".toml", ".json", ".html", ".css", ".js")):
                found.update(Path(folder, name).read_bytes())
    return found.hexdigest()


def keep(what: str, text: str, make: Callable[[Path], None]) -> Path:
    """Return the folder of what was made of a text, and make it if it is not there.

    Parameters
    ----------
    what : str
        First part of the folder's name.
    text : str
        What is run.
    make : callable
        Fills the folder that it is given.
    """
    key = hashlib.sha256(f"{package_digest()}\n{text}".encode()).hexdigest()[:16]
    folder = MADE / f"{what}-{key}"
    if not folder.exists():
        begun = MADE / f"{what}-{key}-{os.getpid()}"
        shutil.rmtree(begun, ignore_errors=True)
        begun.mkdir(parents=True)
        make(begun)
        if folder.exists():  # another process of the build made the same
            shutil.rmtree(begun)
        else:
            begun.rename(folder)
    return folder


def run_commands(lines: str, inputs: Sequence[Path] = ()) -> Path:
    """Run commands of `velodrome`, a line each, in a folder of their own; return the folder.

    The folder holds copies of the inputs, what the commands write, and ``printed.json``: what each printed on stdout.

    Raises
    ------
    ExtensionError
        If a line is no command of `velodrome` or ends with another status than 0 or 1.
    """

    def make(folder: Path) -> None:
        printed = []
        for path in inputs:
            shutil.copy(path, folder)
        environment = {**os.environ, "COLUMNS": str(COLUMNS), "NO_COLOR": "1"}
        for line in lines.splitlines():
            words = shlex.split(line, comments=True)
            if not words or words[0] != "velodrome":
                raise ExtensionError(f"{line!r} is no command of velodrome")
            script = "from velodrome.scenarios.cli import main; main()"
            done = subprocess.run(
                [sys.executable, "-c", script, *words[1:]],
                cwd=folder,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode not in (0, 1):
                raise ExtensionError(f"{line}: {done.stderr}")
            # Where the command lies on this machine is nobody's business.
            installed = str(Path(sys.executable).with_name("velodrome"))
            printed.append(done.stdout.strip("\n").replace(installed, "velodrome"))
        (folder / "printed.json").write_text(json.dumps(printed), encoding="utf-8")

    contents = "".join(path.read_text(encoding="utf-8") for path in inputs)
    return keep("typed", f"{contents}{lines}", make)


def read_printed(folder: Path) -> list[str]:
    """What the commands of `run_commands` printed, one text each."""
    return json.loads((folder / "printed.json").read_text(encoding="utf-8"))


def draw_figure(code: str) -> Path:
    """Run code that leaves a matplotlib figure called ``figure``; return the path of its picture.

    Raises
    ------
    ExtensionError
        If it leaves none.
    """

    def make(folder: Path) -> None:
        names: dict[str, Any] = {"__name__": "drawn"}
        before = Path.cwd()
        os.chdir(folder)
        try:
            exec(compile(code, "<drawn>", "exec"), names)
        finally:
            os.chdir(before)
            plt.close("all")  # the figure lives on, but pyplot would count it
        if "figure" not in names:
            raise ExtensionError(f"code of a picture leaves no figure:\n{code}")
        names["figure"].savefig(folder / "figure.png", dpi=_PIXELS_DRAWN, metadata={"Software": None})

    return keep("drawn", code, make) / "figure.png"


class Typed(SphinxDirective):
    """Commands of `velodrome`, run when the site is built, and what they print."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return a block of the commands and one of what they printed."""
        printed = read_printed(run_commands("\n".join(self.content)))
        found: list[nodes.Node] = []
        for line, text in zip(self.content, printed, strict=True):
            found.append(nodes.literal_block(line, line, language="sh"))
            if text:
                found.append(nodes.literal_block(text, text, language="text", classes=["printed"]))
        return found


class Figured(SphinxDirective):
    """Commands of `velodrome`, run when the site is built, and the figures that they write."""

    has_content = True
    option_spec = {  # noqa: RUF012
        "alt": directives.unchanged_required,
        "figure": directives.unchanged_required,
        "input": directives.unchanged,
    }

    def run(self) -> list[nodes.Node]:
        """Return the pictures and the block of commands."""
        if "alt" not in self.options or "figure" not in self.options:
            raise self.error("figures need :figure:, their files, and :alt:, for those who do not see them")
        lines = "\n".join(self.content)
        folder = run_commands(lines, [DOCS.parent / name for name in self.options.get("input", "").split()])
        images = []
        for name in self.options["figure"].split():
            if not (folder / name).exists():
                raise self.error(f"the commands do not write {name}")
            images.append(show_picture(self.env, folder / name, self.options["alt"], _PIXELS_PRINTED))
        return [*images, nodes.literal_block(lines, lines, language="sh")]


def show_picture(env: Any, picture: Path, alt: str, pixels: float) -> nodes.image:
    """Return a picture of a number of pixels an inch, as large as text of the same size in inches, or the page."""
    source = os.path.relpath(picture, Path(env.doc2path(env.docname)).parent)
    width = f"{round(_PIXELS_SHOWN * plt.imread(picture).shape[1] / pixels)}px"
    return nodes.image(uri=Path(source).as_posix(), alt=alt, classes=["drawn"], width=width)


class Drawn(SphinxDirective):
    """Code that leaves a figure, and the figure."""

    has_content = True
    option_spec = {"alt": directives.unchanged_required, "picture-only": directives.flag}  # noqa: RUF012

    def run(self) -> list[nodes.Node]:
        """Return the block of code and the picture."""
        if "alt" not in self.options:
            raise self.error("a picture needs :alt:, for those who do not see it")
        code = "\n".join(self.content)
        picture = draw_figure(code)
        image = show_picture(self.env, picture, self.options["alt"], _PIXELS_DRAWN)
        return (
            [image] if "picture-only" in self.options else [image, nodes.literal_block(code, code, language="python")]
        )


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_directive("typed", Typed)
    app.add_directive("drawn", Drawn)
    app.add_directive("figured", Figured)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
