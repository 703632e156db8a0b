"""The report of a run as one page of HTML that needs nothing else."""

from .document import make_page

__all__ = ["make_page"]
