"""What the site and the README show is run: code in Python, and the commands' spelling."""

from __future__ import annotations

import re
import runpy
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
import typer
from pages import DOCS, ROOT, Block, blocks, source_pages

from velodrome.reference.bicycle import Bicycle
from velodrome.scenarios.cli import app
from velodrome.scenarios.scenario import insert_bicycle_file, read_toml, validate_scenario
from velodrome.scenarios.sweep.file import SweepFile

# Pages whose code takes more than some seconds, and figures other than the first ride's.
SLOW = {DOCS / "guides" / "own-engine.md", DOCS / "index.md", DOCS / "gallery.md", DOCS / "start" / "report.md"}
CODE = [page for page in source_pages() if blocks(page, "python")]
DRAWN = [block for page in source_pages() for block in blocks(page, "{drawn}")]
FIGURED = [block for page in source_pages() for block in blocks(page, "{figured}")]
SHELL = [
    (page, line)
    for page in source_pages()
    for block in blocks(page, "sh", "{typed}", "{figured}", "yaml")
    for line in re.findall(r"(?:^|- run: |bin/)(velodrome .*)$", block.text, re.MULTILINE)
]
TOML = [block for page in source_pages() for block in blocks(page, "toml")]


def marked(page: Path, *values: Any, name: str) -> Any:
    return pytest.param(*values, id=name, marks=[pytest.mark.slow] if page in SLOW else [])


@pytest.mark.parametrize("page", [marked(page, page, name=str(page.relative_to(ROOT))) for page in CODE])
def test_the_code_of_a_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All blocks of a page are one program, as a reader would type them."""
    run_code("\n".join(block.text for block in blocks(page, "python")), tmp_path, monkeypatch)


@pytest.mark.parametrize("block", [marked(block.page, block, name=block.name) for block in DRAWN])
def test_the_code_of_a_figure_draws_it(block: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas")
    if "picture-only" in block.options:
        pytest.importorskip("sphinx")
    figure = run_code(block.text, tmp_path, monkeypatch)["figure"]
    figure.savefig(tmp_path / "figure.png")
    # A caption says what is seen to those who do not see it.
    assert re.search(r"^:alt: \S", block.options, re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("block", FIGURED, ids=[block.name for block in FIGURED])
def test_the_commands_of_a_figure_write_it(block: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sphinx")
    import executed

    options = dict(re.findall(r"^:(\w+): (.+)$", block.options, re.MULTILINE))
    monkeypatch.setattr(executed, "MADE", tmp_path)
    folder = executed.run_commands(block.text, [ROOT / name for name in options.get("input", "").split()])
    for name in options["figure"].split():
        assert (folder / name).stat().st_size > 10_000
    assert options["alt"]


def run_code(code: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Run code from a file, since numba caches what is in files, and call the tests that it defines."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    file = folder / "example.py"
    file.write_text(code, encoding="utf-8")
    names = runpy.run_path(str(file))
    for name, value in names.items():
        if name.startswith("test_"):
            value()
    return names


@pytest.mark.parametrize(("page", "line"), SHELL, ids=[line for _, line in SHELL])
def test_a_command_exists_with_its_options(page: Path, line: str) -> None:
    words = shlex.split(line, comments=True)[1:]
    group: Any = typer.main.get_command(app)
    name, chosen, rest = group.resolve_command(group.make_context("velodrome", list(words)), words)
    chosen.make_context(name, rest)  # raises on an option that there is not


def test_there_are_commands_to_look_at() -> None:
    assert len(SHELL) > 25


@pytest.mark.parametrize("block", TOML, ids=[block.name for block in TOML])
def test_a_scenario_or_a_sweep_is_valid(block: Block, tmp_path: Path) -> None:
    data = read_toml(block.text)
    if "scenario" in data:
        SweepFile.model_validate(data)
        return
    # A piece of a file is put into a whole one.
    whole = {
        "title": "a whole one",
        "surface": {"kind": "plane"},
        "motion": {"kind": "upright", "speed": 5.0},
        "simulation": {"duration": 1.0},
    }
    if "file" in data.get("bicycle", {}):
        lines = (f"{name} = {value!r}" for name, value in asdict(Bicycle()).items())
        (tmp_path / data["bicycle"]["file"]).write_text("\n".join(lines), encoding="utf-8")
    validate_scenario(insert_bicycle_file({**whole, **data}, tmp_path), block.name)
