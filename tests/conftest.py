import os
import signal
import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

# Kernels compile inside an example on a fresh machine, and a gate must judge the same examples every day.
settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")

# A background job inherits SIGINT ignored, and tests press Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)


# Progress comes by the clock, and tests state what a command writes. The tests of progress allow it.
os.environ["VELODROME_PROGRESS"] = "off"


@pytest.fixture(autouse=True)
def no_open_figures() -> Iterator[None]:
    """Close pyplot's figures, in which the next test would draw."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
