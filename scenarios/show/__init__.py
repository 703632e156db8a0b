"""What a scenario, an engine, a bicycle or a file's format holds, as documents and as JSON schemas."""

from .documents import kind_of, make_document
from .schemas import make_schema

__all__ = ["kind_of", "make_document", "make_schema"]
