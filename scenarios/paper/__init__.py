"""The ledger of Xiong, Wang and Liu (2020): every claim and printed figure, computed and compared with the print."""

from .claims import make_ledger
from .figures.folder import write_paper
from .ledger import ledger_document
from .printed import known_discrepancies
from .table import show_ledger

__all__ = ["known_discrepancies", "ledger_document", "make_ledger", "show_ledger", "write_paper"]
