"""The examples in the docstrings of the public face are run."""

from __future__ import annotations

import doctest
from importlib import import_module

import pytest

MODULES = [
    "velodrome",
    "velodrome.scenarios.session.motions",
    "velodrome.scenarios.session.run",
    "velodrome.scenarios.session.stored",
    "velodrome.scenarios.session.table",
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_give_what_they_say(name: str) -> None:
    failed, tried = doctest.testmod(import_module(name))
    assert tried > 0
    assert failed == 0
