"""A run as it is looked at from Python."""

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
from ..run import find_part
from ..view import RECORDING, open_native
from .table import MetricsTable


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run:
    """The rides of one scenario, measured; `velodrome.run` and `velodrome.load` give it.

    Attributes
    ----------
    name, title : str
        Of the scenario.
    start : Problem
        What every engine was given: bicycle, ground, coordinates and rates at the start, output times.
    growth_rate : float
        Largest real part of the motion's eigenvalues that symmetry does not fix [1/s]; negative where the motion is
        Lyapunov stable.
    family : int or None
        Family of the circular motion that the run starts from; None for an upright start.
    trajectories : dict
        `Trajectory` by the name of an engine, the reference first.
    metrics : MetricsTable
        One row an engine.
    verdicts : tuple of mapping
        On the scenario's criterion, where it has one: ``engine``, ``quantity``, ``value``, ``limit``, ``holds``.
    failures : dict
        Engines that gave no trajectory, with the reason.
    left_out : dict
        Engines that are not made for this problem and were not asked for by name, with the reason.
    folder : Path or None
        The run folder; None where nothing was written.
    complete : bool
        Whether every engine had its turn.
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

        In a notebook where rerun's widget is installed (``pip install 'velodrome[notebook]'``) the widget is returned
        and shown by the notebook. Elsewhere the viewer's window is opened, and the call returns when it is closed.

        Raises
        ------
        ScenarioError
            If there is no recording, or the viewer cannot run here.
        """
        from ...reports.recording import make_widget

        if not self.trajectories:
            raise ScenarioError("the run has no trajectory to show: no engine gave one")
        if self.folder is not None:
            return self._shown(self.folder, make_widget)
        with TemporaryDirectory(prefix="velodrome-") as name:
            self.recorder(Path(name))
            return self._shown(Path(name), make_widget)

    def _shown(self, folder: Path, make_widget: Callable[[Path], Any]) -> Any:
        widget = make_widget(find_part(folder, RECORDING))
        return open_native(folder) if widget is None else widget

    def _notes(self) -> list[str]:
        lines = [f"{name} did not run: {reason}" for name, reason in self.failures.items()]
        lines += [f"{name} left out: {reason}" for name, reason in self.left_out.items()]
        return lines + [format_verdict(verdict) for verdict in self.verdicts]

    def _heading(self) -> str:
        return f"{self.name}: {self.title}, {self.start.times[-1]:g} s"

    def __repr__(self) -> str:
        where = [] if self.folder is None else [f"run folder: {self.folder}"]
        return "\n".join([self._heading(), repr(self.metrics), *self._notes(), *where])

    def _repr_html_(self) -> str:
        notes = "".join(f"<li>{escape(line)}</li>" for line in self._notes())
        where = "" if self.folder is None else f"<p>run folder: <code>{escape(str(self.folder))}</code></p>"
        table = self.metrics.to_html()
        return f"<p><b>{escape(self._heading())}</b></p>{table}{f'<ul>{notes}</ul>' if notes else ''}{where}"
