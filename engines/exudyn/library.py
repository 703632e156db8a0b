"""What releases of Exudyn name differently, or lack: the one place that knows them.

Exudyn 1.10 added total coordinates as an output, `exudyn.config`, and functions that create torsional springs and
rolling discs. 1.13 renamed arguments and settings, and has exceptions of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import signature
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import VObjectConnectorCoordinateVector

_library: Any = exu  # the type stubs are those of one release

# Raised where the Jacobian is singular.
SOLVER_ERROR: type[Exception] = getattr(_library, "SolverError", RuntimeError)
_TOTAL: Any = getattr(exu.OutputVariableType, "CoordinatesTotal", None)
_CURRENT: Any = exu.ConfigurationType.Current


def connect(create: Callable[..., Any], items: Sequence[Any], **arguments: Any) -> Any:
    """Call a function of the system that creates a connector between two items, and return what it returns."""
    name = "itemNumbers" if "itemNumbers" in signature(create).parameters else "bodyNumbers"
    return create(**{name: list(items)}, **arguments)


def write_no_files(settings: exu.SimulationSettings, period: float) -> None:
    """Let a solver write no solution to files, and sample its sensors with a period [s]."""
    own: Any = settings
    if hasattr(own, "solution"):
        own.solution.file.write = False
        own.solution.sensors.writePeriod = period
    else:
        own.solutionSettings.writeSolutionToFile = False
        own.solutionSettings.sensorsWritePeriod = period


def choose_dense_solver(settings: exu.SimulationSettings) -> None:
    """Let Eigen's dense solver solve the linear equations."""
    own: Any = settings
    if hasattr(own, "linearSolver"):
        own.linearSolver.solverType = exu.LinearSolverType.EigenDense
    else:
        own.linearSolverType = exu.LinearSolverType.EigenDense


def hide_connector() -> Any:
    """Return the argument ``visualization`` of a connector of coordinate vectors that is not drawn."""
    # Older releases take this object only, newer ones a dictionary as well.
    appearance: Any = VObjectConnectorCoordinateVector
    if "show" in signature(appearance).parameters:
        return appearance(show=False)
    return {"show": False}


def set_printing(printing: bool) -> bool:
    """Let the engine print messages on the standard output or not; return whether it did before."""
    if hasattr(_library, "config"):
        before = bool(_library.config.printToConsole)
        _library.config.printToConsole = printing
        return before
    _library.SetWriteToConsole(printing)
    return True


def read_total_coordinates(mbs: Any, node: Any, configuration: Any = _CURRENT) -> Any:
    """Return the coordinates of a node, its reference coordinates included: an array (n,), or a number if n is 1."""
    if _TOTAL is not None:
        return mbs.GetNodeOutput(node, _TOTAL, configuration)
    reference = np.array(mbs.GetNode(node)["referenceCoordinates"])
    return reference + mbs.GetNodeOutput(node, exu.OutputVariableType.Coordinates, configuration)
