"""The ledger of Xiong, Wang and Liu (2020): every claim and printed figure, computed and compared with the print."""

from .claims import make_ledger
from .figures.folder import write_paper
from .ledger import DEPENDS, FAILS, REPRODUCED, ROUNDS, TRUNCATED, UNTESTABLE, LedgerLine, ledger_document
from .printed import known_discrepancies
from .table import describe_fault, ledger_summary

__all__ = [
    "DEPENDS",
    "FAILS",
    "REPRODUCED",
    "ROUNDS",
    "TRUNCATED",
    "UNTESTABLE",
    "LedgerLine",
    "describe_fault",
    "known_discrepancies",
    "ledger_document",
    "ledger_summary",
    "make_ledger",
    "write_paper",
]
