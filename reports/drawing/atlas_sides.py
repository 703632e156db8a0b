"""What ends the stable sections of an atlas, over the shape of the bowl."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby
from typing import Any

END_LABELS = {
    "supercritical": "supercritical Hopf point",
    "subcritical": "subcritical Hopf point",
    "hopf": "Hopf point, criticality undefined",
    "energy": "the energy is extreme",
    "end": "the family ends",
}


def list_end_kinds(side: Mapping[str, Any]) -> list[str]:
    """Return what ends the sections of one side of a stable region: the criticality of a Hopf point, or the cause.

    ``hopf`` is a Hopf point whose criticality is not defined.
    """
    return [kind or cause for kind, cause in zip(side["criticality"], side["cause"], strict=True)]


def describe_end_kinds(side: Mapping[str, Any]) -> str:
    """Return what ends the sections of one side as alpha grows, in a few words."""
    return "; then ".join(END_LABELS.get(kind, kind) for kind, _ in groupby(list_end_kinds(side)))
