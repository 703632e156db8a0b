"""The report of a run as a self-contained HTML page."""

from .document import make_page

__all__ = ["make_page"]
