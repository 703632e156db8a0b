"""A recording in a notebook, by rerun's widget."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any


def make_widget(recording: Path) -> Any:
    """Make rerun's widget with a recording in it.

    Parameters
    ----------
    recording : Path
        A file of rerun's, which is read at once.

    Returns
    -------
    Widget or None
        None outside of a notebook, or where the package ``rerun-notebook`` is not installed.
    """
    if not _in_notebook() or find_spec("rerun_notebook") is None:
        return None
    widget = import_module("rerun_notebook").Viewer(width="auto", height="auto")
    # It is kept until the widget is on the page.
    widget.send_rrd(recording.read_bytes())
    return widget


def _in_notebook() -> bool:
    """Whether a notebook's kernel runs this process; a terminal shows no widget."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return getattr(shell, "kernel", None) is not None
