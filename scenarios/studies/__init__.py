"""Studies of a bicycle and of the precision of engines."""

from .bicycle import BicycleStudy, study_bicycle, write_bicycle
from .precision import all_ran, study_precision, write_precision

__all__ = [
    "BicycleStudy",
    "all_ran",
    "study_bicycle",
    "study_precision",
    "write_bicycle",
    "write_precision",
]
