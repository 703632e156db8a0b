"""The report of a run as one page of HTML that needs nothing else."""

from .document import page

__all__ = ["page"]
