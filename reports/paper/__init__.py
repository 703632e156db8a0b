"""The paper's printed figures and the ledger that holds them against what is measured."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def printed() -> dict[str, Any]:
    """Figures as printed by Xiong et al. (2020) and by the papers it is validated against."""
    return tomllib.loads(files(__name__).joinpath("printed.toml").read_text(encoding="utf-8"))
