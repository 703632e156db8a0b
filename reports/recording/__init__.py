"""A run as a recording for the rerun viewer."""

from .notebook import make_widget
from .rerun_file import brighten, write_recording

__all__ = ["brighten", "make_widget", "write_recording"]
