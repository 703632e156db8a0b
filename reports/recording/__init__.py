"""A run as a recording for the rerun viewer."""

from .notebook import make_widget
from .rerun_file import write_recording
from .scene import brighten
from .summary import make_summary, make_verdict

__all__ = ["brighten", "make_summary", "make_verdict", "make_widget", "write_recording"]
