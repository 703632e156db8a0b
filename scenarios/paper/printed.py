"""The printed figures of the paper and of the papers it is validated against."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any


@cache
def read_printed() -> dict[str, Any]:
    """Read the figures as printed by Xiong et al. (2020) and by the papers it is validated against."""
    return tomllib.loads(Path(__file__).with_name("printed.toml").read_text(encoding="utf-8"))


def known_discrepancies() -> tuple[str, ...]:
    """Return the claims of the paper that are known not to hold, in the ledger's words."""
    return tuple(read_printed()["discrepancies"])
