"""The rides of a stored run as they are shown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ...engines.engine import Trajectory
from ...reference.bicycle import Bicycle
from ...reference.surface import Surface
from ...reports.measure import cut_at_fall, evaluate_ride
from ..error import ScenarioError
from ..run import read_ride
from ..scenario import show_value


def read_shown_rides(
    folder: Path, manifest: Mapping[str, Any], measured: Mapping[str, Any], bicycle: Bicycle, surface: Surface
) -> dict[str, Trajectory]:
    """Return what follows from the coordinates of a run's rides, by engine, up to their falls.

    Parameters
    ----------
    folder : Path
        A run folder.
    manifest, measured : mapping
        Its documents ``manifest.json`` and ``metrics.json``.
    bicycle : Bicycle
    surface : Surface
    """
    rides = {name: evaluate_ride(read_ride(folder, manifest, measured, name), bicycle, surface) for name in measured}
    return {name: cut_at_fall(ride, bicycle, surface) for name, ride in rides.items()}


@contextmanager
def naming_broken_files(folder: Path, *others: type[Exception]) -> Iterator[None]:
    """Raise a ScenarioError for what files that do not belong together, or have been changed, lead to.

    Parameters
    ----------
    folder : Path
        A run folder.
    *others : type
        Further exceptions to which such files may lead.
    """
    try:
        yield
    except ScenarioError:
        raise
    except (LookupError, TypeError, AttributeError, ArithmeticError, ValueError, *others) as error:
        what = show_value(f"{type(error).__name__}: {error}")
        raise ScenarioError(f"{folder}: not the files of one run: {what}") from error
