"""The conformance test that every engine must pass, with a diagnosis of each failed check."""

from .examine import check_engine, examine_engine
from .report import ConformanceCheck, ConformanceError, ConformanceReport, Outcome

__all__ = ["ConformanceCheck", "ConformanceError", "ConformanceReport", "Outcome", "check_engine", "examine_engine"]
