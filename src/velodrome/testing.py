"""The conformance test for engines, with a diagnosis of each failed check.

Use in a test of the engine's package::

    from velodrome.testing import check_engine

    def test_the_engine_conforms() -> None:
        check_engine("own")  # or the engine object; an AssertionError lists the failed checks

Use in a script that prints every check::

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
