"""One examination that every engine passes: what it must keep to, and a diagnosis of what it does not."""

from .examine import check_engine, examine_engine
from .report import ConformanceCheck, ConformanceError, ConformanceReport, Outcome

__all__ = ["ConformanceCheck", "ConformanceError", "ConformanceReport", "Outcome", "check_engine", "examine_engine"]
