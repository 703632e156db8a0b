"""The commands of `velodrome`. Each command imports its libraries when it runs, which keeps the others fast."""

from .basin import basin_command
from .bicycle import bicycle_command
from .check import check_command
from .float32 import float32_command
from .history import history_command
from .league import league_command
from .motions import atlas_command, bifurcations_command, circular_command, critical_command, families_command
from .run import list_command, run_command
from .show import show_command
from .stored import diff_command, view_command
from .studies import paper_command, precision_command
from .supervision import run_supervised
from .sweep import sweep_command
from .version import print_versions
from .warm_up import warm_up_command

__all__ = [
    "atlas_command",
    "basin_command",
    "bicycle_command",
    "bifurcations_command",
    "check_command",
    "circular_command",
    "critical_command",
    "diff_command",
    "families_command",
    "float32_command",
    "history_command",
    "league_command",
    "list_command",
    "paper_command",
    "precision_command",
    "print_versions",
    "run_command",
    "run_supervised",
    "show_command",
    "sweep_command",
    "view_command",
    "warm_up_command",
]
