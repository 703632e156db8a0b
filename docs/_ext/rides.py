"""The report page of the ride that the site shows, copied into the site."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from executed import run_commands
from sphinx.application import Sphinx

RIDE = "velodrome run q2-plus --out runs"


def run_folder() -> Path:
    """Return the run folder of the ride, which is ridden if it was not yet."""
    (found,) = (run_commands(RIDE) / "runs").iterdir()
    return found


def _copy_report(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        shutil.copy(run_folder() / "report.html", Path(app.outdir) / "_static" / "report.html")


def setup(app: Sphinx) -> dict[str, Any]:
    """Copy the report when the pages are written."""
    app.connect("build-finished", _copy_report)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
