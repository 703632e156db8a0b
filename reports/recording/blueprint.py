"""The initial layout of a recording: its views and their cameras."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ...engines.engine import REFERENCE
from ..drawing import CHANGE, CONSTRAINTS, ENERGY, ERROR, FORCES, LOG_ENERGY, RADIUS, STATES, GroundMesh, Plot

BACKGROUND = (17, 19, 24)
NEWTONS_PER_METRE = 500.0
_LEGEND_SHARE = 1.8  # height relative to another view, so that a legend of ten engines fits

# Samples of each plot by its key, then by engine.
Curves = Mapping[str, Mapping[str, np.ndarray]]


def world(engine: str) -> str:
    """Return the path of the entity that contains everything of an engine in space."""
    return rr.new_entity_path(["world", engine])


def _show_trails(engines: Sequence[str], seconds: float | None) -> dict[Any, rrb.VisibleTimeRanges]:
    """Show the trails up to the cursor, either whole or only the last seconds."""
    start = (
        rrb.TimeRangeBoundary.infinite() if seconds is None else rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds)
    )
    visible = rrb.VisibleTimeRanges(timeline="time", start=start, end=rrb.TimeRangeBoundary.cursor_relative())
    return {f"{world(engine)}/trail/{part}": visible for engine in engines for part in ("rear", "front", "D")}


def overview(engines: Sequence[str], ground: GroundMesh) -> rrb.Spatial3DView:
    """Make the view of all engines on the whole ground; on a long strip the camera follows the first engine."""
    if ground.disc:
        # A camera higher than the near rim by twice the depth sees the bottom.
        bottom, rim = ground.vertices[:, 2].min(), ground.edge[:, 2].max()
        depth, size, origin = rim - bottom, ground.radius, "/world"
        target = np.array([-0.05 * size, -0.20 * size, bottom + 0.3 * depth])
        position = np.array([-0.45 * size, -1.62 * size, bottom + 0.90 * size + 2 * depth])
    else:
        origin, target = f"{world(engines[0])}/chase", np.array([0.4, 0.0, 0.2])
        position = np.array([-2.4, -4.0, 2.2])
    eye = rrb.EyeControls3D(kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=(0, 0, 1))
    return rrb.Spatial3DView(
        name=f"Overview (arrows: contact force, 1 m = {NEWTONS_PER_METRE:.0f} N)",
        origin=origin,
        contents=["+ /world/**"],
        overrides=_show_trails(engines, None),
        background=BACKGROUND,
        line_grid=False,
        eye_controls=eye,
    )


def chase(engine: str, engines: Sequence[str]) -> rrb.Spatial3DView:
    """Make the view of one engine from behind, which turns with its yaw only, and of the reference beside it."""
    visible = [name for name in engines if name in (engine, REFERENCE)]
    hidden = rrb.EntityBehavior(visible=False)  # the tab has the name
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=(-2.1, -1.6, 1.0), look_target=(-0.2, 0.0, 0.15), eye_up=(0, 0, 1)
    )
    return rrb.Spatial3DView(
        name=f"Chase {engine}",
        origin=f"{world(engine)}/chase",
        contents=["+ /world/ground/**", *(f"+ {world(name)}/**" for name in visible)],
        overrides={**_show_trails(visible, 2.0), **{f"{world(name)}/chase/name": hidden for name in visible}},
        background=BACKGROUND,
        line_grid=False,
        eye_controls=eye,
    )


def _fix_axis(plot: Plot, curves: Mapping[str, np.ndarray]) -> rrb.ScalarAxis | None:
    """Return a fixed range where the viewer's own range would magnify round-off to the full height."""
    low = min(float(values.min()) for values in curves.values())
    high = max(float(values.max()) for values in curves.values())
    if high - low >= plot.span:
        return None
    middle = 0.5 * (low + high)
    return rrb.ScalarAxis(range=(middle - plot.span / 2, middle + plot.span / 2))


def _plot_view(plot: Plot, curves: Mapping[str, np.ndarray], legend: bool) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        name=plot.title,
        origin=f"/plots/{plot.key}",
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        axis_y=_fix_axis(plot, curves),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftBottom, visible=legend),
        background=rrb.archetypes.PlotBackground(color=BACKGROUND, show_grid=True),
    )


def _plot_tab(name: str, plots: Sequence[Plot], curves: Curves, columns: int) -> rrb.Container | None:
    """Make a tab of the plots that have a curve; None if there is none.

    Each tab has one legend, in the first view with the most curves, since it covers a part of them; in a column of
    views this view is the highest.
    """
    drawn = [plot for plot in plots if curves.get(plot.key)]
    if not drawn:
        return None
    keyed = max(drawn, key=lambda plot: len(curves[plot.key]))
    views = [_plot_view(plot, curves[plot.key], plot is keyed) for plot in drawn]
    if columns == 1:
        return rrb.Vertical(*views, row_shares=[_LEGEND_SHARE if plot is keyed else 1 for plot in drawn], name=name)
    return rrb.Grid(*views, grid_columns=columns, name=name)


def blueprint(engines: Sequence[str], ground: GroundMesh, curves: Curves, modes: Sequence[Plot] = ()) -> rrb.Blueprint:
    """Make the layout of a recording: the ride left, curves and summary right, paused at the start.

    Parameters
    ----------
    engines : sequence of str
        Names in the order of display.
    ground : GroundMesh
        Drawn part of the surface.
    curves : mapping
        Samples by plot key and engine; a plot without samples gets no view.
    modes : sequence of Plot
        Plots of the modes' amplitudes.
    """
    where = RADIUS if ground.disc else STATES[1]
    tabs = (
        _plot_tab("Comparison", (CHANGE, ERROR, LOG_ENERGY, STATES[0], where), curves, 1),
        _plot_tab("States", STATES, curves, 2),
        _plot_tab("Forces", FORCES, curves, 2),
        _plot_tab("Modes", modes, curves, 1),
        _plot_tab("Constraints & energy", (*CONSTRAINTS, LOG_ENERGY, ENERGY), curves, 2),
        rrb.TextDocumentView(name="Summary", origin="/summary"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Tabs(overview(engines, ground), *(chase(engine, engines) for engine in engines), active_tab=0),
            rrb.Tabs(*(tab for tab in tabs if tab is not None), active_tab=0),
            column_shares=[3, 2],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="paused", loop_mode="all", playback_speed=1.0),
        auto_layout=False,
        auto_views=False,
    )
