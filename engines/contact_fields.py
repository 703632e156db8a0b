"""The fields of a trajectory that follow from its coordinates and the ground alone."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from ..reference.contact import observe
from .engine import Problem


class ContactFields(TypedDict):
    """Contact points, gaps and slip of `velodrome.engines.engine.Trajectory`; all None where a contact is missing."""

    contact_point: np.ndarray | None
    gap: np.ndarray | None
    slip: np.ndarray | None


def observe_contact_fields(problem: Problem, q: np.ndarray, qd: np.ndarray) -> ContactFields:
    """Compute the contacts of the wheels' knife edges with the true ground, of coordinates and rates (n, 9)."""
    found = observe(problem.bicycle, problem.surface, q, qd)
    if not found.found:
        return ContactFields(contact_point=None, gap=None, slip=None)
    return ContactFields(contact_point=found.point, gap=found.gap, slip=found.slip)
