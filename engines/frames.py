"""Trajectories as pandas data frames, with the columns of the stored files."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .storage import trajectory_table

if TYPE_CHECKING:
    import pandas as pd

    from .engine import Trajectory


def import_pandas() -> Any:
    """Return the module pandas, which is an optional dependency.

    Raises
    ------
    ImportError
        If pandas is not installed. The message says how to install it.
    """
    try:
        return import_module("pandas")
    except ModuleNotFoundError as error:
        if error.name != "pandas":
            raise
        raise ImportError("to_pandas needs pandas, which is not installed: pip install pandas") from None


def trajectory_frame(trajectory: Trajectory) -> pd.DataFrame:
    """Return a trajectory as a data frame with the times as index; see `Trajectory.to_pandas`."""
    pandas = import_pandas()
    table = trajectory_table(trajectory)
    index = pandas.Index(table.column("time").to_numpy(), name="time")
    columns = {name: table.column(name).to_numpy() for name in table.column_names if name != "time"}
    return pandas.DataFrame(columns, index=index)
