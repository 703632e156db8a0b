"""The result of a run for use in Python."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ...engines.engine import Problem, Trajectory
from ...reports.drawing import format_verdict
from ..error import ScenarioError
from ..view import find_recording, open_native
from .table import MetricsTable


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run:
    """The trajectories and metrics of one scenario, as returned by `velodrome.run` and `velodrome.load`.

    Attributes
    ----------
    name, title : str
        Name and title of the scenario.
    start : Problem
        The problem that every engine solves: bicycle, ground, coordinates and rates at the start, output times.
    growth_rate : float
        Largest real part of the motion's eigenvalues that symmetry does not fix [1/s]; negative if the motion is
        Lyapunov stable.
    family : int or None
        Family of the circular motion that the run starts from; None for an upright start.
    trajectories : dict
        `Trajectory` by engine, the reference first.
    metrics : MetricsTable
        Metrics, one row per engine.
    verdicts : tuple of mapping
        Verdicts on the scenario's criterion, if it has one: ``engine``, ``quantity``, ``value``, ``limit``, ``holds``.
    failures : dict
        Reasons by engine, for engines that gave no trajectory.
    left_out : dict
        Reasons by engine, for engines that do not support this problem and were not requested by name.
    folder : Path or None
        The run folder; None if nothing was written.
    complete : bool
        Whether every engine has finished or failed.
    """

    name: str
    title: str
    start: Problem
    growth_rate: float
    family: int | None
    trajectories: Mapping[str, Trajectory]
    metrics: MetricsTable
    verdicts: tuple[Mapping[str, Any], ...]
    failures: Mapping[str, str]
    left_out: Mapping[str, str]
    folder: Path | None
    complete: bool
    # Writes the recording into a folder.
    recorder: Callable[[Path], None] = field(repr=False)

    def show(self) -> Any:
        """Show the recording of the rides.

        In a notebook, the method returns rerun's widget if it is installed (``pip install 'velodrome[notebook]'``), and
        the notebook shows it. Otherwise the viewer's window opens, and the call returns when it is closed.

        Raises
        ------
        ScenarioError
            If there is no recording, or the viewer cannot run here.
        """
        from ...reports.recording import make_widget

        if not self.trajectories:
            raise ScenarioError("the run has no trajectory to show: no engine gave one")
        if self.folder is not None:
            return self._open_recording(self.folder, make_widget)
        with TemporaryDirectory(prefix="velodrome-") as name:
            self.recorder(Path(name))
            return self._open_recording(Path(name), make_widget)

    def _open_recording(self, folder: Path, make_widget: Callable[[Path], Any]) -> Any:
        widget = make_widget(find_recording(folder))
        return open_native(folder) if widget is None else widget

    def _list_notes(self) -> list[str]:
        lines = [f"{name} did not run: {reason}" for name, reason in self.failures.items()]
        lines += [f"{name} left out: {reason}" for name, reason in self.left_out.items()]
        return lines + [format_verdict(verdict) for verdict in self.verdicts]

    def _format_heading(self) -> str:
        return f"{self.name}: {self.title}, {self.start.times[-1]:g} s"

    def __repr__(self) -> str:
        where = [] if self.folder is None else [f"run folder: {self.folder}"]
        return "\n".join([self._format_heading(), repr(self.metrics), *self._list_notes(), *where])

    def _repr_html_(self) -> str:
        notes = "".join(f"<li>{escape(line)}</li>" for line in self._list_notes())
        where = "" if self.folder is None else f"<p>run folder: <code>{escape(str(self.folder))}</code></p>"
        table = self.metrics.to_html()
        return f"<p><b>{escape(self._format_heading())}</b></p>{table}{f'<ul>{notes}</ul>' if notes else ''}{where}"
