"""Published numbers, one file a source."""

import json
from pathlib import Path
from typing import Any


def published(name: str) -> dict[str, Any]:
    """Read a source's numbers by its file's stem."""
    return json.loads((Path(__file__).parent / f"{name}.json").read_text(encoding="utf-8"))


def rounds_to(value: float, printed: str) -> bool:
    """Whether a value rounds to a printed decimal: within half a unit of its last digit."""
    digits = len(printed.partition(".")[2])
    return abs(value - float(printed)) <= 0.5 * 10**-digits * (1 + 1e-12)
