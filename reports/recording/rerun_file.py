"""Recording of a run for the rerun viewer: the ride in space, the curves, the summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import rerun as rr

from ...engines.engine import REFERENCE, SHAPES, Trajectory
from ...engines.files import write_whole
from ...reference.bicycle import Bicycle
from ...reference.inputs import NO_INPUTS, Inputs
from ...reference.surface import Surface
from ..drawing import NANOSECONDS, PLOTS, Colour, RideData, assign_colours, body_meshes, make_ground, mode_plots
from ..measure import find_modes
from .blueprint import RecordingLayout, chase_camera, make_blueprint
from .clock import Clock
from .curves import find_curves, send_curve
from .legend import place_legend
from .overview import choose_overview, describe_end, find_staying, mirror_camera, name_bicycles
from .scene import log_ground, log_legend, send_bicycle, send_names
from .thinning import choose_stride, describe_thinning, thin_samples

APPLICATION = "velodrome"


@contextmanager
def _strict_mode() -> Iterator[None]:
    """Make wrong calls of the recorder raise errors, and restore the process's setting."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def write_recording(
    path: Path,
    title: str,
    bicycle: Bicycle,
    surface: Surface,
    trajectories: Mapping[str, Trajectory],
    verdict: str,
    summary: str,
    *,
    undisturbed: tuple[np.ndarray, np.ndarray] | None = None,
    before: Mapping[str, str] | None = None,
    paint: Mapping[str, Colour] | None = None,
    inputs: Inputs = NO_INPUTS,
    rate: float | None = None,
) -> str | None:
    """Write a recording with its layout, completely or not at all.

    Parameters
    ----------
    path : Path
        File to write, ``.rrd``.
    title : str
        Name of the scenario.
    bicycle : Bicycle
    surface : Surface
    trajectories : mapping of str to Trajectory
        By engine name, in the order of display. Some may have ended early; optional fields that are
        None are omitted from the recording.
    verdict : str
        Markdown of a few lines, which is always in sight.
    summary : str
        Markdown for the summary tab.
    undisturbed : tuple of ndarray, shapes (9,), optional
        Coordinates and rates of the steady motion that the rides started from, on a surface of revolution or a
        plane; its modes get a tab.
    before : mapping of str to str, optional
        For two runs shown together: the name of the earlier trajectory that each trajectory is compared with.
    paint : mapping, optional
        Colours by name; those of `velodrome.reports.drawing.assign_colours` if not given.
    inputs : Inputs
        Inputs of all rides.
    rate : float, optional
        Largest number of samples a second [Hz]. By default long rides are thinned, see
        `velodrome.reports.recording.thinning.MOST_SAMPLES`.

    Returns
    -------
    str or None
        What the recording leaves out, one sentence that its summary has as well; None if it holds every sample.

    Raises
    ------
    ValueError
        If there is no trajectory, one has no sample, or the motion cannot be linearised.
    """
    if not trajectories or any(len(run.time) == 0 for run in trajectories.values()):
        raise ValueError("a recording needs at least one trajectory, and each at least one sample")
    modes = None if undisturbed is None else find_modes(bicycle, surface, *undisturbed, inputs)
    ride = RideData(surface, trajectories, before or {}, modes, inputs)
    stride = choose_stride(trajectories.values(), rate)
    thinned = describe_thinning(trajectories.values(), stride)
    texts = (verdict, summary if thinned is None else f"{summary.rstrip()}\n\n{thinned}\n")
    with write_whole(path) as partial, _strict_mode():
        _write_stream(partial, title, bicycle, ride, texts, paint or assign_colours(trajectories), stride)
    return thinned


def _write_stream(
    path: Path,
    title: str,
    bicycle: Bicycle,
    ride: RideData,
    texts: tuple[str, str],
    paint: Mapping[str, Colour],
    stride: int,
) -> None:
    """Write the whole recording to a path."""
    own = mode_plots(ride.modes)
    curves = find_curves(ride, (*PLOTS, *own), stride)
    staying = find_staying(ride.trajectories)
    places = np.concatenate([ride.trajectories[name].q[:, :2] for name in staying])
    ground = make_ground(ride.surface, places[np.isfinite(places).all(axis=1)])
    overview = choose_overview(ride.trajectories, bicycle, ground)
    clock, meshes = Clock(ride.trajectories.values()), body_meshes(bicycle)
    shown = {name: _thin_ride(run, clock, stride) for name, run in ride.trajectories.items()}
    names = name_bicycles(shown, overview, Clock(shown.values()).times / NANOSECONDS)
    legend = {name: describe_end(name, run) for name, run in ride.trajectories.items()}
    middles, size = place_legend(tuple(legend.values()))
    layout = RecordingLayout(
        engines=tuple(ride.trajectories),
        ghosts=_choose_ghosts(ride),
        chase={name: mirror_camera(chase_camera(), run) for name, run in ride.trajectories.items()},
        overview=overview,
        around_axis=ground.disc,
        staying=staying,
        texts=legend,
        legend=size,
        curves=curves,
        modes=own,
    )
    stream = rr.RecordingStream(APPLICATION)
    try:
        stream.save(path, default_blueprint=make_blueprint(layout))
        stream.send_recording_name(title)
        stream.log("/world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for entity, text in zip(("/verdict", "/summary"), texts, strict=True):
            stream.log(entity, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
        log_ground(stream, ground)
        log_legend(stream, legend, middles, paint)
        for place, (name, run) in enumerate(shown.items()):
            send_bicycle(stream, name, run, meshes, ride.surface, paint[name], place, clock)
        send_names(stream, names, shown, paint, clock)
        for key, by_engine in curves.items():
            for name, curve in by_engine.items():
                send_curve(stream, key, name, curve, paint, clock)
    finally:
        stream.disconnect()


def _thin_ride(run: Trajectory, clock: Clock, stride: int) -> Trajectory:
    """Return the samples of a ride that the recording shows in space."""
    if stride == 1:
        return run
    kept = thin_samples(run, clock.times, stride)
    return replace(run, **{name: value[kept] for name in SHAPES if (value := getattr(run, name)) is not None})


def _choose_ghosts(ride: RideData) -> dict[str, str]:
    """Choose the ghost beside each engine: the earlier run's ride if there is one, otherwise the reference."""
    reference = {name: REFERENCE for name in ride.trajectories if name != REFERENCE and ride.reference is not None}
    return {**reference, **ride.before}
