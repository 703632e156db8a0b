"""Drawings of the ground, the bicycle, the curves and the table of a run, for pages and recordings alike."""

from .bicycle_shape import Mesh, ball, body_meshes
from .ground import LINE_LIFT, STEEPEST, GroundMesh, ground_disc, lift_points, make_ground
from .markdown import escape_markdown, make_printable
from .palette import Colour, assign_colours
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
    Plot,
    PlotCurve,
    RideData,
    drawable_values,
    mode_plots,
    to_nanoseconds,
)
from .summary import COLUMNS, describe_stability, format_cell, format_verdict, make_remarks, make_summary

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
    "GroundMesh",
    "Mesh",
    "Plot",
    "PlotCurve",
    "RideData",
    "assign_colours",
    "ball",
    "body_meshes",
    "describe_stability",
    "drawable_values",
    "escape_markdown",
    "format_cell",
    "format_verdict",
    "ground_disc",
    "lift_points",
    "make_ground",
    "make_printable",
    "make_remarks",
    "make_summary",
    "mode_plots",
    "to_nanoseconds",
]
