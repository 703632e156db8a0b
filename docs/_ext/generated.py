"""References that are generated from schemas and code: a line ``<!-- generated: WHAT -->`` becomes what it names."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

# The modules beside this one: Sphinx loads extensions by name from this folder.
sys.path.insert(0, str(Path(__file__).parent))

from command_pages import describe_commands
from documents import describe_columns_of_trajectories, describe_documents
from engine_settings import describe_engines
from faces import describe_module
from histories import describe_history, describe_turning_point
from metric_tables import describe_columns, describe_metrics
from scenario_files import describe_scenario_file, describe_sweep_file

GENERATORS: dict[str, Callable[..., str]] = {
    "api": describe_module,
    "columns": describe_columns,
    "commands": describe_commands,
    "documents": describe_documents,
    "engines": describe_engines,
    "history": describe_history,
    "metrics": describe_metrics,
    "scenario-file": describe_scenario_file,
    "sweep-file": describe_sweep_file,
    "trajectory-columns": describe_columns_of_trajectories,
    "turning-point": describe_turning_point,
}
MARK = re.compile(r"^<!-- generated: ([a-z-]+)((?: [\w.]+)*) -->$", re.MULTILINE)
_MADE_BY_THE_BUILD = re.compile(rf"{MARK.pattern}|^```\{{(drawn|typed)\}}", re.MULTILINE)


def fill_page(text: str) -> str:
    """Replace every mark in a page by what it names.

    Raises
    ------
    ValueError
        If there is no such generator.
    """

    def fill(mark: re.Match[str]) -> str:
        if mark[1] not in GENERATORS:
            raise ValueError(f"nothing is generated under {mark[1]!r}; there are {', '.join(GENERATORS)}")
        return GENERATORS[mark[1]](*mark[2].split())

    return MARK.sub(fill, text)


def _fill_source(app: Sphinx, docname: str, source: list[str]) -> None:
    source[0] = fill_page(source[0])


def _forget_pages(app: Sphinx, env: Any, added: Any, changed: Any, removed: Any) -> list[str]:
    """Pages with marks, runs or figures are read in every build: what they are made from is no file of the site."""
    pages = {name: Path(env.doc2path(name)).read_text(encoding="utf-8") for name in env.found_docs}
    return [name for name, text in pages.items() if _MADE_BY_THE_BUILD.search(text)]


def setup(app: Sphinx) -> dict[str, Any]:
    """Fill pages when they are read."""
    app.connect("source-read", _fill_source)
    app.connect("env-get-outdated", _forget_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
