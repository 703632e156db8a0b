"""The ride of a run in space, as its recording shows it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import velodrome
from velodrome.reference.bicycle import BODIES
from velodrome.reference.surface import unit_normals
from velodrome.reports.drawing import STEEPEST, assign_colours, body_meshes, ground_disc, lift_points
from velodrome.reports.figures import new_figure, use_style
from velodrome.scenarios.paper.figures.picture import Picture, View

_GROUND, _GRID, _EDGE = np.array([0.90, 0.925, 0.945]), np.array([0.68, 0.73, 0.77]), np.array([0.45, 0.50, 0.55])
_ELEVATION, _AZIMUTH = np.radians(42.0), np.radians(-60.0)
_DARKER = 0.75  # the engines' colours are made for a dark ground
_PIXELS = 1500
_TRAIL = 2.6  # one turn or so [s]


def draw_scene(run: velodrome.Run, engines: Sequence[str], time: float) -> Figure:
    """Draw the bicycles of some engines at one time, with the recent paths of their rear contacts.

    Parameters
    ----------
    run : velodrome.Run
    engines : sequence of str
        Later ones are drawn over earlier ones.
    time : float
        [s]; of an engine that ended before, its last sample.
    """
    bicycle, surface = run.start.bicycle, run.start.surface
    rides = {name: run.trajectories[name].until(time) for name in engines}
    contacts = {name: _rear_contact(ride) for name, ride in rides.items()}
    radius = max(float(np.hypot(*points[:, :2].T).max()) for points in contacts.values()) + 0.6
    rim = float(lift_points(surface, np.array([radius]), np.zeros(1))[0, 2])
    # A bicycle at the far side reaches above the bowl.
    centre = np.array([0.0, 0.0, rim + 0.2])
    view = View(_AZIMUTH, _ELEVATION, centre, 2.04 * radius, 2.04 * radius * float(np.sin(_ELEVATION)) + 0.4)
    picture = Picture(view, _PIXELS)
    _draw_ground(picture, view, surface, radius)
    colours = {name: _DARKER * np.array(colour) / 255 for name, colour in assign_colours(run.trajectories).items()}
    colours["reference"] = np.array([0.35, 0.35, 0.35])
    for name, ride in rides.items():
        recent = contacts[name][ride.time > ride.time[-1] - _TRAIL]
        track = lift_points(surface, recent[:, 0], recent[:, 1], 0.01)
        picture.line(track, 3.0, colours[name])
        _draw_bicycle(picture, bicycle, ride, colours[name])
    with use_style():
        figure = new_figure(7.2 * view.height / view.width + 0.35)
        axes = figure.subplots()
        axes.imshow(picture.pixels(), interpolation="antialiased")
        axes.set_axis_off()
        handles = [Line2D([], [], color=tuple(colours[name]), lw=3, label=name) for name in engines]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(engines))
    return figure


def _rear_contact(ride: velodrome.Trajectory) -> np.ndarray:
    point = ride.contact_point
    return ride.q[:, :3] if point is None else point[:, 0]


def _draw_ground(picture: Picture, view: View, surface: velodrome.Surface, radius: float) -> None:
    around = np.linspace(0, 2 * np.pi, 361)
    ring = radius * np.column_stack([np.cos(around), np.sin(around)])
    ground = ground_disc(surface, ring, radius, STEEPEST)
    shade = np.tile(_GROUND, (len(ground.vertices), 1)) * (0.94 + 0.12 * ground.brightness[:, None])
    picture.body(ground.vertices, ground.normals, ground.triangles, shade, cull=True)
    for line in ground.lines:
        if np.all(unit_normals(surface, line[:, 0], line[:, 1]) @ view.axes[2] > 0.05):
            picture.line(line, 1.2, _GRID, lift=0.004)
    picture.line(ground.edge, 2.4, _EDGE)


def _draw_bicycle(picture: Picture, bicycle: velodrome.Bicycle, ride: velodrome.Trajectory, colour: np.ndarray) -> None:
    from velodrome.engines.coordinates import rotation_matrices

    turned, placed = rotation_matrices(ride.body_quaternion[-1:])[0], ride.body_position[-1]
    meshes = body_meshes(bicycle)
    red, green, blue = (round(255 * float(part)) for part in colour)
    for k, body in enumerate(BODIES):
        mesh = meshes[body]
        tint = mesh.coloured((red, green, blue)) / 255
        picture.body(mesh.vertices @ turned[k].T + placed[k], mesh.normals @ turned[k].T, mesh.triangles, tint)
