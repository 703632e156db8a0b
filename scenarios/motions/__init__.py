"""Circular motions, their families and their atlas as documents and files."""

from .atlas import make_atlas
from .families import critical_document, families_document, write_families

__all__ = ["critical_document", "families_document", "make_atlas", "write_families"]
