"""The Python interface to runs and circular motions, which `velodrome` exports."""

from .motions import circular, critical, families
from .result import Run
from .run import run
from .stored import load
from .table import MetricsTable

__all__ = ["MetricsTable", "Run", "circular", "critical", "families", "load", "run"]
