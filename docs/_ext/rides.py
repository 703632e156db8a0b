"""The report page of the ride that the site shows, with links into the site."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from executed import run_commands
from sphinx.application import Sphinx

from velodrome.scenarios.view import stored_page

RIDE = "velodrome run q2-plus --out runs"


def run_folder() -> Path:
    """Return the run folder of the ride, which is ridden if it was not yet."""
    (found,) = (run_commands(RIDE) / "runs").iterdir()
    return found


def _write_report(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        page = stored_page(run_folder(), docs="..")
        (Path(app.outdir) / "_static" / "report.html").write_text(page, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the report when the pages are written."""
    app.connect("build-finished", _write_report)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
