"""The initial layout of a recording: its views and their cameras."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ...reference.bicycle import BODIES
from ..drawing import CHANGE, CONSTRAINTS, ENERGY, ERROR, FORCES, LOG_ENERGY, RADIUS, STATES, Plot
from .camera import VIEW, Camera
from .curves import Curves, find_range
from .overview import Overview

BACKGROUND = (17, 19, 24)
NEWTONS_PER_METRE = 500.0
_GHOST = (255, 255, 255, 60)  # a ghost's colours are multiplied by this: it is nearly transparent
_CHASE = Camera(np.array([-2.1, -1.6, 1.0]), np.array([-0.2, 0.0, 0.15]))
_VERDICT_HEIGHT = 84.0  # three lines of text in the smallest view [points]


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordingLayout:
    """What the views of a recording show.

    Attributes
    ----------
    engines : sequence of str
        Names in the order of display.
    ghosts : mapping of str to str
        The bicycle that is beside an engine's own in the engine's views, transparent.
    chase : mapping of str to Camera
        Camera of the views of one engine, in its chase frame.
    overview : Overview
    around_axis : bool
        Whether the ride goes around the z axis.
    staying : collection of str
        Engines that ride to the end.
    texts : mapping of str to str
        Names of the views of one engine.
    legend : tuple of float
        Width and height of the legend [points].
    curves : mapping
        By plot key and engine; a plot without curves gets no view.
    modes : sequence of Plot
        Plots of the modes' amplitudes.
    """

    engines: Sequence[str]
    ghosts: Mapping[str, str]
    chase: Mapping[str, Camera]
    overview: Overview
    around_axis: bool
    staying: Collection[str]
    texts: Mapping[str, str]
    legend: tuple[float, float]
    curves: Curves
    modes: Sequence[Plot] = ()


def world(engine: str) -> str:
    """Return the path of the entity that contains everything of an engine in space."""
    return rr.new_entity_path(["world", engine])


def chase_camera() -> Camera:
    """Return the camera of the views of one engine, for a bicycle that turns to the right."""
    return _CHASE


def _show_trails(engines: Sequence[str], seconds: float | None) -> dict[Any, rrb.VisibleTimeRanges]:
    """Show the trails up to the cursor, either whole or only the last seconds."""
    start = (
        rrb.TimeRangeBoundary.infinite() if seconds is None else rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds)
    )
    visible = rrb.VisibleTimeRanges(timeline="time", start=start, end=rrb.TimeRangeBoundary.cursor_relative())
    return {f"{world(engine)}/trail/{part}": visible for engine in engines for part in ("rear", "front", "D")}


def _place_eye(camera: Camera) -> rrb.EyeControls3D:
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=camera.position, look_target=camera.target, eye_up=(0, 0, 1)
    )


def _show_ride(layout: RecordingLayout) -> rrb.Spatial3DView:
    """Make the view of all engines."""
    followed = layout.overview.followed
    return rrb.Spatial3DView(
        name=f"Ride (arrows: contact forces, {NEWTONS_PER_METRE:.0f} N a metre)",
        origin="/world" if followed is None else f"{world(followed)}/chase",
        contents=["+ /world/**"],
        overrides=_show_trails(layout.engines, None if followed is None else 10.0),
        background=BACKGROUND,
        line_grid=False,
        eye_controls=_place_eye(layout.overview.camera),
    )


def _show_engine(layout: RecordingLayout, engine: str) -> rrb.Spatial3DView:
    """Make the view of one engine from behind, which turns with its yaw only, with a ghost of another one."""
    ghost = layout.ghosts.get(engine)
    visible = [engine] if ghost is None else [engine, ghost]
    hidden = rrb.EntityBehavior(visible=False)
    overrides: dict[Any, Any] = {**_show_trails(visible, 2.0), f"{world(engine)}/here": hidden}
    if ghost is not None:
        pale = rr.Mesh3D.from_fields(albedo_factor=_GHOST)
        overrides |= {f"{world(ghost)}/{body}/shape": pale for body in BODIES}
        overrides |= {f"{world(ghost)}/{part}": hidden for part in ("here", "force", "contact")}
    return rrb.Spatial3DView(
        name=layout.texts[engine],
        origin=f"{world(engine)}/chase",
        contents=["+ /world/ground/**", *(f"+ {world(name)}/**" for name in visible)],
        overrides=overrides,
        background=BACKGROUND,
        line_grid=False,
        eye_controls=_place_eye(layout.chase[engine]),
    )


def _show_legend(layout: RecordingLayout) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        name="Engines",
        origin="/legend",
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, layout.legend[0]), y_range=(0.0, layout.legend[1])),
        titlebar=False,
    )


def _show_plot(layout: RecordingLayout, plot: Plot) -> rrb.TimeSeriesView:
    """Make the view of a plot. It has no legend, which would cover curves: all views share the one below the ride."""
    axis, beyond = find_range(plot, layout.curves[plot.key], layout.staying)
    said = f"; {', '.join(beyond)} beyond" if beyond else ""
    return rrb.TimeSeriesView(
        name=f"{plot.title}{said}",
        origin=f"/plots/{plot.key}",
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        axis_y=None if axis is None else rrb.ScalarAxis(range=axis),
        plot_legend=rrb.PlotLegend(visible=False),
        interaction=rrb.PlotInteraction(tooltip_mode="All"),
        background=rrb.archetypes.PlotBackground(color=BACKGROUND, show_grid=True),
    )


def _show_plots(layout: RecordingLayout, name: str, plots: Sequence[Plot], columns: int) -> rrb.Container | None:
    """Make a tab of the plots that have a curve; None if there is none."""
    views = [_show_plot(layout, plot) for plot in plots if layout.curves.get(plot.key)]
    if not views:
        return None
    return rrb.Vertical(*views, name=name) if columns == 1 else rrb.Grid(*views, grid_columns=columns, name=name)


def make_blueprint(layout: RecordingLayout) -> rrb.Blueprint:
    """Make the layout of a recording, paused at the start.

    On the left the ride, side by side and one at a time, above the legend; on the right the verdict above curves and
    summary.
    """
    where = RADIUS if layout.around_axis else STATES[1]
    tabs = (
        _show_plots(layout, "Comparison", (CHANGE, ERROR, LOG_ENERGY, STATES[0], where), 1),
        _show_plots(layout, "States", STATES, 2),
        _show_plots(layout, "Forces", FORCES, 2),
        _show_plots(layout, "Modes", layout.modes, 1),
        _show_plots(layout, "Constraints & energy", (*CONSTRAINTS, LOG_ENERGY, ENERGY), 2),
        rrb.TextDocumentView(name="Summary", origin="/summary"),
    )
    ride: list[rrb.Container | rrb.View] = [_show_ride(layout)]
    if len(layout.engines) > 1:
        spread = [_show_engine(layout, engine) for engine in layout.engines]
        ride.append(rrb.Grid(*spread, grid_columns=math.ceil(math.sqrt(len(spread))), name="Side by side"))
    ride.append(rrb.Tabs(*(_show_engine(layout, engine) for engine in layout.engines), name="One at a time"))
    verdict = rrb.TextDocumentView(name="Verdict", origin="/verdict", titlebar=False)
    total = VIEW[1] + layout.legend[1]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(rrb.Tabs(*ride, active_tab=0), _show_legend(layout), row_shares=[VIEW[1], layout.legend[1]]),
            rrb.Vertical(
                verdict,
                rrb.Tabs(*(tab for tab in tabs if tab is not None), active_tab=0),
                row_shares=[_VERDICT_HEIGHT, total - _VERDICT_HEIGHT],
            ),
            column_shares=[3, 2],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="paused", loop_mode="all", playback_speed=1.0),
        auto_layout=False,
        auto_views=False,
    )
