"""What the ground, the bicycle, the curves and the table of a run look like, whatever shows them."""

from .bicycle_shape import Mesh, ball, body_meshes
from .ground import LINE_LIFT, STEEPEST, Ground, disc, ground_of_ride, lifted
from .markdown import escaped, printable
from .palette import Colour, colours
from .plots import (
    CHANGE,
    CONSTRAINTS,
    ENERGY,
    ERROR,
    FORCES,
    LOG_ENERGY,
    PLOTS,
    RADIUS,
    STATES,
    Curve,
    Plot,
    Ride,
    drawable,
    mode_plots,
    nanoseconds,
)
from .summary import COLUMNS, cell, remarks, stability, summary, verdict_line

__all__ = [
    "CHANGE",
    "COLUMNS",
    "CONSTRAINTS",
    "ENERGY",
    "ERROR",
    "FORCES",
    "LINE_LIFT",
    "LOG_ENERGY",
    "PLOTS",
    "RADIUS",
    "STATES",
    "STEEPEST",
    "Colour",
    "Curve",
    "Ground",
    "Mesh",
    "Plot",
    "Ride",
    "ball",
    "body_meshes",
    "cell",
    "colours",
    "disc",
    "drawable",
    "escaped",
    "ground_of_ride",
    "lifted",
    "mode_plots",
    "nanoseconds",
    "printable",
    "remarks",
    "stability",
    "summary",
    "verdict_line",
]
