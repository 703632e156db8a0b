"""Drawings of the ground, the bicycle, the curves and the table of a run, for pages and recordings alike."""

from .atlas_sides import END_LABELS, describe_end_kinds, list_end_kinds
from .bicycle_shape import Mesh, ball, body_meshes
from .ground import LINE_LIFT, STEEPEST, GroundMesh, ground_disc, lift_points, make_ground
from .markdown import escape_markdown, make_printable
from .numbers import format_numbers
from .palette import Colour, assign_colours
from .plots import (
    CHANGE,
    CONSTRAINTS,
    ENERGY,
    ERROR,
    FORCES,
    LOG_ENERGY,
    NANOSECONDS,
    PLOTS,
    RADIUS,
    SMALLEST_SIZE,
    STATES,
    Plot,
    PlotCurve,
    RideData,
    drawable_values,
    mode_plots,
    to_nanoseconds,
)
from .remarks import group_remarks, make_remarks
from .samples import choose_samples
from .summary import (
    COLUMNS,
    describe_required_friction,
    describe_stability,
    find_unsteadiness,
    format_table,
    format_verdict,
    is_whole_ride,
    rank_engines,
)

__all__ = [
    "CHANGE",
    "COLUMNS",
    "CONSTRAINTS",
    "END_LABELS",
    "ENERGY",
    "ERROR",
    "FORCES",
    "LINE_LIFT",
    "LOG_ENERGY",
    "NANOSECONDS",
    "PLOTS",
    "RADIUS",
    "SMALLEST_SIZE",
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
    "choose_samples",
    "describe_end_kinds",
    "describe_required_friction",
    "describe_stability",
    "drawable_values",
    "escape_markdown",
    "find_unsteadiness",
    "format_numbers",
    "format_table",
    "format_verdict",
    "ground_disc",
    "group_remarks",
    "is_whole_ride",
    "lift_points",
    "list_end_kinds",
    "make_ground",
    "make_printable",
    "make_remarks",
    "mode_plots",
    "rank_engines",
    "to_nanoseconds",
]
