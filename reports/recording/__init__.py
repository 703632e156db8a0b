"""A run as a recording for the rerun viewer."""

from .rerun_file import bright, write_recording

__all__ = ["bright", "write_recording"]
