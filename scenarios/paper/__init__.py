"""Every claim and printed figure of Xiong, Wang and Liu (2020), computed and held against the print."""

from .claims import make_ledger
from .figures.folder import write_paper
from .ledger import ledger_document
from .table import show_ledger

__all__ = ["ledger_document", "make_ledger", "show_ledger", "write_paper"]
