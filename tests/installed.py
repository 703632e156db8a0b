"""The installed engines as parameters of tests."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import pytest

from velodrome.engines.registry import default_engines, engine_names


def parametrise_engines(without: Collection[str] = ()) -> list[Any]:
    """Return the installed engines as parameters, with the marker ``engines`` on those that are no default.

    Parameters
    ----------
    without : collection of str
        Engines to leave out.
    """
    own = default_engines()
    names = [name for name in engine_names() if name not in without]
    return [pytest.param(name, marks=() if name in own else pytest.mark.engines) for name in names]
