"""Changes of an engine's metrics from one run to the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class MetricChange:
    """A metric in both runs.

    Attributes
    ----------
    before, after : object
        Its values; None where a run has none.
    change : float or None
        Difference of the values; None unless both are numbers.
    limit : float or None
        Largest change that round-off allows; None where no limit can be derived.
    holds : bool or None
        Whether the metric is within the limit; None where it is not judged.
    """

    before: Any
    after: Any
    change: float | None
    limit: float | None
    holds: bool | None

    def as_json(self) -> dict[str, Any]:
        """Return the change as a JSON object."""
        return asdict(self)


def compare_metrics(
    before: Mapping[str, Any], after: Mapping[str, Any], limits: Mapping[str, float]
) -> dict[str, MetricChange]:
    """Compare the metrics of two runs.

    Parameters
    ----------
    before, after : mapping
        Metrics of an engine, as in ``metrics.json``.
    limits : mapping
        Largest allowed changes, by metric. Only metrics with a limit that both runs have are judged.

    Returns
    -------
    dict
        Changes by metric; parts of a metric have names of their own, such as ``position_error.max``.
    """
    old, new = _name_parts(before), _name_parts(after)
    found = {}
    for name in dict.fromkeys([*new, *old]):
        a, b, limit = old.get(name), new.get(name), limits.get(name)
        change = b - a if isinstance(a, float | int) and isinstance(b, float | int) else None
        if limit is None or name not in old or name not in new:
            holds = None
        else:
            holds = a == b if change is None else abs(change) <= limit
        found[name] = MetricChange(before=a, after=b, change=change, limit=limit, holds=holds)
    return found


def _name_parts(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """Give parts of metrics names of their own, and replace inconsistent reports by the names of their quantities."""
    found: dict[str, Any] = {}
    for name, value in metrics.items():
        if isinstance(value, Mapping):
            found |= {f"{name}.{part}": number for part, number in value.items()}
        elif name == "inconsistent_reports":
            found[name] = ", ".join(report["quantity"] for report in value) or None
        else:
            found[name] = value
    return found
