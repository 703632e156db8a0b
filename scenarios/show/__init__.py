"""Documents and JSON schemas of scenarios, engines, the bicycle and file formats."""

from .documents import kind_of, make_document
from .schemas import make_schema

__all__ = ["kind_of", "make_document", "make_schema"]
