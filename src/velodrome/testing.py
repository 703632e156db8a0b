"""Tests for engines: whether one keeps to what the suite asks of it, and a diagnosis where it does not.

In a test of the engine's package::

    from velodrome.testing import check_engine

    def test_the_engine_conforms() -> None:
        check_engine("own")  # or the engine itself; an AssertionError lists what fails

Or by hand, which prints every check::

    from velodrome.testing import examine_engine

    print(examine_engine("own"))
"""

from .reports.conformance import (
    ConformanceCheck,
    ConformanceError,
    ConformanceReport,
    Outcome,
    check_engine,
    examine_engine,
)

__all__ = ["ConformanceCheck", "ConformanceError", "ConformanceReport", "Outcome", "check_engine", "examine_engine"]
