"""The engine keeps to what Velodrome asks of every engine; run with pytest where the package is installed."""

from __future__ import annotations

from velodrome.testing import check_engine


def test_the_engine_conforms() -> None:
    """Fail with a diagnosis of all that the engine does not keep to."""
    check_engine("symbrim")
