"""Titles, units and meanings of the quantities by which rides are judged, beyond those of ``metrics.json``."""

from __future__ import annotations

from ..measure import QUANTITIES, Quantity

_OWN: dict[str, Quantity] = {
    "run": Quantity("Whether the release rides at all.", ""),
    "short_error": Quantity(
        "Distance of the point D from where the reference has it, at 1 s or, in a shorter ride, at the end.", "m"
    ),
    "state_error": Quantity(
        "Root mean square of the errors of all coordinates and rates, each relative to its size in the motion.", "1"
    ),
    "rms_force_error": Quantity(
        "Root mean square of the errors of the contact forces from 0.2 s on, relative to the largest exact force.", "1"
    ),
    "observed_order": Quantity(
        "Order of convergence that three steps show, without the reference. It counts as moved when it is nearest to "
        "another whole number: the rest is the effect of the next power of the step.",
        "1",
    ),
    "eigenvalue_error": Quantity(
        "Largest error of the eigenvalues of the circle that the engine's own rides show.", "1/s"
    ),
    "growth_rate_error": Quantity("Error of the growth rate among these eigenvalues.", "1/s"),
    "report_mismatch": Quantity(
        "Largest difference between what the engine reports and what follows from its coordinates, relative to its "
        "limit. It is judged by whether it is below 1, whatever it was before.",
        "1",
    ),
}
JUDGED_QUANTITIES: dict[str, Quantity] = QUANTITIES | _OWN


def find_quantity(name: str) -> Quantity:
    """Return what a quantity is; one that is not known here has no unit and no meaning."""
    return JUDGED_QUANTITIES.get(name, Quantity("", ""))


def format_title(name: str) -> str:
    """Return the name of a quantity for a reader."""
    return name.replace("_", " ")
