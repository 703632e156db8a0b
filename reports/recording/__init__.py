"""A run as a recording for the rerun viewer."""

from .rerun_file import brighten, write_recording

__all__ = ["brighten", "write_recording"]
